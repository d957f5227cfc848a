//! Where a ray runs along a surface, or almost: roots along an arc.
//!
//! Where both derivatives of the distances are parallel all along a curve, a part that holds a piece of it
//! never becomes regular, however small, and the curve would be followed to the last bit. But one of the
//! distances, across the curve, has one root on every line across it: these make an arc, and along the arc the
//! other distance is a function of one variable. Its roots are those of the ray.

use super::net::{self, Degrees, bernstein};
use super::{Rect, Root};

/// Parts of a piece that are longer may hold more than looks tell.
const LONGEST: f64 = 0.125;

/// So many steps along an arc.
const LOOKS: usize = 16;
const STEP: f64 = 1.0 / LOOKS as f64;

/// Along the line across an arc the distance changes so many times faster than along the other one at least.
const STEEP: f64 = 0.25;

/// How far beyond its part an arc is followed.
const BEYOND: f64 = 0.5;

/// Steps towards a root across an arc, and along one.
const STEPS: usize = 60;

/// Parameters are resolved no further.
const RESOLUTION: f64 = 1e-15;

/// Ends of stretches that are no farther from each other are one.
const JOINED: f64 = 1e-9;

/// What was found on arcs: places of the ray, and stretches along which it runs.
#[derive(Debug, Default)]
pub(crate) struct Arcs {
    stretches: Vec<[[f64; 2]; 2]>,
}

/// An arc in a part of a piece.
struct Arc<'a> {
    degrees: Degrees,
    /// The distance that vanishes on the arc, and the other one.
    planes: [&'a [f64]; 2],
    /// Whether the lines across it are those of constant v.
    across_u: bool,
    /// Distances below it are zero.
    slack: f64,
}

impl Arcs {
    /// Forgets what was found.
    pub(crate) fn clear(&mut self) {
        self.stretches.clear();
    }

    /// Looks for all roots in a part of a piece; `false` if it holds no arc, or may hold several.
    ///
    /// The first of the planes is the one from which the distance changes fastest.
    #[inline(never)]
    pub(crate) fn follow(
        &mut self,
        planes: [&[f64]; 2],
        degrees: Degrees,
        slack: f64,
        rect: Rect,
        roots: &mut Vec<Root>,
    ) -> bool {
        let longest = (rect.u.1 - rect.u.0).max(rect.v.1 - rect.v.0);
        let across = [true, false].map(|along_u| net::slopes(planes[0], degrees, along_u));
        let Some(across_u) = steepest(across).filter(|_| longest <= LONGEST) else {
            return false;
        };
        let arc = Arc {
            degrees,
            planes,
            across_u,
            slack,
        };
        arc.roots(&mut |found| {
            let place = |(a, b): (f64, f64), t: f64| a + (b - a) * t.clamp(0.0, 1.0);
            let place = |[u, v]: [f64; 2]| [place(rect.u, u), place(rect.v, v)];
            match found {
                Found::Root(at) => roots.push(root(place(at), false)),
                Found::Stretch(ends) => self.stretches.push(ends.map(place)),
            }
        });
        true
    }

    /// Appends the ends of the stretches, those that meet as one.
    pub(crate) fn finish(&mut self, roots: &mut Vec<Root>) {
        let near = |a: [f64; 2], b: [f64; 2]| (0..2).all(|k| (a[k] - b[k]).abs() <= JOINED);
        while let Some([mut start, mut end]) = self.stretches.pop() {
            let mut k = 0;
            while let Some(&[a, b]) = self.stretches.get(k) {
                let ends = [(a, b), (b, a)].into_iter().find_map(|(a, b)| {
                    let grown = if near(a, end) {
                        [start, b]
                    } else if near(a, start) {
                        [b, end]
                    } else {
                        return None;
                    };
                    Some(grown)
                });
                k += 1;
                if let Some(ends) = ends {
                    [start, end] = ends;
                    self.stretches.swap_remove(k - 1);
                    k = 0;
                }
            }
            roots.extend([root(start, true), root(end, true)]);
        }
    }
}

