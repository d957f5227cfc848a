//! Spheres and tori: what a circle or a part of one makes that turns about an axis.
//!
//! There every point of a flat triangle has a nearest point of the surface in plain terms. With the corners `P_i`
//! at the distances `r_i` from the axis and the shares `l_i`, a point of it is at the distance `q` from the axis, and
//! `q^2 = q0^2 - sum(l_i l_j t_ij)` over all pairs, where `q0 = sum(l_i r_i)` and `t_ij = |P_i - P_j|^2` without the
//! parts along the axis and away from it. In the half plane through the axis the circle with the radius `a` has its
//! middle at the distance `c` from the axis, and the square of the distance from there is
//! `a^2 - sum(l_i l_j |P_i - P_j|^2) + 2 c s` with `s = q0 - q = sum(l_i l_j t_ij) / (q0 + q)`. On a sphere
//! `c = 0`, and that is exact.
//!
//! Bounds of second derivatives at equal parameters are worse by far near the axis, where the sides of a triangle
//! bend in the surface more than with it.

mod circle;

use std::ops::Range;

use glam::{DMat3, DVec2, DVec3};
use kernel::{Curve, KnotVector, Patch, Surface};

use self::circle::{Arcs, Circle};
use super::pieces::{Rect, highest};

/// A surface is one of these if it is no farther from it than this share of the circle's radius.
const OFF: f64 = 1e-9;

/// Weights that differ from products by less than this share are products.
const ROUNDING: f64 = 1e-12;

/// A circle is large if its radius is this many times a tolerance.
const LARGE: f64 = 8.0;

/// The cosine of half of the largest angle around the axis of a torus that a triangle may have.
const WIDEST: f64 = 0.8;

/// Parts of a circle that are looked at to know on which side of the axis it is.
const PARTS: usize = 8;

/// The sides of a triangle.
const SIDES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// A sphere or a torus.
#[derive(Debug)]
pub(super) struct Round {
    around: usize,
    /// From space to the surface's own coordinates, of which the last one is along the axis.
    turn: DMat3,
    middle: DVec3,
    /// How far the middle of the circle is from the axis, on the side of its points if positive.
    spine: f64,
    /// The radius of the circle.
    tube: f64,
    /// 1 if the derivatives along u and v, in this order, turn about the way out of the circle, -1 if about the way in.
    side: f64,
    /// How far the surface is from it at most.
    off: f64,
    /// The circles around the axis and along it.
    arcs: [Arcs; 2],
}

impl Round {
    /// The surface of a patch as one, if it is one in quadratic pieces, and if what the loops leave of it does not
    /// cross the axis.
    pub(super) fn of(patch: &Patch) -> Option<Self> {
        let surface = &patch.surface;
        let knots = [surface.knots_u(), surface.knots_v()];
        if knots.map(KnotVector::degree) != [2, 2] {
            return None;
        }
        let [u, v] = knots.map(KnotVector::domain);
        let domain = Rect {
            min: DVec2::new(u.start, v.start),
            max: DVec2::new(u.end, v.end),
        };
        let curves = patch.trim_curves();
        let used = Rect::around(curves.iter().flat_map(Curve::points)).within(&domain);
        (0..2).find_map(|around| Self::about(surface, around, &used))
    }

