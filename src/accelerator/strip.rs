//! A strip across the gap between two boundaries that should be one.
//!
//! Both sides are curves of degree seven, so near to the true boundaries that nothing passes
//! between strip and face. A ray is met in the plane across it: parts of the strip are halved
//! until they are flat, and left out as soon as they are beside the ray. Nearly all rays are beside
//! the line from end to end of each of the runs that a strip is divided into before.

use std::sync::LazyLock;

use glam::{DVec2, DVec3};
use kernel::{Aabb, Ray};

use crate::segment;

/// Coefficients of each side.
pub(super) const ORDER: usize = 8;

/// Where the sides are taken from the boundaries: Chebyshev's points from 0 to 1.
pub(super) const NODES: [f64; ORDER] = [
    0.0,
    0.049_515_566_048_790_45,
    0.188_255_099_070_633_2,
    0.388_739_533_021_842_8,
    0.611_260_466_978_157_2,
    0.811_744_900_929_366_8,
    0.950_484_433_951_209_5,
    1.0,
];

/// Halvings at most of a strip that a ray meets.
const DEPTH: u32 = 24;

/// The strip counts as leaning against a ray by at least this cosine.
const LEAN: f64 = 0.05;

/// A strip: at each place straight from one side to the other.
#[derive(Clone, Debug)]
pub(super) struct Strip {
    /// Bernstein coefficients of both sides in the cluster.
    pub(super) sides: [[DVec3; ORDER]; 2],
    /// The same of the parameters of the first side on its face.
    pub(super) uv: [DVec2; ORDER],
    /// Number of that face among the items of the cluster.
    pub(super) item: u32,
    /// Whether it prolongs both faces: who passes through it is behind both. Else they overlap,
    /// and one of them may be met close by.
    pub(super) apart: bool,
}

/// A part of a strip: no point of it, nor what is beside it within the margin, is farther than a radius from the
/// line between two ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// Its strip, by the number.
    pub(super) strip: u32,
    range: (f64, f64),
    pub(super) ends: [DVec3; 2],
    pub(super) radius: f64,
}

/// Where a ray passes through a strip.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// The ray parameter.
    pub(super) t: f64,
    /// A face met within this of `t` accounts for the ray.
    pub(super) window: f64,
    /// Parameters of the nearest point of the first side.
    pub(super) uv: DVec2,
    /// Width of the strip there.
    pub(super) width: f64,
}

/// A ray's line, and the plane across it through the point next to `center`.
pub(super) struct Across {
    origin: DVec3,
    axes: [DVec3; 3],
    shift: f64,
    length: f64,
}

impl Across {
    pub(super) fn new(ray: &Ray, center: DVec3) -> Self {
        let length = ray.direction.length();
        let unit = ray.direction / length;
        let shift = (center - ray.origin).dot(unit) / length;
        let (e1, e2) = unit.any_orthonormal_pair();
        Self {
            origin: ray.at(shift),
            axes: [e1, e2, unit],
            shift,
            length,
        }
    }

    /// Whether the ray passes a run by.
    pub(super) fn is_beside(&self, run: &Run) -> bool {
        let [a, b] = run.ends.map(|end| self.place(end).truncate().extend(0.0));
        segment::distance(DVec3::ZERO, a, b) > run.radius
    }

    /// Two coordinates across the ray and one along it.
    fn place(&self, point: DVec3) -> DVec3 {
        let p = point - self.origin;
        DVec3::from_array(self.axes.map(|axis| axis.dot(p)))
    }
}

/// A part of a strip in the coordinates of a ray.
struct Part {
    sides: [[DVec3; ORDER]; 2],
    range: (f64, f64),
}

impl Strip {
    /// Adds its runs and a box around each. It is halved up to `depth` times, until no box is larger than a square of
    /// that length, seen from any side.
    pub(super) fn divide(
        &self,
        number: u32,
        (margin, length): (f64, f64),
        depth: u32,
        runs: &mut Vec<(Aabb, Run)>,
    ) {
        self.whole(|p| p)
            .divide(number, (margin, length), depth, runs);
    }