/// What an arc holds.
enum Found {
    Root([f64; 2]),
    Stretch([[f64; 2]; 2]),
}

fn root([u, v]: [f64; 2], flat: bool) -> Root {
    Root {
        u,
        v,
        tangential: true,
        blurred: false,
        flat,
    }
}

/// Whether the lines across an arc are those of constant v, from what a distance changes by along u and
/// along v; `None` if it may have no root on some such line, or several.
fn steepest(across: [(f64, f64); 2]) -> Option<bool> {
    let is_steep = |own: (f64, f64), other: (f64, f64)| {
        let least = if own.0 > 0.0 { own.0 } else { -own.1 };
        least > 0.0 && least >= STEEP * other.0.abs().max(other.1.abs())
    };
    if is_steep(across[0], across[1]) {
        Some(true)
    } else {
        is_steep(across[1], across[0]).then_some(false)
    }
}

/// A place on an arc: how far along it, where on the line across, and the distance there.
#[derive(Clone, Copy)]
struct Look {
    along: f64,
    across: f64,
    distance: f64,
}

impl Arc<'_> {
    /// Both parameters of a place.
    fn place(&self, look: Look) -> [f64; 2] {
        if self.across_u {
            [look.across, look.along]
        } else {
            [look.along, look.across]
        }
    }

    /// A distance and its derivative across the arc.
    fn distance(&self, net: &[f64], along: f64, across: f64) -> [f64; 2] {
        let [u, v] = if self.across_u {
            [across, along]
        } else {
            [along, across]
        };
        let (u, v) = (bernstein(self.degrees.p, u), bernstein(self.degrees.q, v));
        let [value, by_u, by_v] = net::evaluate(net, self.degrees, &u, &v);
        [value, if self.across_u { by_u } else { by_v }]
    }

    /// The place on the arc; `None` if the arc is beyond the part there.
    fn look(&self, along: f64) -> Option<Look> {
        let at = |across: f64| self.distance(self.planes[0], along, across);
        let (mut low, mut high) = (-BEYOND, 1.0 + BEYOND);
        let [start, end] = [at(low)[0], at(high)[0]];
        if (start > 0.0) == (end > 0.0) {
            return None;
        }
        let mut across = 0.5;
        for _ in 0..STEPS {
            let [value, slope] = at(across);
            if (value > 0.0) == (start > 0.0) {
                low = across;
            } else {
                high = across;
            }
            let newton = across - value / slope;
            let next = if low < newton && newton < high {
                newton
            } else {
                f64::midpoint(low, high)
            };
            let is_done = (next - across).abs() <= RESOLUTION || high - low <= RESOLUTION;
            across = next;
            if is_done {
                break;
            }
        }
        let [distance, _] = self.distance(self.planes[1], along, across);
        Some(Look {
            along,
            across,
            distance,
        })
    }

    fn is_zero(&self, look: Look) -> bool {
        look.distance.abs() <= self.slack
    }

    fn is_inside(look: Look) -> bool {
        let is_inside = |t: f64| (-JOINED..=1.0 + JOINED).contains(&t);
        is_inside(look.along) && is_inside(look.across)
    }

    /// Calls for all roots, and all stretches of the arc on which the distance vanishes.
    fn roots(&self, each: &mut impl FnMut(Found)) {
        // One look beyond each end, for what touches there.
        let looks: [Option<Look>; LOOKS + 3] =
            std::array::from_fn(|k| self.look((k as f64 - 1.0) * STEP));
        let is_run = |k: usize| {
            let look: Option<Look> = looks.get(k).copied().flatten();
            look.is_some_and(|look| self.is_zero(look) && Self::is_inside(look))
        };
        let mut k = 0;
        while k < looks.len() {
            if is_run(k) {
                let first = k;
                while is_run(k + 1) {
                    k += 1;
                }
                let beside = [first.checked_sub(1), Some(k + 1)];
                let beside = beside.map(|k| looks.get(k?).copied().flatten());
                self.stretch([looks[first], looks[k]], beside, each);
            } else if let (Some(a), Some(&Some(b))) = (looks[k], looks.get(k + 1)) {
                let is_between = !self.is_zero(a) && !self.is_zero(b);
                if is_between && (a.distance > 0.0) != (b.distance > 0.0) {
                    self.crossing(a, b, each);
                }
                if let Some(c) = looks.get(k + 2).copied().flatten() {
                    self.touch([a, b, c], each);
                }
            }
            k += 1;
        }
    }

    /// A root that is in the part.
    fn found(&self, look: Look, each: &mut impl FnMut(Found)) {
        if Self::is_inside(look) {
            each(Found::Root(self.place(look)));
        }
    }

    /// The root between two places on different sides.
    fn crossing(&self, mut a: Look, mut b: Look, each: &mut impl FnMut(Found)) {
        for _ in 0..STEPS {
            let Some(middle) = self.look(f64::midpoint(a.along, b.along)) else {
                return;
            };
            if (middle.distance > 0.0) == (a.distance > 0.0) {
                a = middle;
            } else {
                b = middle;
            }
            if b.along - a.along <= RESOLUTION {
                break;
            }
        }
        self.found(a, each);
    }

    /// Roots between three places on one side of which the middle one is nearest.
    fn touch(&self, [a, b, c]: [Look; 3], each: &mut impl FnMut(Found)) {
        let side = b.distance.signum();
        let height = |look: Look| look.distance * side;
        let is_valley = height(a) > height(b) && height(b) <= height(c);
        if !is_valley || self.is_zero(b) {
            return;
        }
        // What a parabola leaves far from zero is so.
        let bend = height(a) - 2.0 * height(b) + height(c);
        let tilt = height(c) - height(a);
        if height(b) - tilt * tilt / (8.0 * bend) > 0.5 * height(b) {
            return;
        }
        let (mut low, mut best, mut high) = (a, b, c);
        for _ in 0..STEPS {
            let is_left = best.along - low.along > high.along - best.along;
            let other = if is_left { low } else { high };
            let Some(next) = self.look(f64::midpoint(best.along, other.along)) else {
                return;
            };
            let is_better = height(next) < height(best);
            match (is_left, is_better) {
                (true, true) => (high, best) = (best, next),
                (false, true) => (low, best) = (best, next),
                (true, false) => low = next,
                (false, false) => high = next,
            }
            if height(best) <= self.slack || high.along - low.along <= RESOLUTION.sqrt() {
                break;
            }
        }
        if height(best) < -self.slack {
            self.crossing(low, best, each);
            self.crossing(best, high, each);
        } else if self.is_zero(best) {
            self.found(best, each);
        }
    }

    /// What lies on two places where the distance vanishes, and between them: a stretch up to those
    /// beside them, or a root.
    fn stretch(
        &self,
        ends: [Option<Look>; 2],
        beside: [Option<Look>; 2],
        each: &mut impl FnMut(Found),
    ) {
        let [Some(a), Some(b)] = ends else { return };
        let [start, end] = [(a, beside[0]), (b, beside[1])].map(|(own, beside)| {
            let (mut own, mut beside) = (own, beside.unwrap_or(own));
            for _ in 0..STEPS {
                let middle = self.look(f64::midpoint(own.along, beside.along));
                match middle {
                    Some(look) if self.is_zero(look) && Self::is_inside(look) => own = look,
                    Some(look) => beside = look,
                    None => break,
                }
            }
            own
        });
        if end.along - start.along > 0.25 * STEP {
            each(Found::Stretch([self.place(start), self.place(end)]));
        } else {
            let middle = self.look(f64::midpoint(start.along, end.along));
            self.found(middle.unwrap_or(a), each);
        }
    }
}
