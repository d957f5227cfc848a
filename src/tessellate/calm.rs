//! Surfaces with knots almost on each other, or poles that are almost one point.
//!
//! Between two such knots derivatives change as fast as they are near, so that what is known of triangles
//! there is of no use; at a pole written with few digits normals point anywhere. But the surface hardly
//! moves where both become one.

use glam::{DVec3, DVec4};
use kernel::{Aabb, KnotVector, Patch, Surface};

/// Knots no farther from each other than this share of the spans beside them are almost one.
const CLOSE: f64 = 1e-3;

/// Share of the tolerance by which a surface may move when its knots or poles become one.
const MOVED: f64 = 0.01;

/// A border no longer than this share of the row of control points beside it is almost a pole.
const POLE: f64 = 1e-3;

/// A patch whose knots and poles that are almost one are one, and how far its surface is from the true one at most;
/// `None` if it has no such, or its surface would move too far for a tolerance.
pub(super) fn calmed(patch: &Patch, tolerance: f64) -> Option<(Patch, f64)> {
    let surface = &patch.surface;
    let (knots_u, knots_v) = (merged(surface.knots_u()), merged(surface.knots_v()));
    let (mut calm, mut moved) = (None, 0.0);
    if let Some(knots) = knots_u {
        let (with, way) = with_knots(surface, knots)?;
        (calm, moved) = (Some(with), way);
    }
    if let Some(knots) = knots_v {
        let turned = calm.as_ref().unwrap_or(surface).transposed();
        let (with, way) = with_knots(&turned, knots)?;
        (calm, moved) = (Some(with.transposed()), moved + way);
    }
    let most = MOVED * tolerance;
    if let Some((with, way)) = with_poles(calm.as_ref().unwrap_or(surface), most) {
        (calm, moved) = (Some(with), moved + way);
    }
    let surface = calm.filter(|_| moved <= most)?;
    let patch = Patch {
        surface,
        ..patch.clone()
    };
    Some((patch, moved))
}

/// Knots of which those inside that are almost one are one; `None` if there are none such.
fn merged(knots: &KnotVector) -> Option<KnotVector> {
    let breaks = knots.breaks();
    let mut list = None;
    for w in breaks.windows(4) {
        let gaps = [w[1] - w[0], w[2] - w[1], w[3] - w[2]];
        let count = knots.multiplicity(w[1]) + knots.multiplicity(w[2]);
        if gaps[1] <= CLOSE * gaps[0].min(gaps[2]) && count <= knots.degree() {
            list.get_or_insert_with(|| knots.as_slice().to_vec())
                .iter_mut()
                .filter(|t| w[1] < **t && **t <= w[2])
                .for_each(|t| *t = w[1]);
        }
    }
    KnotVector::new(knots.degree(), list?).ok()
}

/// The surface of the same control points over other knots along u, and how far it is from the old one at most: both
/// get all knots of the other, and then their control points are compared.
fn with_knots(surface: &Surface, knots: KnotVector) -> Option<(Surface, f64)> {
    let points: Vec<DVec3> = surface.points().collect();
    let weights: Vec<f64> = surface.weights().collect();
    let new = Surface::new(knots, surface.knots_v().clone(), &points, Some(&weights)).ok()?;
    let a = surface
        .refined_u(&missing(surface.knots_u(), new.knots_u()))
        .ok()?;
    let b = new
        .refined_u(&missing(new.knots_u(), surface.knots_u()))
        .ok()?;
    // With numerators about the middle, `A / w - B / v = (A - B - (B / v) (w - v)) / w`.
    let hull = surface.hull_bounds();
    let about = |h: &DVec4| (h.truncate() - hull.center() * h.w, h.w);
    let (mut off, mut uneven, mut least) = (0.0_f64, 0.0_f64, f64::INFINITY);
    for (a, b) in a.homogeneous().iter().zip(b.homogeneous()) {
        let ((a, w), (b, v)) = (about(a), about(b));
        off = off.max(a.distance(b));
        uneven = uneven.max((w - v).abs());
        least = least.min(w);
    }
    Some((new, (off + 0.5 * hull.diagonal() * uneven) / least))
}

/// The surface with points for those sides of its domain that are almost points, and how far it is from the old one at
/// most; `None` if there are no such sides, or they are longer than `most`.
fn with_poles(surface: &Surface, most: f64) -> Option<(Surface, f64)> {
    let knots = [surface.knots_u(), surface.knots_v()];
    let counts = knots.map(KnotVector::count);
    let mut points: Vec<DVec3> = surface.points().collect();
    let mut moved = 0.0_f64;
    for axis in 0..2 {
        let list = knots[axis].as_slice();
        let order = knots[axis].degree() + 1;
        let last = counts[axis] - 1;
        // The numbers of the points of a line of the net across the axis.
        let line = |at: usize| {
            (0..counts[1 - axis]).map(move |k| match axis {
                0 => at * counts[1] + k,
                _ => k * counts[1] + at,
            })
        };
        // Only there do control points lie on the border.
        let is_clamped = |end: &[f64]| end.iter().all(|t| t.to_bits() == end[0].to_bits());
        for (border, beside, end) in [
            (0, 1, &list[..order]),
            (last, last - 1, &list[list.len() - order..]),
        ] {
            let hull = |at: usize| Aabb::around(line(at).map(|k| points[k]));
            let (own, width) = (hull(border), hull(beside).diagonal());
            let length = own.diagonal();
            if is_clamped(end) && length > 0.0 && length <= most && length <= POLE * width {
                line(border).for_each(|k| points[k] = own.center());
                moved += length;
            }
        }
    }
    if moved <= 0.0 {
        return None;
    }
    let weights: Vec<f64> = surface.weights().collect();
    let [u, v] = knots.map(KnotVector::clone);
    let new = Surface::new(u, v, &points, Some(&weights)).ok()?;
    Some((new, moved))
}

