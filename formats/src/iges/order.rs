//! Curves of a loop put in order: each begins where the one before ends.

use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::Curve;

use crate::least;

/// Curves in the parameter domain.
pub(super) type Chain = Vec<Curve<DVec2>>;

/// A curve is looked at for crossings of the first seam and this many more.
const TURNS: u8 = 4;

/// Crossings of a seam are this near to it, as a share of the period.
const NEAR: f64 = 1e-9;

/// Curves run around a closed surface so often up to this share of a period.
const WHOLE: f64 = 1e-3;

/// What is said of repaired loops.
const TORN: &str = "the curves of a trim loop are listed out of order; they are taken in the order \
                    in which they meet";
const SPUR: &str = "a curve of a trim loop leads nowhere; it is left out";
const WOUND: &str = "a closed curve of a trim loop runs the wrong way round; it is turned";

/// Loops of more curves are taken in the order of the file.
const SORTED: usize = 500;

/// Curves of a loop on a surface, whose points are given by parameters; what is no farther apart
/// than `accuracy` meets.
pub(super) struct Order<F> {
    pub(super) point: F,
    /// The domains of parameters along which the surface is closed.
    pub(super) periods: [Option<Range<f64>>; 2],
    /// Curves are not turned round for less.
    pub(super) near: f64,
    pub(super) accuracy: f64,
}

/// The ends of a curve, in parameters and in space.
struct Ends {
    uv: [DVec2; 2],
    points: [DVec3; 2],
}

/// A curve of a loop by its place in the file, and whether it is run through backwards.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Step {
    curve: usize,
    is_turned: bool,
}

impl Step {
    /// Where the step begins (0) or ends (1) among the ends of its curve.
    fn side(self, side: usize) -> usize {
        if self.is_turned { 1 - side } else { side }
    }
}

impl<F: Fn(DVec2) -> DVec3> Order<F> {
    /// Lets closed curves begin where others of the loop end, turns curves round where that lets
    /// them meet, in space, and puts them in the order in which they meet without a jump; what had
    /// to be repaired for that.
    pub(super) fn aligned(&self, curves: Chain) -> (Chain, Vec<&'static str>) {
        let mut repairs = Vec::new();
        if curves.len() < 2 {
            return (curves, repairs);
        }
        let curves = self.opened(curves);
        let ends = self.ends(&curves);
        let listed = self.listed(&ends);
        let listed = match self.without_spurs(&ends, &listed) {
            Some(rest) => {
                repairs.push(SPUR);
                rest
            }
            None => listed,
        };
        let (mut steps, is_torn) = self.sorted(&ends, &listed).unwrap_or((listed, false));
        repairs.extend(is_torn.then_some(TORN));
        repairs.extend(self.unwind(&ends, &mut steps).then_some(WOUND));
        let walked = |step: Step| {
            let curve = &curves[step.curve];
            if step.is_turned {
                curve.reversed()
            } else {
                curve.clone()
            }
        };
        (steps.into_iter().map(walked).collect(), repairs)
    }

    /// The steps without those that lead nowhere, if the others meet: each from where the one before
    /// it ends to where the one after it begins.
    fn without_spurs(&self, ends: &[Ends], steps: &[Step]) -> Option<Vec<Step>> {
        let count = steps.len();
        let meets = |k: usize, l: usize| self.meets(ends, steps[k % count], steps[l % count]);
        let is_spur = |k: usize| {
            let (before, after) = (k + count - 1, k + 1);
            !(meets(before, k) && meets(k, after)) && meets(before, after)
        };
        let is_torn = (0..count).any(|k| !meets(k, k + 1));
        let (spurs, rest): (Vec<_>, Vec<_>) = (0..count).partition(|&k| is_torn && is_spur(k));
        let rest: Vec<_> = rest.into_iter().map(|k| steps[k]).collect();
        let is_sound = pairs(&rest).all(|(a, b)| self.meets(ends, a, b));
        (!spurs.is_empty() && rest.len() > 1 && is_sound).then_some(rest)
    }

    /// Turns closed curves round where a loop would run around a closed surface more than once:
    /// their ends do not tell which way they run. Whether there are any.
    fn unwind(&self, ends: &[Ends], steps: &mut [Step]) -> bool {
        let mut is_changed = false;
        for (axis, period) in self.periods.iter().enumerate() {
            let Some(period) = period.as_ref().map(|p| p.end - p.start) else {
                continue;
            };
            // How often a step runs around; turned, it runs the other way.
            let turns = |step: &Step| {
                let [start, end] = [0, 1].map(|side| ends[step.curve].uv[step.side(side)][axis]);
                (end - start) / period
            };
            let mut sum: f64 = steps.iter().map(turns).sum();
            if (sum - sum.round()).abs() > WHOLE {
                continue;
            }
            for k in 0..steps.len() {
                let own = turns(&steps[k]);
                let [start, end] = ends[steps[k].curve].points;
                let is_closed =
                    (own.abs() - 1.0).abs() <= WHOLE && start.distance(end) <= self.accuracy;
                if sum.abs() > 1.5 && is_closed && own * sum > 0.0 {
                    steps[k].is_turned = !steps[k].is_turned;
                    sum -= 2.0 * own;
                    is_changed = true;
                }
            }
        }
        is_changed
    }

