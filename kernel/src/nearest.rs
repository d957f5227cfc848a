//! The points of a surface next to given points.

use std::sync::OnceLock;

use glam::{DVec2, DVec3};

use crate::{Surface, SurfaceDerivatives};

/// Steps of the iteration.
const STEPS: usize = 40;

/// Where the next step would be below this share of the domain, the iteration ends.
const SMALLEST: f64 = 4.0 * f64::EPSILON;

/// Samples of a surface along one parameter; along the longer more, up to the square of it in all.
const SAMPLES: usize = 200;

/// How many of the nearest samples are tried.
const TRIED: usize = 4;

/// Two sides of a surface meet if no farther apart than this share of its size.
const MEETS: f64 = 1e-6;

/// So many samples are looked at in the time in which a control point is mixed.
const LOOKED_AT: usize = 16;

/// Lines through a pole that are looked along, and parts of lines through a point that was found.
const LINES: usize = 16;

/// A point found from a guess is taken if it is no farther away than this share of the size.
const TRUSTED: f64 = 1e-3;

/// A point of a surface and how far away it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Its parameters, in the domain, or beyond it where the surface is closed.
    pub uv: DVec2,
    /// The point.
    pub point: DVec3,
    /// Its distance from the point asked for.
    pub distance: f64,
    /// What the search took: the control points that were mixed for points of the surface.
    pub work: usize,
}

/// Whether a surface meets itself at the ends of u and of v, up to a millionth of its size.
/// A side that is a single point meets nothing.
pub fn closed(surface: &Surface) -> [bool; 2] {
    let near = MEETS * surface.hull_bounds().diagonal();
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let at = |s: f64, t: f64| {
        let share = DVec2::new(
            u.start + (u.end - u.start) * s,
            v.start + (v.end - v.start) * t,
        );
        surface.evaluate(share)
    };
    [is_closed(at, near), is_closed(|s, t| at(t, s), near)]
}

/// The point of space that a side of the domain is, up to `near`: the side at the start (0) or the
/// end (1) of `axis`. `None` if it is none.
///
/// # Panics
/// If `axis` is neither 0 nor 1.
pub fn pole(surface: &Surface, axis: usize, side: usize, near: f64) -> Option<DVec3> {
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let (start, end) = (DVec2::new(u.start, v.start), DVec2::new(u.end, v.end));
    let at = |share: f64| {
        let mut shares = DVec2::splat(share);
        shares[axis] = side as f64;
        surface.evaluate(start + (end - start) * shares)
    };
    let point = at(0.0);
    let is_point = (1..=7).all(|k| at(f64::from(k) / 8.0).distance(point) <= near);
    is_point.then_some(point)
}

/// Whether the lines at both ends of the first parameter agree, and are not all there is. Some
/// lines along it may be points, as one is of a torus that touches itself.
fn is_closed(at: impl Fn(f64, f64) -> DVec3, near: f64) -> bool {
    let shares = || (0..=8).map(|k| f64::from(k) / 8.0);
    let goes_around = |t: f64| shares().any(|s| at(0.0, t).distance(at(s, t)) > near);
    shares().all(|t| at(0.0, t).distance(at(1.0, t)) <= near) && shares().any(goes_around)
}

/// A surface prepared for the search of nearest points.
#[derive(Debug)]
pub struct Nearby<'a> {
    surface: &'a Surface,
    closed: [bool; 2],
    start: DVec2,
    end: DVec2,
    /// Points all over the surface, made when they are first wanted.
    samples: OnceLock<Vec<(DVec2, DVec3)>>,
    size: f64,
    /// Control points that a point of the surface is mixed of.
    mixed: usize,
}

impl<'a> Nearby<'a> {
    /// Prepares a surface; `closed` tells where it meets itself, see [`closed`].
    pub fn new(surface: &'a Surface, closed: [bool; 2]) -> Self {
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        Self {
            surface,
            closed,
            start: DVec2::new(u.start, v.start),
            end: DVec2::new(u.end, v.end),
            samples: OnceLock::new(),
            size: surface.hull_bounds().diagonal(),
            mixed: (surface.knots_u().degree() + 1) * (surface.knots_v().degree() + 1),
        }
    }