    fn about(surface: &Surface, around: usize, used: &Rect) -> Option<Self> {
        let knots = [surface.knots_u(), surface.knots_v()];
        let rows = Rows::of(surface, around)?;
        let [x, y, axis] = plane_of(&rows.arms)?;
        let flat: Vec<DVec2> = rows
            .arms
            .iter()
            .map(|arm| DVec2::new(arm.dot(x), arm.dot(y)))
            .collect();
        let lifts = rows.arms.iter().map(|arm| arm.dot(axis));
        let lift = lifts.clone().sum::<f64>() / flat.len() as f64;
        let uneven = lifts.map(|own| (own - lift).abs()).fold(0.0, f64::max);
        let curve = Curve::new(knots[around].clone(), &flat, Some(&rows.across)).ok()?;
        let circle = Circle::of(&curve)?;
        // Where the middles of the circles of all rows are.
        let arm = x * circle.middle.x + y * circle.middle.y + axis * lift;
        let middles = rows
            .means
            .iter()
            .zip(&rows.shares)
            .map(|(mean, share)| *mean + arm * *share);
        let middles: Vec<DVec3> = middles.collect();
        let first = middles[0];
        let beside = |middle: &DVec3| (*middle - first).reject_from_normalized(axis).length();
        let beside = middles.iter().map(beside).fold(0.0, f64::max);
        let profile = middles.iter().zip(&rows.shares);
        let profile = profile
            .map(|(middle, share)| DVec2::new(circle.radius * share, (*middle - first).dot(axis)));
        let profile: Vec<DVec2> = profile.collect();
        let curve = Curve::new(knots[1 - around].clone(), &profile, Some(&rows.along)).ok()?;
        let tube = Circle::of(&curve)?;
        let is_near = |x: f64| x.abs() <= OFF * tube.radius;
        let spine = if is_near(tube.middle.x) {
            0.0
        } else {
            tube.middle.x
        };
        let off =
            rows.off + uneven + circle.off + beside + tube.off + (spine - tube.middle.x).abs();
        let (start, end) = (used.min[1 - around], used.max[1 - around]);
        let is_beyond = is_beyond_axis(&curve, start..end, OFF * tube.radius)?;
        if !is_near(off) {
            return None;
        }
        let mut round = Self {
            around,
            turn: DMat3::from_cols(x, y, axis).transpose(),
            middle: first + axis * tube.middle.y,
            spine,
            tube: tube.radius,
            side: 1.0,
            off,
            arcs: [circle.arcs, tube.arcs],
        };
        if is_beyond {
            // What lies on the other side of the axis is half a turn farther on this one.
            round.spine = -spine;
            round.arcs[0].mirror(DVec2::NEG_ONE);
            round.arcs[1].mirror(DVec2::new(-1.0, 1.0));
        }
        let (point, [du, dv]) = surface.tangents(used.min.midpoint(used.max));
        let p = round.local(point);
        let spine = p.truncate().normalize_or_zero() * round.spine;
        round.side = (round.turn * du.cross(dv))
            .dot(p - spine.extend(0.0))
            .signum();
        Some(round)
    }

    /// Whether a tolerance is small beside it, so that nearest points are what is meant.
    pub(super) fn is_large(&self, tolerance: f64) -> bool {
        self.tube >= LARGE * tolerance
    }

    fn local(&self, point: DVec3) -> DVec3 {
        self.turn * (point - self.middle)
    }

    /// The corners of a triangle.
    fn corners(&self, points: [DVec3; 3]) -> Corners {
        let local = points.map(|p| self.local(p));
        let radii = local.map(|p| p.truncate().length());
        let directions = [0, 1, 2].map(|k| {
            let is_on_axis = radii[k] <= OFF * self.tube;
            (!is_on_axis).then(|| local[k].truncate() / radii[k])
        });
        let mut widest = 1.0_f64;
        for [i, j] in SIDES {
            if let (Some(a), Some(b)) = (directions[i], directions[j]) {
                widest = widest.min(a.dot(b));
            }
        }
        Corners {
            local,
            radii,
            directions,
            half: (0.5 + 0.5 * widest.max(-1.0)).sqrt(),
        }
    }

    /// Whether nearest points run around a flat triangle the other way than its corners do, somewhere, so that they
    /// may lie beyond a boundary.
    ///
    /// They do not where its normal and the surface's, which leads from the middle of the circle to the point, are
    /// on the same side.
    pub(super) fn is_folded(&self, points: [DVec3; 3]) -> bool {
        let corners = self.corners(points);
        let [a, b, c] = corners.local;
        let normal = (b - a).cross(c - a) * self.side;
        let height = normal.dot(a);
        if self.is_sphere() {
            return height <= 0.0;
        }
        // Arcs between directions lie between these and as much farther out.
        let directions = corners.directions.iter().flatten();
        let along = directions.map(|d| self.spine * normal.truncate().dot(*d));
        let along = along.fold(f64::NEG_INFINITY, f64::max);
        height <= along.max(along / corners.half)
    }

