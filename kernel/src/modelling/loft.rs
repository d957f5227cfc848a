//! Surfaces through contours in layers.

use glam::DVec3;

use super::interpolate::through_parameters;
use super::layers::{Ring, matched, rings};
use crate::{Error, KnotVector, Surface};

/// The surfaces through contours in layers, one between each two neighbours: u goes around from
/// 0 to 1, v from one layer to the next, as far as they are apart.
///
/// They pass through all points. Around, each contour is a periodic cubic spline over its chord
/// length, C2 everywhere. From layer to layer surfaces are cubic, with the derivative at each
/// layer of the parabola through it and its neighbours (Bessel), so that neighbouring surfaces
/// meet with one first derivative: C1, and one tangent plane. Contours are prepared as by
/// [`super::blend`]; heights of parallel layers are linear in v.
///
/// # Errors
/// As [`super::blend`].
pub fn loft(contours: &[Vec<DVec3>]) -> Result<Vec<Surface>, Error> {
    let around = |points: &[DVec3], parameters: &[f64]| through_parameters(points, parameters, 3);
    let rings = rings(contours, around)?;
    let mut height = 0.0;
    let mut strips = Vec::new();
    for k in 0..rings.len() - 1 {
        strips.push(strip(&rings, k, height)?);
        height += rings[k].step;
    }
    Ok(strips)
}

/// The surface between rings `k` and `k + 1`, from `height` on.
fn strip(rings: &[Ring], k: usize, height: f64) -> Result<Surface, Error> {
    let first = k.saturating_sub(1);
    let near = &rings[first..(k + 3).min(rings.len())];
    let curves: Vec<_> = near.iter().map(|ring| &ring.curve).collect();
    let matched = matched(&curves)?;
    let last = rings.len() - 1;
    let mut net = Vec::new();
    for i in 0..matched.knots.count() {
        let at = |ring: usize| matched.points[ring - first][i];
        let slope = |ring: usize| (at(ring + 1) - at(ring)) / rings[ring].step;
        // The derivative at a ring between two others.
        let inner = |ring: usize| {
            let (below, above) = (rings[ring - 1].step, rings[ring].step);
            (slope(ring - 1) * above + slope(ring) * below) / (below + above)
        };
        let derivative = |ring: usize| match ring {
            _ if last == 1 => slope(0),
            0 => slope(0) * 2.0 - inner(1),
            _ if ring == last => slope(last - 1) * 2.0 - inner(last - 1),
            _ => inner(ring),
        };
        let third = rings[k].step / 3.0;
        let (lower, upper) = (at(k), at(k + 1));
        net.extend([
            lower,
            lower + derivative(k) * third,
            upper - derivative(k + 1) * third,
            upper,
        ]);
    }
    let knots_v = KnotVector::bezier(3, height..height + rings[k].step)?;
    Surface::new(matched.knots, knots_v, &net, None)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::modelling::testing::stack;

    #[test]
    fn surfaces_pass_through_all_points() {
        let contours = stack(&[7, 12, 30, 3, 24, 24]);
        let strips = loft(&contours).unwrap();
        for (k, points) in contours.iter().enumerate() {
            let (strip, v) = match strips.get(k) {
                Some(strip) => (strip, strip.knots_v().domain().start),
                None => (&strips[k - 1], strips[k - 1].knots_v().domain().end),
            };
            let rim = strip.iso_curve_v(v);
            let breaks = rim.knots().breaks();
            for point in points {
                let off = breaks.iter().map(|&u| rim.evaluate(u).distance(*point));
                let off = off.fold(f64::INFINITY, f64::min);
                assert!(off < 1e-12, "{k}: {off:e}");
            }
        }
    }

    #[test]
    fn neighbours_share_derivatives() {
        let mut contours = stack(&[20, 12, 30, 9, 24]);
        contours[2].rotate_left(11);
        contours[3].reverse();
        let strips = loft(&contours).unwrap();
        let mut worst = [0.0_f64; 4];
        for pair in strips.windows(2) {
            let v = pair[0].knots_v().domain().end;
            for k in 0..=500 {
                let uv = DVec2::new(f64::from(k) / 500.0, v);
                let [a, b] = [&pair[0], &pair[1]].map(|strip| strip.derivatives(uv));
                worst[0] = worst[0].max(a.point.distance(b.point));
                worst[1] = worst[1].max(a.dv.distance(b.dv)).max(a.du.distance(b.du));
                let [a, b] = [a, b].map(|d| d.du.cross(d.dv).normalize());
                worst[2] = worst[2].max(a.distance(b));
            }
        }
        for strip in &strips {
            let v = strip.knots_v().domain();
            for k in 0..=50 {
                let v = v.start + (v.end - v.start) * f64::from(k) / 50.0;
                let ends = [0.0, 1.0].map(|u| strip.derivatives(DVec2::new(u, v)));
                let off = ends[0]
                    .du
                    .distance(ends[1].du)
                    .max(ends[0].duu.distance(ends[1].duu));
                worst[3] = worst[3].max(off / ends[0].duu.length());
            }
        }
        println!(
            "points {:.1e}, derivatives {:.1e}, normals {:.1e}, seam {:.1e}",
            worst[0], worst[1], worst[2], worst[3]
        );
        assert!(
            worst[0] < 1e-12 && worst[1] < 1e-10 && worst[2] < 1e-10,
            "{worst:?}"
        );
        assert!(worst[3] < 1e-9, "{worst:?}");
    }

    #[test]
    fn turned_layers_are_not_twisted() {
        // A cylinder of which every ring starts elsewhere, and some run backwards.
        let ring = |k: u32| {
            let mut points: Vec<DVec3> = (0..60)
                .map(|j| DVec2::from_angle(f64::from(j) * 0.1 * std::f64::consts::FRAC_PI_3))
                .map(|p| DVec2::new(2.0 * p.x, p.y).extend(f64::from(k)))
                .collect();
            points.rotate_left((k * 17 % 60) as usize);
            if k % 2 == 1 {
                points.reverse();
            }
            points
        };
        let strips = loft(&(0..8).map(ring).collect::<Vec<_>>()).unwrap();
        for strip in &strips {
            let v = strip.knots_v().domain();
            for k in 0..60 {
                let u = f64::from(k) / 60.0;
                let [low, high] = [v.start, v.end].map(|v| strip.evaluate(DVec2::new(u, v)));
                assert!(low.truncate().distance(high.truncate()) < 1e-9);
                let d = strip.derivatives(DVec2::new(u, v.start));
                assert!(d.du.cross(d.dv).dot(d.point.truncate().extend(0.0)) > 0.0);
            }
        }
    }

    #[test]
    fn layers_that_make_no_body_are_told() {
        let contours = stack(&[7, 12, 30]);
        assert!(matches!(
            loft(&contours[..1]),
            Err(Error::PointCount { .. })
        ));
        let mut twice = contours.clone();
        twice[1][4] = twice[1][3];
        assert_eq!(loft(&twice), Err(Error::Coincide { index: 3 }));
        let mut flat = contours.clone();
        flat[2] = flat[1].clone();
        assert_eq!(loft(&flat), Err(Error::Coincide { index: 1 }));
        let mut short = contours;
        short[0].truncate(2);
        assert!(loft(&short).is_err());
    }
}