    /// All of it, with other places for its points.
    fn whole(&self, place: impl Fn(DVec3) -> DVec3) -> Part {
        Part {
            sides: self.sides.map(|side| side.map(&place)),
            range: (0.0, 1.0),
        }
    }

    /// Tells every place where the ray passes a run of the strip, or beside it within `margin`.
    pub(super) fn meet(
        &self,
        run: &Run,
        ray: &Across,
        margin: f64,
        tell: &mut impl FnMut(Crossing),
    ) {
        let part = self.whole(|p| ray.place(p));
        let (start, end) = run.range;
        part.follow(run.range, margin, DEPTH, &mut |place, s, cosine, width| {
            // What is straight is not divided as far as to the run.
            if s < start || s > end {
                return;
            }
            let near = if self.apart {
                margin
            } else {
                width.max(margin)
            };
            let window = 2.0 * near / cosine.max(LEAN);
            tell(Crossing {
                t: ray.shift + place / ray.length,
                window: window / ray.length,
                uv: bernstein(&self.uv, s),
                width,
            });
        });
    }
}

impl Part {
    /// See [`Strip::divide`].
    fn divide(
        &self,
        strip: u32,
        (margin, length): (f64, f64),
        depth: u32,
        runs: &mut Vec<(Aabb, Run)>,
    ) {
        let points = self.sides.iter().flatten().copied();
        let Aabb { min, max } = Aabb::around(points.clone());
        let size = max - min;
        let faces = size * DVec3::new(size.y, size.z, size.x);
        if depth > 0 && faces.max_element() > length * length {
            for half in self.halves() {
                half.divide(strip, (margin, length), depth - 1, runs);
            }
            return;
        }
        let [[a, .., b], [c, .., d]] = self.sides;
        let ends = [a.midpoint(c), b.midpoint(d)];
        let off = |p: DVec3| segment::distance(p, ends[0], ends[1]);
        let bounds = Aabb {
            min: min - margin,
            max: max + margin,
        };
        let run = Run {
            strip,
            range: self.range,
            ends,
            radius: points.map(off).fold(0.0, f64::max) + margin,
        };
        runs.push((bounds, run));
    }

    fn follow(
        &self,
        wanted: (f64, f64),
        margin: f64,
        depth: u32,
        tell: &mut impl FnMut(f64, f64, f64, f64),
    ) {
        if self.range.1 <= wanted.0 || self.range.0 >= wanted.1 {
            return;
        }
        let Aabb { min, max } = Aabb::around(self.sides.iter().flatten().copied());
        let beside = |k: usize| min[k] > margin || max[k] < -margin;
        if beside(0) || beside(1) || self.is_passed(margin) {
            return;
        }
        if depth > 0 && !self.is_flat(margin) {
            for half in self.halves() {
                half.follow(wanted, margin, depth - 1, tell);
            }
            return;
        }
        let [[a, .., b], [c, .., d]] = self.sides;
        let (start, end) = self.range;
        for (corners, along) in [
            ([a, b, d], [start, end, end]),
            ([a, d, c], [start, end, start]),
        ] {
            let Some(weights) = around_origin(&corners, margin) else {
                continue;
            };
            let sum = |of: [f64; 3]| (0..3).map(|k| of[k] * weights[k]).sum::<f64>();
            let s = sum(along);
            let share = if end > start {
                (s - start) / (end - start)
            } else {
                0.0
            };
            let across = (c - a).lerp(d - b, share);
            let normal = (b - a).cross(across).normalize_or_zero();
            tell(
                sum(corners.map(|p| p.z)),
                s,
                normal.z.abs(),
                across.length(),
            );
            return;
        }
    }