/// The knots that are in `other` and not in `own`, as often as that is so.
fn missing(own: &KnotVector, other: &KnotVector) -> Vec<f64> {
    let breaks = other.breaks();
    let times = |t: f64| other.multiplicity(t).saturating_sub(own.multiplicity(t));
    let missing = breaks.into_iter();
    missing
        .flat_map(|t| std::iter::repeat_n(t, times(t)))
        .collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::super::tests::scene;
    use super::*;
    use crate::{TessellateOptions, tessellate};

    /// A bent surface with two knots along u so far apart.
    fn bent(apart: f64) -> Surface {
        let knots = vec![0.0, 0.0, 0.0, 0.0, 0.5, 0.5 + apart, 1.0, 1.0, 1.0, 1.0];
        let across = KnotVector::bezier(3, 0.0..1.0).unwrap();
        let place = |k: u32| {
            let (i, j) = (f64::from(k / 4), f64::from(k % 4));
            DVec3::new(i, j, (i * 1.7).sin() + (j * 1.1).cos())
        };
        let points: Vec<_> = (0..24).map(place).collect();
        let weights: Vec<_> = (0..24).map(|k| 1.0 + 0.3 * f64::from(k % 5)).collect();
        let along = KnotVector::new(3, knots).unwrap();
        Surface::new(along, across, &points, Some(&weights)).unwrap()
    }

    #[test]
    fn surfaces_move_no_farther_than_is_said() {
        for apart in [1e-4, 1e-6, 1e-9] {
            let patch = Patch::from(bent(apart));
            let (calm, moved) = calmed(&patch, 1.0).unwrap();
            assert!(moved > 0.0 && moved < 30.0 * apart, "{moved}");
            for k in 0..=1000 {
                let u = 0.5 + apart * (f64::from(k) / 250.0 - 2.0);
                let uv = DVec2::new(u, f64::from(k % 7) / 6.0);
                let off = patch
                    .surface
                    .evaluate(uv)
                    .distance(calm.surface.evaluate(uv));
                assert!(off <= moved + 1e-14, "{off} {moved}");
            }
            assert!(calmed(&patch, moved).is_none());
        }
        assert!(calmed(&bent(0.1).into(), 1.0).is_none());
    }

    /// A cone about z with its tip at 1, of which every other control point is so far below.
    fn cone(below: f64) -> Surface {
        let around = vec![0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0];
        let half = 0.5_f64.sqrt();
        let place = |k: u32| {
            let (turn, up) = (f64::from(k % 9).to_radians() * 45.0, f64::from(k / 9));
            let is_corner = k % 9 % 2 == 1;
            let size = if is_corner { half.recip() } else { 1.0 } * (1.0 - up);
            let down = if is_corner { below * up } else { 0.0 };
            let point = DVec3::new(turn.cos() * size, turn.sin() * size, up - down);
            (point, if is_corner { half } else { 1.0 })
        };
        let (points, weights): (Vec<_>, Vec<_>) = (0..18).map(place).unzip();
        let along = KnotVector::bezier(1, 0.0..1.0).unwrap();
        let around = KnotVector::new(2, around).unwrap();
        Surface::new(along, around, &points, Some(&weights)).unwrap()
    }

    #[test]
    fn poles_of_few_digits_are_as_good_as_others() {
        let triangles = |below: f64| {
            let scene = scene(vec![cone(below).into()]);
            let made = tessellate(&scene, &TessellateOptions::default()).unwrap();
            let face = made.faces[0].as_ref().unwrap();
            assert!(face.proven <= face.tolerance && face.unproven == 0);
            for ((point, normal), uv) in (face.mesh.positions().iter())
                .zip(face.mesh.normals())
                .zip(&face.parameters)
            {
                assert!(cone(below).evaluate(*uv).distance(*point) <= face.proven);
                // All lines of a cone are as steep.
                assert!((normal.z.abs() - 0.5_f64.sqrt()).abs() < 1e-5, "{normal}");
            }
            face.mesh.triangles().len()
        };
        let exact = triangles(0.0);
        for below in [1e-9, 1e-7, 1e-6, 3e-6] {
            assert_eq!(triangles(below), exact, "{below}");
        }
    }

    #[test]
    fn knots_almost_on_each_other_cost_no_triangles() {
        let count = |apart: f64| {
            let scene = scene(vec![bent(apart).into()]);
            let made = tessellate(&scene, &TessellateOptions::default()).unwrap();
            let face = made.faces[0].as_ref().unwrap();
            assert!(face.proven <= face.tolerance && face.unproven == 0);
            for (point, uv) in face.mesh.positions().iter().zip(&face.parameters) {
                let off = bent(apart).evaluate(*uv).distance(*point);
                assert!(off <= face.proven, "{off}");
            }
            face.mesh.triangles().len()
        };
        let (near, far) = (count(1e-7), count(0.05));
        assert!(near <= 2 * far, "{near} {far}");
    }
}