    /// Points all over the surface: more along the parameter along which they would be farther apart, since turns of
    /// a thread may be nearer to each other than points along them.
    fn sampled(&self) -> Vec<(DVec2, DVec3)> {
        let knots = [self.surface.knots_u(), self.surface.knots_v()];
        let counts = knots.map(|knots| {
            let spans = knots.breaks().len() - 1;
            SAMPLES.min(spans * (knots.degree() + 1))
        });
        let mut along = [0, 1].map(|axis| places(knots[axis], counts[axis]));
        let steps = [0, 1].map(|axis| self.length(axis, &along) / counts[axis] as f64);
        let most = SAMPLES * SAMPLES / (counts[0] * counts[1]);
        for axis in 0..2 {
            let is_even = |times: &usize| *times as f64 * steps[1 - axis] <= steps[axis];
            if let Some(times) = (2..=most).take_while(is_even).last() {
                along[axis] = places(knots[axis], counts[axis] * times);
            }
        }
        let [along_u, along_v] = &along;
        let pairs = along_u
            .iter()
            .flat_map(|&u| along_v.iter().map(move |&v| DVec2::new(u, v)));
        pairs.map(|uv| (uv, self.surface.evaluate(uv))).collect()
    }

    /// How long the surface is along a parameter, by points at some places of both.
    fn length(&self, axis: usize, along: &[Vec<f64>; 2]) -> f64 {
        let other = &along[1 - axis];
        let line = |from: usize| {
            let at = |&t: &f64| {
                let mut uv = DVec2::splat(other[from]);
                uv[axis] = t;
                self.surface.evaluate(uv)
            };
            let points: Vec<_> = along[axis].iter().map(at).collect();
            let steps = points.windows(2).map(|pair| pair[0].distance(pair[1]));
            steps.sum::<f64>()
        };
        let quarters = (1..4).map(|k| line(k * (other.len() - 1) / 4));
        quarters.fold(0.0, f64::max)
    }

    /// The point near `guess` where the distance from `target` has a minimum, by Newton's
    /// iteration alone; its parameters are in the domain.
    pub fn near(&self, target: DVec3, guess: DVec2) -> Nearest {
        let found = self.iterate(target, guess);
        Nearest {
            uv: self.wrapped(found.uv),
            ..found
        }
    }

    /// The nearest to `target` of the points that are found: next to a surface that is the nearest there is, but from
    /// farther away than it bends another may be nearer.
    ///
    /// With a `guess` the point near it, found by Newton's iteration \[Piegl 97, section
    /// 6.1\], is taken if its distance is below a thousandth of the surface's size; else the best of the samples are
    /// tried as guesses. Where the surface is closed, parameters may leave the domain.
    pub fn nearest(&self, target: DVec3, guess: Option<DVec2>) -> Nearest {
        let guessed = guess.map(|uv| self.iterate(target, uv));
        if let Some(found) = guessed.filter(|found| found.distance <= TRUSTED * self.size) {
            return found;
        }
        let mut work = guessed.map_or(0, |found| found.work);
        let samples = self.samples.get_or_init(|| {
            let samples = self.sampled();
            work += samples.len() * self.mixed;
            samples
        });
        work += samples.len() / LOOKED_AT;
        let mut order = [(f64::INFINITY, DVec2::ZERO); TRIED];
        for (uv, point) in samples {
            let square = point.distance_squared(target);
            if square < order[TRIED - 1].0 {
                let place = order.partition_point(|known| known.0 <= square);
                order[place..].rotate_right(1);
                order[place] = (square, *uv);
            }
        }
        let known = order.iter().filter(|known| known.0 < f64::INFINITY);
        let found = known.map(|(_, uv)| self.iterate(target, *uv));
        let best = found
            .inspect(|found| work += found.work)
            .chain(guessed)
            .min_by(|a, b| a.distance.total_cmp(&b.distance));
        let best = best.unwrap_or_else(|| self.iterate(target, (self.start + self.end) * 0.5));
        let across = (best.distance > MEETS * self.size).then(|| self.across(&best, target));
        work += across.map_or(0, |across| across.work);
        let across = across.filter(|across| across.distance < best.distance);
        Nearest {
            work,
            ..across.unwrap_or(best)
        }
    }