    /// The order in which each curve begins where the one before ends, in parameters as they are, if
    /// it is another one than the `listed` one, and the only one; whether the curves do not even meet
    /// in space as the file lists them.
    ///
    /// They run as they do in the file, as listed, or, where those that are listed side by side do
    /// not meet, either way.
    fn sorted(&self, ends: &[Ends], listed: &[Step]) -> Option<(Vec<Step>, bool)> {
        let is_done = |steps: &[Step]| pairs(steps).all(|(a, b)| self.follows(ends, a, b));
        if listed.len() > SORTED || is_done(listed) {
            return None;
        }
        let is_torn = |steps: &[Step]| pairs(steps).any(|(a, b)| !self.meets(ends, a, b));
        let straight: Vec<_> = (0..ends.len())
            .map(|curve| Step {
                curve,
                is_turned: false,
            })
            .collect();
        let found = [straight.as_slice(), listed].into_iter().find_map(|steps| {
            let order = self.walk(ends, steps)?;
            Some((order, is_torn(steps)))
        });
        found.or_else(|| {
            let turned = straight.iter().map(|step| Step {
                is_turned: true,
                ..*step
            });
            let both: Vec<_> = straight.iter().copied().chain(turned).collect();
            let mut order = self.walk(ends, &both).filter(|_| is_torn(listed))?;
            // Most run as the file has them.
            if 2 * order.iter().filter(|step| step.is_turned).count() > order.len() {
                order.reverse();
                order.iter_mut().for_each(|s| s.is_turned = !s.is_turned);
            }
            Some((order, true))
        })
    }

    /// Goes through all curves once, each time by the only one of the steps that follows.
    ///
    /// Where two seams of a surface cross, loops pass one point of space several times, and in space
    /// any curve from there can follow any that comes there.
    fn walk(&self, ends: &[Ends], steps: &[Step]) -> Option<Vec<Step>> {
        let first = *steps.first()?;
        let mut order = vec![first];
        while order.len() <= ends.len() {
            let last = order[order.len() - 1];
            let follows = |next: &Step| next.curve != last.curve && self.follows(ends, last, *next);
            let mut next = steps.iter().copied().filter(follows);
            match (next.next(), next.next()) {
                (Some(next), None) if next == first && order.len() == ends.len() => {
                    return Some(order);
                }
                (Some(next), None) if next.curve != first.curve => order.push(next),
                _ => break,
            }
        }
        None
    }

    /// Whether a step begins in space where another ends.
    fn meets(&self, ends: &[Ends], step: Step, next: Step) -> bool {
        let from = ends[step.curve].points[step.side(1)];
        let to = ends[next.curve].points[next.side(0)];
        from.distance(to) <= self.accuracy
    }

    /// Whether it begins there in parameters, too, without a jump.
    fn follows(&self, ends: &[Ends], step: Step, next: Step) -> bool {
        let jump = (ends[next.curve].uv[next.side(0)] - ends[step.curve].uv[step.side(1)]).abs();
        let jumps = |axis: usize| {
            let period = self.periods[axis].as_ref().map(|p| p.end - p.start);
            period.is_some_and(|period| jump[axis] > 0.5 * period)
        };
        self.meets(ends, step, next) && !jumps(0) && !jumps(1)
    }

    fn ends(&self, curves: &[Curve<DVec2>]) -> Vec<Ends> {
        let ends = |c: &Curve<DVec2>| {
            let uv = [c.start(), c.end()];
            let points = uv.map(&self.point);
            Ends { uv, points }
        };
        curves.iter().map(ends).collect()
    }