    /// How far the points of a flat triangle are from the surface at most; infinitely far if it reaches so far around
    /// the axis that this is not known.
    pub(super) fn off_flat(&self, points: [DVec3; 3]) -> f64 {
        let corners = self.corners(points);
        let Corners {
            local, radii, half, ..
        } = corners;
        if half < WIDEST && !self.is_sphere() {
            return f64::INFINITY;
        }
        let chords = SIDES.map(|[i, j]| local[i].distance_squared(local[j]));
        let bends = SIDES.map(|[i, j]| {
            let flat = local[i].truncate().distance_squared(local[j].truncate());
            (flat - (radii[i] - radii[j]).powi(2)).max(0.0)
        });
        // The greatest value of the sums over pairs, with these shares of chords and bends.
        let most = |chord: f64, bend: f64| {
            2.0 * highest([0, 1, 2].map(|k| chord * chords[k] + bend * bends[k]))
        };
        let (near, far) = (
            radii[0].min(radii[1]).min(radii[2]),
            radii[0].max(radii[1]).max(radii[2]),
        );
        let double = 2.0 * self.spine.abs();
        // What `2 c s` is, but for its sign: at most, and as a multiple of the sum over bends at most and at least.
        let whole = double * far * (1.0 - half);
        let (steep, shallow) = (double / (near * (1.0 + half)), 0.5 * double / far);
        let (inside, outside) = if self.is_sphere() {
            (most(1.0, 0.0), 0.0)
        } else if self.spine > 0.0 {
            (most(1.0, -shallow), most(-1.0, steep).min(whole))
        } else {
            (most(1.0, steep).min(most(1.0, 0.0) + whole), 0.0)
        };
        // The corners need not be on it.
        let square = self.tube * self.tube;
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for k in 0..3 {
            let off = DVec2::new(radii[k] - self.spine, local[k].z).length_squared() - square;
            (low, high) = (low.min(off), high.max(off));
        }
        let inside = square - inside + low;
        if inside <= 0.0 {
            return f64::INFINITY;
        }
        let outside = (square + outside + high).sqrt() - self.tube;
        outside.max(self.tube - inside.sqrt()) + self.off
    }

    /// The axis of the parameters that leads around the axis of the surface.
    pub(super) fn around(&self) -> usize {
        self.around
    }

    /// How far a point is from the surface, all of which is there.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let p = self.local(point);
        let away = DVec2::new(p.truncate().length() - self.spine, p.z);
        (away.length() - self.tube).abs()
    }

    pub(super) fn is_sphere(&self) -> bool {
        self.spine.abs() <= 0.0
    }

    /// The parameters of the surface's point nearest to a point beside it, near some others.
    pub(super) fn place(&self, point: DVec3, near: DVec2) -> DVec2 {
        let p = self.local(point);
        let flat = p.truncate();
        let ways = [flat, DVec2::new(flat.length() - self.spine, p.z)];
        let mut place = near;
        for (arcs, (axis, way)) in self
            .arcs
            .iter()
            .zip([self.around, 1 - self.around].into_iter().zip(ways))
        {
            place[axis] = arcs.toward(way, near[axis]);
        }
        place
    }
}

/// The corners of a triangle in coordinates of a surface.
struct Corners {
    local: [DVec3; 3],
    /// How far they are from the axis, and in which direction; none on the axis.
    radii: [f64; 3],
    directions: [Option<DVec2>; 3],
    /// The cosine of half of the largest angle between these.
    half: f64,
}

/// The points of a surface in rows around an axis, if all rows are the same, moved and made smaller or larger.
struct Rows {
    /// The weights of points in a row, and of rows.
    across: Vec<f64>,
    along: Vec<f64>,
    /// The mean of each row, and its size as a share of the widest one's.
    means: Vec<DVec3>,
    shares: Vec<f64>,
    /// The ways from the mean of the widest row to its points.
    arms: Vec<DVec3>,
    /// How far points are from where they should be.
    off: f64,
}