    /// What is found from the best place on both lines of parameters through a point: where a surface is long one way
    /// and narrow the other, the iteration may have ended on the wrong side of it.
    fn across(&self, found: &Nearest, target: DVec3) -> Nearest {
        let own = self.wrapped(found.uv);
        let places = (0..2 * (LINES + 1)).map(|k| {
            let (axis, share) = (k % 2, (k / 2) as f64 / LINES as f64);
            let mut uv = own;
            uv[axis] = self.start[axis] + (self.end[axis] - self.start[axis]) * share;
            (self.surface.evaluate(uv).distance_squared(target), uv)
        });
        let best = places.min_by(|a, b| a.0.total_cmp(&b.0));
        let from = best.map_or(own, |best| best.1);
        let again = self.iterate(target, from);
        let work = again.work + 2 * (LINES + 1) * self.mixed;
        Nearest { work, ..again }
    }

    /// Newton's iteration from a guess, and once more from a pole on if it ends there.
    fn iterate(&self, target: DVec3, guess: DVec2) -> Nearest {
        let first = self.descend(target, guess);
        let Some(turned) = self.turned(&first, target) else {
            return first;
        };
        let second = self.descend(target, turned);
        let work = first.work + second.work + LINES * self.mixed;
        let best = if second.distance < first.distance {
            second
        } else {
            first
        };
        Nearest { work, ..best }
    }

    /// The parameters of a pole on the line that leads from there towards the target, of some lines around it;
    /// `None` if it is no pole, or no line does.
    fn turned(&self, found: &Nearest, target: DVec3) -> Option<DVec2> {
        let on_border = |axis: usize| {
            let at = found.uv[axis];
            !self.closed[axis] && (at <= self.start[axis] || at >= self.end[axis])
        };
        if !on_border(0) && !on_border(1) {
            return None;
        }
        let (domain, miss) = (self.end - self.start, target - found.point);
        let (_, ways) = self.surface.tangents(self.wrapped(found.uv));
        let is_pole = |around: &usize| {
            let turn = ways[*around].length() * domain[*around];
            on_border(1 - around) && turn <= MEETS * self.size
        };
        let around = (0..2).find(is_pole)?;
        let side = if found.uv[1 - around] <= self.start[1 - around] {
            1.0
        } else {
            -1.0
        };
        let lines = (0..LINES).map(|k| {
            let mut uv = found.uv;
            uv[around] = self.start[around] + domain[around] * (k as f64 + 0.5) / LINES as f64;
            let (_, ways) = self.surface.tangents(uv);
            (side * ways[1 - around].normalize_or_zero().dot(miss), uv)
        });
        let best = lines.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (best.0 > MEETS * miss.length()).then_some(best.1)
    }

    /// Newton's iteration, damped, clamped to the domain where it is not closed.
    fn descend(&self, target: DVec3, guess: DVec2) -> Nearest {
        let mut uv = self.clamped(guess);
        let mut damping = 0.0;
        let mut d = self.surface.derivatives(self.wrapped(uv));
        let mut best = d.point.distance_squared(target);
        let mut work = self.mixed;
        let mut before = 0.0;
        for _ in 0..STEPS {
            work += self.mixed;
            let miss = target - d.point;
            let next = self.clamped(uv + self.step(&d, miss, uv, damping));
            let moved = ((next - uv) / (self.end - self.start)).abs().max_element();
            let gain = DVec2::new(d.du.dot(miss), d.dv.dot(miss)).dot(next - uv);
            let then = self.surface.derivatives(self.wrapped(next));
            let distance = then.point.distance_squared(target);
            if distance <= best {
                (uv, d, best) = (next, then, distance);
                damping *= 0.1;
            } else if gain <= f64::EPSILON * best {
                // Nothing but rounding errors.
                break;
            } else {
                damping = (damping * 10.0_f64).max(1e-3);
            }
            // Steps become smaller at least as fast as they did. One that is not a number is the last, too.
            let goes_on =
                moved > SMALLEST && (before <= 0.0 || moved * (moved / before) > SMALLEST);
            if !goes_on {
                break;
            }
            before = moved;
        }
        Nearest {
            uv,
            point: d.point,
            distance: best.sqrt(),
            work,
        }
    }