    /// Whether the ray is before the part along its strip, or behind it. Of a strip that is wide and runs aslant
    /// the boxes of very many parts are around the ray.
    fn is_passed(&self, margin: f64) -> bool {
        let [[a, .., b], [c, .., d]] = self.sides;
        let across = ((c - a) + (d - b)).truncate();
        let places = self
            .sides
            .iter()
            .flatten()
            .map(|p| across.perp_dot(p.truncate()));
        let (min, max) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), place| {
            (place.min(min), place.max(max))
        });
        let margin = margin * across.length();
        min > margin || max < -margin
    }

    /// Whether both sides are straight.
    fn is_flat(&self, margin: f64) -> bool {
        self.sides.iter().all(|side| {
            let (first, last) = (side[0], side[ORDER - 1]);
            let chord = |k: usize| first.lerp(last, k as f64 / (ORDER - 1) as f64);
            (1..ORDER - 1).all(|k| side[k].distance_squared(chord(k)) <= 0.25 * margin * margin)
        })
    }

    fn halves(&self) -> [Self; 2] {
        let (mut left, mut right) = (self.sides, self.sides);
        for (left, right) in left.iter_mut().zip(&mut right) {
            for (level, end) in left.iter_mut().enumerate().skip(1) {
                for k in 0..ORDER - level {
                    right[k] = (right[k] + right[k + 1]) * 0.5;
                }
                *end = right[0];
            }
        }
        let (start, end) = self.range;
        let middle = 0.5 * (start + end);
        [(left, (start, middle)), (right, (middle, end))]
            .map(|(sides, range)| Self { sides, range })
    }
}

/// The weights of the corners of a triangle for the point next to the origin in the first two
/// coordinates, if it is no farther than `margin`.
fn around_origin(corners: &[DVec3; 3], margin: f64) -> Option<[f64; 3]> {
    let [a, b, c] = corners.map(DVec3::truncate);
    let areas = [b.perp_dot(c), c.perp_dot(a), a.perp_dot(b)];
    let sum: f64 = areas.iter().sum();
    if sum != 0.0 && areas.iter().all(|x| x * sum >= 0.0) {
        return Some(areas.map(|x| x / sum));
    }
    // Outside: the nearest point of a side.
    let sides = [([a, b], [0, 1]), ([b, c], [1, 2]), ([c, a], [2, 0])];
    let near = sides.map(|([from, to], ends)| {
        let way = to - from;
        let share = segment::share(DVec3::ZERO, from.extend(0.0), to.extend(0.0));
        let mut weights = [0.0; 3];
        weights[ends[0]] += 1.0 - share;
        weights[ends[1]] += share;
        ((from + way * share).length(), weights)
    });
    let nearest = near.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    (nearest.0 <= margin).then_some(nearest.1)
}

/// The value of Bernstein coefficients.
pub(super) fn bernstein<P>(coefficients: &[P; ORDER], t: f64) -> P
where
    P: Copy + std::ops::Add<Output = P> + std::ops::Mul<f64, Output = P>,
{
    let mut row = *coefficients;
    for level in 1..ORDER {
        for k in 0..ORDER - level {
            row[k] = row[k] * (1.0 - t) + row[k + 1] * t;
        }
    }
    row[0]
}

/// The Bernstein coefficients of the polynomial with these values at [`NODES`].
pub(super) fn interpolated<P>(values: &[P; ORDER]) -> [P; ORDER]
where
    P: Copy + Default + std::ops::Add<Output = P> + std::ops::Mul<f64, Output = P>,
{
    static INVERSE: LazyLock<[[f64; ORDER]; ORDER]> = LazyLock::new(inverse);
    std::array::from_fn(|i| {
        let terms = values.iter().zip(INVERSE[i]);
        terms.fold(P::default(), |sum, (&value, weight)| sum + value * weight)
    })
}