impl Rows {
    fn of(surface: &Surface, around: usize) -> Option<Self> {
        let (u, v) = (surface.knots_u().count(), surface.knots_v().count());
        let [count, length] = if around == 0 { [v, u] } else { [u, v] };
        let net = surface.homogeneous();
        let at = |row: usize, k: usize| match around {
            0 => net[k * v + row],
            _ => net[row * v + k],
        };
        let across: Vec<f64> = (0..length).map(|k| at(0, k).w).collect();
        let along: Vec<f64> = (0..count).map(|row| at(row, 0).w).collect();
        let is_product = |row: usize, k: usize| {
            let (have, want) = (at(row, k).w * across[0], along[row] * across[k]);
            (have - want).abs() <= ROUNDING * want
        };
        if !(0..count).all(|row| (0..length).all(|k| is_product(row, k))) {
            return None;
        }
        let point = |row: usize, k: usize| at(row, k).truncate() / at(row, k).w;
        let mean = |row: usize| (0..length).map(|k| point(row, k)).sum::<DVec3>() / length as f64;
        let means: Vec<DVec3> = (0..count).map(mean).collect();
        let arm = |row: usize, k: usize| point(row, k) - means[row];
        let dot = |row: usize, other: usize| -> f64 {
            (0..length).map(|k| arm(row, k).dot(arm(other, k))).sum()
        };
        let widest = (0..count).max_by(|&a, &b| dot(a, a).total_cmp(&dot(b, b)))?;
        let size = dot(widest, widest);
        let shares: Vec<f64> = (0..count).map(|row| dot(row, widest) / size).collect();
        let stray = |row: usize, k: usize| arm(row, k).distance(arm(widest, k) * shares[row]);
        let strays = (0..count).flat_map(|row| (0..length).map(move |k| (row, k)));
        let off = strays.map(|(row, k)| stray(row, k)).fold(0.0, f64::max);
        Some(Self {
            across,
            along,
            arms: (0..length).map(|k| arm(widest, k)).collect(),
            means,
            shares,
            off,
        })
    }
}

/// Two directions of the plane that points lie in, and the one across it; `None` if they are on a line.
fn plane_of(points: &[DVec3]) -> Option<[DVec3; 3]> {
    let farthest = |ways: &mut dyn Iterator<Item = DVec3>| -> Option<DVec3> {
        let way = ways.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
        way.try_normalize()
    };
    let x = farthest(&mut points.iter().map(|p| *p - points[0]))?;
    let y = farthest(
        &mut points
            .iter()
            .map(|p| (*p - points[0]).reject_from_normalized(x)),
    )?;
    Some([x, y, x.cross(y).try_normalize()?])
}