    /// A step that lessens half the squared length of `miss`, the way to the target.
    fn step(&self, d: &SurfaceDerivatives, miss: DVec3, uv: DVec2, damping: f64) -> DVec2 {
        let (a, b, c) = (d.du.dot(d.du), d.du.dot(d.dv), d.dv.dot(d.dv));
        let slope = DVec2::new(d.du.dot(miss), d.dv.dot(miss));
        // Next to a pole one parameter means nothing, and stays as it is.
        let domain = self.end - self.start;
        let is_still = |slope: DVec3, length: f64| slope.length() * length <= MEETS * self.size;
        let still = [is_still(d.du, domain.x), is_still(d.dv, domain.y)];
        let raised = damping * a.max(c);
        let (a, c) = (a + raised, c + raised);
        // The second derivatives, as long as they bend the right way; else none.
        let bent = [
            a - d.duu.dot(miss),
            b - d.duv.dot(miss),
            c - d.dvv.dot(miss),
        ];
        let definite = |[a, b, c]: [f64; 3]| a > 0.0 && a * c - b * b > f64::EPSILON * a * c;
        let [a, b, c] = if definite(bent) { bent } else { [a, b, c] };
        let alone = |axis: usize| {
            let size = [a, c][axis];
            let floor = f64::EPSILON * a.max(c);
            let mut step = DVec2::ZERO;
            step[axis] = if size > floor {
                slope[axis] / size
            } else {
                0.0
            };
            step
        };
        let step = if still[0] != still[1] {
            alone(usize::from(still[0]))
        } else if definite([a, b, c]) {
            DVec2::new(c * slope.x - b * slope.y, a * slope.y - b * slope.x) / (a * c - b * b)
        } else {
            alone(usize::from(a < c))
        };
        // Along a border only the other parameter moves.
        let moved = self.clamped(uv + step) - uv;
        let is_held = |axis: usize| step[axis] != 0.0 && moved[axis] == 0.0;
        match (is_held(0), is_held(1)) {
            (true, false) => alone(1),
            (false, true) => alone(0),
            _ => step,
        }
    }

    /// The parameters moved to the border of the domain where it is not closed.
    fn clamped(&self, uv: DVec2) -> DVec2 {
        let inside = uv.max(self.start).min(self.end);
        let pick = |axis: usize| {
            if self.closed[axis] {
                uv[axis]
            } else {
                inside[axis]
            }
        };
        DVec2::new(pick(0), pick(1))
    }

    /// The parameters moved into the domain by whole periods.
    pub fn wrapped(&self, uv: DVec2) -> DVec2 {
        let wrap = |axis: usize| {
            let (start, end) = (self.start[axis], self.end[axis]);
            if self.closed[axis] && !(start <= uv[axis] && uv[axis] <= end) {
                start + (uv[axis] - start).rem_euclid(end - start)
            } else {
                uv[axis]
            }
        };
        DVec2::new(wrap(0), wrap(1))
    }
}