/// The inverse of the matrix of Bernstein polynomials at the nodes, by elimination.
fn inverse() -> [[f64; ORDER]; ORDER] {
    let unit = |k: usize| std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 });
    let mut inverse: [[f64; ORDER]; ORDER] = std::array::from_fn(unit);
    let mut matrix =
        NODES.map(|t| -> [f64; ORDER] { std::array::from_fn(|k| bernstein(&unit(k), t)) });
    for k in 0..ORDER {
        // The matrix is totally positive: it needs no pivots.
        let scale = 1.0 / matrix[k][k];
        for x in matrix[k].iter_mut().chain(&mut inverse[k]) {
            *x *= scale;
        }
        for row in (0..ORDER).filter(|&row| row != k) {
            let factor = matrix[row][k];
            for column in 0..ORDER {
                matrix[row][column] -= factor * matrix[k][column];
                inverse[row][column] -= factor * inverse[k][column];
            }
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip along a bent line, as wide as `width`.
    fn strip(width: f64) -> Strip {
        let point = |k: usize| {
            let x = k as f64 / 7.0;
            DVec3::new(x, 0.2 * (x * 3.0).sin(), 0.1 * x * x)
        };
        let side: [DVec3; ORDER] = std::array::from_fn(point);
        Strip {
            sides: [side, side.map(|p| p + DVec3::Y * width)],
            uv: std::array::from_fn(|k| DVec2::splat(k as f64 / 7.0)),
            item: 0,
            apart: false,
        }
    }

    /// What a ray crosses of a strip in runs of a length at most, within 1e-10.
    fn crossings(strip: &Strip, ray: &Ray, length: f64) -> Vec<Crossing> {
        let (mut runs, mut found) = (Vec::new(), Vec::new());
        strip.divide(0, (1e-10, length), 6, &mut runs);
        assert_eq!(runs.len() > 8, length < 0.1);
        let across = Across::new(ray, DVec3::ZERO);
        for (_, run) in runs.iter().filter(|(_, run)| !across.is_beside(run)) {
            strip.meet(run, &across, 1e-10, &mut |c| found.push(c));
        }
        found
    }

    #[test]
    fn rays_through_the_strip_cross_it_and_others_do_not() {
        let width = 1e-6;
        let strip = strip(width);
        let direction = DVec3::new(0.1, 0.2, -1.0) * 3.0;
        for k in 1..50 {
            let s = f64::from(k) / 50.0;
            let [a, b] = strip.sides.each_ref().map(|side| bernstein(side, s));
            for (share, expected) in [(0.01, 1), (0.5, 1), (0.99, 1), (-0.01, 0), (1.01, 0)] {
                let target = a.lerp(b, share);
                let ray = Ray {
                    origin: target - direction * 2.0,
                    direction,
                };
                let length = if k % 2 == 0 { 1.0 } else { 0.02 };
                let mut found = crossings(&strip, &ray, length);
                // Where two parts meet both may tell.
                found.dedup_by(|a, b| (a.t - b.t).abs() < 1e-9);
                assert_eq!(found.len(), expected, "{s} {share} {found:?}");
                if let [c] = found[..] {
                    assert!(
                        (c.t - 2.0).abs() < 1e-9 && (c.uv.x - s).abs() < 1e-5,
                        "{c:?}"
                    );
                    assert!((c.width - width).abs() < 1e-12);
                    assert!(c.window > width / 3.0 && c.window < 1e-4);
                }
            }
        }
    }

    #[test]
    fn interpolation_reproduces_polynomials() {
        let of = |t: f64| 3.0 - t + t.powi(3) * 2.0 - t.powi(7);
        let coefficients = interpolated(&NODES.map(of));
        for k in 0..=20 {
            let t = f64::from(k) / 20.0;
            assert!((bernstein(&coefficients, t) - of(t)).abs() < 1e-14);
        }
    }

    #[test]
    fn of_a_wide_strip_few_parts_are_looked_into() {
        let mut strip = strip(0.0);
        strip.sides[1] = strip.sides[0].map(|p| p + DVec3::new(0.5, 0.8, 0.1));
        for direction in [DVec3::NEG_Z, DVec3::new(0.3, 0.7, -1.0)] {
            let target = bernstein(&strip.sides[0], 0.4).lerp(bernstein(&strip.sides[1], 0.4), 0.3);
            let ray = Ray {
                origin: target - direction,
                direction,
            };
            let part = strip.whole(|p| Across::new(&ray, DVec3::ZERO).place(p));
            let mut parts = vec![part];
            for _ in 0..16 {
                let halves = parts.iter().flat_map(Part::halves);
                parts = halves.filter(|half| !half.is_passed(1e-10)).collect();
                assert!((1..=4).contains(&parts.len()), "{}", parts.len());
            }
        }
    }

    #[test]
    fn rays_along_the_strip_end() {
        let strip = strip(1e-6);
        let ray = Ray {
            origin: DVec3::new(-1.0, 5e-7, 0.0),
            direction: DVec3::X,
        };
        assert!(crossings(&strip, &ray, 1.0).len() < 10);
    }
}