/// Whether a part of a curve lies on the other side of the axis, where the first coordinate is negative; `None`
/// if it lies on both, by more than `near`.
fn is_beyond_axis(curve: &Curve<DVec2>, part: Range<f64>, near: f64) -> Option<bool> {
    // Control points of short parts are near them.
    let stop = |k: usize| part.start + (part.end - part.start) * (k as f64 / PARTS as f64);
    let part = |k: usize| curve.restricted(stop(k)..stop(k + 1)).ok();
    let parts: Vec<_> = (0..PARTS).map(part).collect::<Option<_>>()?;
    let lies = |sign: f64| {
        let mut points = parts.iter().flat_map(Curve::points);
        points.all(|p| sign * p.x >= -near)
    };
    if lies(1.0) {
        Some(false)
    } else {
        lies(-1.0).then_some(true)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    use glam::DAffine3;
    use kernel::modelling::{self, Frame};

    use super::*;

    /// A patch somewhere in space.
    fn placed(surface: &Surface) -> Patch {
        let turn = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        let map = DAffine3::from_translation(DVec3::new(5.0, -3.0, 2.0)) * turn;
        Patch::from(surface.transformed(&map))
    }

    /// Spheres and parts of tori: outer and inner sides, next to the axis, on it, and beyond it.
    fn surfaces() -> Vec<Patch> {
        let sphere = modelling::sphere(&Frame::WORLD, 2.0, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2);
        let torus = |spine: f64, range: Range<f64>| {
            modelling::torus(&Frame::WORLD, spine, 1.0, 0.0..5.0, range)
        };
        let all = [
            sphere,
            torus(3.0, 0.0..TAU),
            torus(1.05, 2.0..4.0),
            torus(0.5, 0.0..2.0),
            // From the axis on, where the other side of a spindle begins.
            torus(0.5, TAU / 3.0..4.0),
        ];
        all.into_iter().map(|s| placed(&s.unwrap())).collect()
    }

    #[test]
    fn no_point_of_a_triangle_is_farther_than_proven() {
        let mut rng = fastrand::Rng::with_seed(7);
        for (number, patch) in surfaces().iter().enumerate() {
            let round = Round::of(patch).unwrap();
            assert_eq!(round.is_sphere(), number == 0);
            let surface = &patch.surface;
            let [u, v] = [surface.knots_u(), surface.knots_v()].map(KnotVector::domain);
            let (min, max) = (DVec2::new(u.start, v.start), DVec2::new(u.end, v.end));
            let (mut known, mut tight) = (0, 0);
            for _ in 0..2000 {
                let size = 0.3 * rng.f64();
                let start = DVec2::new(rng.f64(), rng.f64()) * (1.0 - size);
                let uvs = [(); 3].map(|()| {
                    let share = start + DVec2::new(rng.f64(), rng.f64()) * size;
                    min + (max - min) * share
                });
                let points = uvs.map(|uv| surface.evaluate(uv));
                let bound = round.off_flat(points);
                if bound.is_infinite() {
                    continue;
                }
                known += 1;
                let mut most = 0.0_f64;
                for i in 0..=12 {
                    for j in 0..=12 - i {
                        let shares = [i, j, 12 - i - j].map(|k| f64::from(k) / 12.0);
                        let flat = (0..3).map(|k| points[k] * shares[k]).sum();
                        let near = (0..3).map(|k| uvs[k] * shares[k]).sum();
                        let place = round.place(flat, near);
                        let found = surface.evaluate(place).distance(flat);
                        // Beyond the border of the surface there is nothing.
                        let is_inside = place.cmpgt(min).all() && place.cmplt(max).all();
                        if is_inside {
                            let distance = round.distance(flat);
                            assert!(
                                (found - distance).abs() < 1e-9,
                                "{number}: {found} {distance}"
                            );
                        }
                        most = most.max(round.distance(flat));
                    }
                }
                assert!(most <= bound + 1e-12, "{number}: {most} {bound}");
                tight += usize::from(most > 0.6 * bound);
            }
            assert!(
                known > 1500 && tight > known / 2,
                "{number}: {tight} of {known}"
            );
        }
    }

    #[test]
    fn a_triangle_of_the_plane_is_not_folded_and_one_turned_over_is() {
        for patch in surfaces() {
            let round = Round::of(&patch).unwrap();
            let surface = &patch.surface;
            let [u, v] = [surface.knots_u(), surface.knots_v()].map(KnotVector::domain);
            for k in 0..9 {
                let share = (f64::from(k) + 0.3) / 10.0;
                let at = |x: f64, y: f64| {
                    let u = u.start + (u.end - u.start) * (share + 0.02 * x);
                    surface.evaluate(DVec2::new(
                        u,
                        v.start + (v.end - v.start) * (share + 0.02 * y),
                    ))
                };
                let points = [at(0.0, 0.0), at(1.0, 0.0), at(0.3, 1.0)];
                assert!(!round.is_folded(points));
                assert!(round.is_folded([points[1], points[0], points[2]]));
            }
        }
    }

    #[test]
    fn other_surfaces_are_none() {
        let sphere = modelling::sphere(&Frame::WORLD, 2.0, 0.0..TAU, -1.0..1.0).unwrap();
        let wide = sphere.transformed(&DAffine3::from_scale(DVec3::new(1.0, 1.0, 1.001)));
        // Flat ellipsoids turn about an axis, but not a circle; others do not turn.
        assert!(Round::of(&Patch::from(wide)).is_none());
        let oval = sphere.transformed(&DAffine3::from_scale(DVec3::new(1.001, 1.0, 1.0)));
        assert!(Round::of(&Patch::from(oval)).is_none());
        let cylinder = modelling::cylinder(&Frame::WORLD, 2.0, 0.0..PI, 0.0..1.0).unwrap();
        assert!(Round::of(&Patch::from(cylinder)).is_none());
        // Both sides of the axis.
        let spindle = modelling::torus(&Frame::WORLD, 0.5, 1.0, 0.0..TAU, 0.0..TAU).unwrap();
        assert!(Round::of(&Patch::from(spindle)).is_none());
    }
}