    /// Divides closed curves that begin elsewhere than at their neighbours but pass by there.
    fn opened(&self, curves: Chain) -> Chain {
        let ends = self.ends(&curves);
        let count = curves.len();
        let opened = |(k, curve): (usize, Curve<DVec2>)| {
            let stops =
                [(k + count - 1) % count, (k + 1) % count].map(|beside| ends[beside].points);
            let [start, end] = ends[k].points;
            let meets = |p: &DVec3| p.distance(start) <= self.accuracy;
            if !meets(&end) || stops.as_flattened().iter().any(meets) {
                return vec![curve];
            }
            let nearest = |places: Vec<(f64, f64)>| {
                let nearest = places.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
                nearest.filter(|(_, distance)| *distance <= self.accuracy)
            };
            let stops = stops.as_flattened();
            // On the seam, where there is one, so that no sliver beside it is left.
            let crossed = nearest(self.crossed(&curve, stops));
            let place = crossed
                .or_else(|| nearest(stops.iter().map(|&p| self.passed(&curve, p)).collect()));
            match place.map(|(t, _)| curve.split(t)) {
                Some(Ok([before, after])) => vec![after, before],
                _ => vec![curve],
            }
        };
        curves.into_iter().enumerate().flat_map(opened).collect()
    }

    /// Where a curve crosses the seam of the surface, and how far the nearest of some points is from
    /// there.
    fn crossed(&self, curve: &Curve<DVec2>, stops: &[DVec3]) -> Vec<(f64, f64)> {
        let mut places = Vec::new();
        for (axis, domain) in self.periods.iter().enumerate() {
            let Some(Range { start, end }) = domain else {
                continue;
            };
            let period = end - start;
            let along = || curve.points().map(|p| (p[axis] - start) / period);
            let least = along().fold(f64::INFINITY, f64::min).ceil();
            let most = along().fold(f64::NEG_INFINITY, f64::max).floor();
            let seams = (0..=TURNS).map(|k| least + f64::from(k));
            for turns in seams.take_while(|turns| *turns <= most) {
                let seam = start + turns * period;
                for t in curve.crossings(axis, seam, NEAR * period) {
                    let point = (self.point)(curve.evaluate(t));
                    let off = stops.iter().map(|p| p.distance(point));
                    places.push((t, off.fold(f64::INFINITY, f64::min)));
                }
            }
        }
        places
    }

    /// Where a curve passes nearest to a point, and how far from it.
    fn passed(&self, curve: &Curve<DVec2>, target: DVec3) -> (f64, f64) {
        let off = |t: f64| (self.point)(curve.evaluate(t)).distance(target);
        least::least(&curve.knots().breaks(), off)
    }

    /// The curves in the order of the file, each turned round only where that is clearly better.
    fn listed(&self, ends: &[Ends]) -> Vec<Step> {
        let better = |turned: f64, straight: f64| straight > self.near && turned < 0.5 * straight;
        let [first, second] = [0, 1].map(|k| ends[k].points);
        let to_second = |p: DVec3| p.distance(second[0]).min(p.distance(second[1]));
        let mut steps = vec![Step {
            curve: 0,
            is_turned: better(to_second(first[0]), to_second(first[1])),
        }];
        for curve in 1..ends.len() {
            let last = steps[curve - 1];
            let before = ends[last.curve].points[last.side(1)];
            let [straight, turned] = ends[curve].points.map(|p| before.distance(p));
            let is_turned = better(turned, straight);
            steps.push(Step { curve, is_turned });
        }
        steps
    }
}