/// About so many parameters along a direction, in its spans.
fn places(knots: &crate::KnotVector, count: usize) -> Vec<f64> {
    let breaks = knots.breaks();
    let spans = breaks.len() - 1;
    let (stride, per_span) = ((spans / count).max(1), (count / spans).max(1));
    let inside = |w: &[f64]| -> Vec<f64> {
        let share = |k: usize| (k as f64 + 0.5) / per_span as f64;
        (0..per_span)
            .map(|k| w[0] + (w[1] - w[0]) * share(k))
            .collect()
    };
    breaks.windows(2).step_by(stride).flat_map(inside).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, TAU};

    use super::*;
    use crate::KnotVector;
    use crate::modelling::{self, Frame};

    #[test]
    fn points_beside_a_torus_are_found() {
        let torus = modelling::torus(&Frame::WORLD, 3.0, 1.0, 0.0..TAU, 0.0..TAU).unwrap();
        assert_eq!(closed(&torus), [true, true]);
        let horn = modelling::torus(&Frame::WORLD, 1.0, 1.0, 0.0..TAU, 0.0..TAU).unwrap();
        assert_eq!(closed(&horn), [true, true]);
        let nearby = Nearby::new(&torus, [true, true]);
        let mut guess = None;
        for k in 0..200 {
            let angle = f64::from(k) * 0.1;
            let (around, tube) = (DVec2::from_angle(angle), DVec2::from_angle(0.7 * angle));
            let at = |r: f64| {
                let out = around * (3.0 + r * tube.x);
                DVec3::new(out.x, out.y, r * tube.y)
            };
            let found = nearby.nearest(at(1.3), guess);
            assert!(found.point.distance(at(1.0)) < 1e-7, "{k}: {found:?}");
            assert!((found.distance - 0.3).abs() < 1e-12);
            guess = Some(found.uv);
        }
    }

    #[test]
    fn turns_of_a_thread_are_told_apart() {
        // A groove of twelve turns, in steps of a quarter of a turn.
        let [around, along] =
            [5, 50].map(|count| KnotVector::clamped_uniform(3, count, 0.0..1.0).unwrap());
        let net = (0..5).flat_map(|i| (0..50).map(move |j| (f64::from(i), f64::from(j))));
        let point = |(i, j): (f64, f64)| {
            let (tube, turn) = (DVec2::from_angle(i * 0.7), DVec2::from_angle(j * FRAC_PI_2));
            (turn * (12.0 - tube.y)).extend(0.45 * j + tube.x)
        };
        let points: Vec<_> = net.map(point).collect();
        let groove = Surface::new(around, along, &points, None).unwrap();
        let nearby = Nearby::new(&groove, [false; 2]);
        for k in 0..500 {
            let uv = DVec2::new(0.02 + 0.96 * f64::from(k % 7) / 6.0, f64::from(k) / 499.0);
            let target = groove.evaluate(uv);
            let found = nearby.nearest(target, None);
            assert!(found.distance < 1e-9, "{uv}: {found:?}");
        }
    }

    #[test]
    fn points_on_a_border_are_found_beside_a_gap() {
        // Most of a tube, and half of a ring: beyond the gap is another border.
        for major in [2.5, 3.0, 4.0, 6.0, 10.0, 30.0, 70.0, 300.0] {
            for start in [0.0, 0.7, 2.0, 3.7] {
                let tube = start..start + 4.955;
                let frame = &Frame::WORLD;
                let part = modelling::torus(frame, major, 2.0, 0.0..TAU / 2.0, tube).unwrap();
                let nearby = Nearby::new(&part, [false; 2]);
                for k in 0..=32 {
                    for end in [start, start + 4.955] {
                        let around = DVec2::from_angle(f64::from(k) * TAU / 64.0);
                        let out = around * (major + 2.0 * end.cos());
                        let target = out.extend(2.0 * end.sin());
                        let found = nearby.nearest(target, None);
                        assert!(
                            found.distance < 1e-9,
                            "{major} {start} {k} {end}: {found:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn the_other_side_of_a_pole_is_reached() {
        let sphere =
            modelling::sphere(&Frame::WORLD, 1.0, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap();
        let nearby = Nearby::new(&sphere, [true, false]);
        for k in 0..40 {
            let around = DVec2::from_angle(0.3 + 0.17 * f64::from(k)) * 0.04;
            let target = around.extend(if k % 2 == 0 { 0.99 } else { -0.99 });
            for u in 0..7 {
                let guess = DVec2::new(
                    f64::from(u) * TAU / 7.0,
                    0.97 * FRAC_PI_2.copysign(target.z),
                );
                let found = nearby.near(target, guess);
                let distance = (1.0 - target.length()).abs();
                assert!(
                    (found.distance - distance).abs() < 1e-9,
                    "{k} {u}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn borders_and_poles_are_reached() {
        let sphere =
            modelling::sphere(&Frame::WORLD, 1.0, 0.0..TAU, -FRAC_PI_2..FRAC_PI_2).unwrap();
        assert_eq!(closed(&sphere), [true, false]);
        let nearby = Nearby::new(&sphere, [true, false]);
        assert!(nearby.nearest(DVec3::Z, None).distance < 1e-12);
        let cylinder = modelling::cylinder(&Frame::WORLD, 1.0, 0.0..TAU, 0.0..2.0).unwrap();
        let nearby = Nearby::new(&cylinder, [true, false]);
        let found = nearby.nearest(DVec3::new(2.0, 0.0, 5.0), None);
        assert!(
            found.point.distance(DVec3::new(1.0, 0.0, 2.0)) < 1e-9,
            "{found:?}"
        );
    }
}