/// Each step with the one after it; the first one follows the last.
fn pairs(steps: &[Step]) -> impl Iterator<Item = (Step, Step)> {
    let next = steps.iter().cycle().skip(1);
    steps.iter().copied().zip(next.copied())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// The border of a torus without a bite at one of its seams, which files may begin anywhere and
    /// continue with any of the curves at the corner.
    #[test]
    fn seams_that_cross_are_taken_in_the_order_of_parameters() {
        let corners = [
            [0.0, 0.0],
            [3.0, 0.0],
            [4.0, 0.5],
            [4.5, 0.0],
            [TAU, 0.0],
            [TAU, TAU],
            [4.5, TAU],
            [3.0, TAU],
            [0.0, TAU],
        ];
        let line = |k: usize| {
            let corner = |k: usize| DVec2::from_array(corners[k % corners.len()]);
            Curve::line(corner(k), corner(k + 1), 0.0..1.0).unwrap()
        };
        let order = Order {
            point: |uv: DVec2| {
                let across = 3.0 + uv.x.cos();
                DVec3::new(across * uv.y.cos(), across * uv.y.sin(), uv.x.sin())
            },
            periods: [Some(0.0..TAU), Some(0.0..TAU)],
            near: 1e-9,
            accuracy: 1e-6,
        };
        let right = [7, 8, 0, 1, 2, 3, 4, 5, 6].map(line).to_vec();
        // At the corner, one point of space, the left side is followed by the right part of the top.
        let file = [7, 8, 5, 6, 1, 2, 3, 4, 0].map(line).to_vec();
        assert_eq!(order.aligned(file), (right.clone(), vec![]));
        let torn = [8, 0, 1, 3, 2, 4, 5, 6, 7].map(line).to_vec();
        let sorted = [8, 0, 1, 2, 3, 4, 5, 6, 7].map(line).to_vec();
        assert_eq!(order.aligned(torn), (sorted, vec![TORN]));
        assert_eq!(order.aligned(right.clone()), (right, vec![]));
    }

    #[test]
    fn curves_that_lead_nowhere_are_left_out() {
        let order = Order {
            point: |uv: DVec2| uv.extend(0.0),
            periods: [None, None],
            near: 1e-9,
            accuracy: 1e-6,
        };
        let line =
            |from: [f64; 2], to: [f64; 2]| Curve::line(from.into(), to.into(), 0.0..1.0).unwrap();
        let sides = [
            line([0.0, 0.0], [2.0, 0.0]),
            line([2.0, 0.0], [0.0, 2.0]),
            line([0.0, 2.0], [0.0, 0.0]),
        ];
        for place in 0..=3 {
            let mut file = sides.to_vec();
            let from = sides[place % 3].start();
            file.insert(place, Curve::line(from, from + 0.3, 0.0..1.0).unwrap());
            let (made, repairs) = order.aligned(file);
            assert_eq!((made.len(), repairs), (3, vec![SPUR]), "{place}");
        }
        // What leaves a gap is needed.
        let open = [sides[0].clone(), sides[1].clone()].to_vec();
        assert_eq!(order.aligned(open.clone()), (open, vec![]));
    }

    #[test]
    fn closed_curves_are_turned_where_a_loop_would_run_around_twice() {
        let order = Order {
            point: |uv: DVec2| DVec3::new(uv.x.cos(), uv.x.sin(), uv.y),
            periods: [Some(0.0..TAU), None],
            near: 1e-9,
            accuracy: 1e-6,
        };
        let line =
            |from: [f64; 2], to: [f64; 2]| Curve::line(from.into(), to.into(), 0.0..1.0).unwrap();
        let band = [
            line([0.0, 0.0], [TAU, 0.0]),
            line([TAU, 0.0], [TAU, 1.0]),
            line([TAU, 1.0], [0.0, 1.0]),
            line([0.0, 1.0], [0.0, 0.0]),
        ];
        let right = band.to_vec();
        assert_eq!(order.aligned(right.clone()), (right, vec![]));
        let wrong = [
            band[0].clone(),
            band[1].clone(),
            band[2].reversed(),
            band[3].clone(),
        ];
        let (made, repairs) = order.aligned(wrong.to_vec());
        let around: f64 = made.iter().map(|c| c.end().x - c.start().x).sum();
        assert!(
            around.abs() < 1e-12 && repairs == [WOUND],
            "{around} {repairs:?}"
        );
    }

    /// All orders of some numbers.
    fn orders(rest: &[usize]) -> Vec<Vec<usize>> {
        if rest.is_empty() {
            return vec![Vec::new()];
        }
        let with = |first: usize| {
            let others: Vec<_> = rest.iter().copied().filter(|k| *k != first).collect();
            let orders = orders(&others).into_iter();
            orders.map(move |others| [vec![first], others].concat())
        };
        rest.iter().copied().flat_map(with).collect()
    }

    #[test]
    fn a_square_is_found_in_all_orders_of_its_sides_and_with_any_turned() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(DVec2::from);
        let order = Order {
            point: |uv: DVec2| uv.extend(0.0),
            periods: [None, None],
            near: 1e-9,
            accuracy: 1e-6,
        };
        for listed in orders(&[0, 1, 2, 3]) {
            for turned in 0..16_u8 {
                let side = |k: usize| {
                    let line = Curve::line(corners[k], corners[(k + 1) % 4], 0.0..1.0).unwrap();
                    let is_turned = turned >> k & 1 == 1;
                    if is_turned { line.reversed() } else { line }
                };
                let file: Chain = listed.iter().map(|&k| side(k)).collect();
                let (made, repairs) = order.aligned(file.clone());
                let is_torn = repairs == [TORN];
                let next = made.iter().cycle().skip(1);
                let mut pairs = made.iter().zip(next);
                assert!(
                    made.len() == 4 && pairs.all(|(c, next)| c.end() == next.start()),
                    "{listed:?}, turned {turned:b}"
                );
                let steps = |by: usize| (0..4).all(|k| (listed[k] + by) % 4 == listed[(k + 1) % 4]);
                // Listed backwards, they meet, too.
                if turned == 0 && !steps(3) {
                    assert_eq!(is_torn, !steps(1), "{listed:?}");
                    let first = (0..4).map(|k| side((listed[0] + k) % 4));
                    assert_eq!(made, first.collect::<Chain>());
                }
            }
        }
    }
}
