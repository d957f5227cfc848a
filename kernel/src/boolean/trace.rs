//! The curve in which two surfaces meet, followed from a point of it to the borders of both.
//!
//! It is made of arcs, polynomials of degree five through points in common: one of the four parameters is
//! linear along an arc, so that surfaces may touch each other between the points.

use glam::{DVec2, DVec3, DVec4};

use super::pair::{Course, Pair, halves};
use crate::{Curve, Error, KnotVector};

/// Points of an arc are on both surfaces, as a share of the size of the solids.
pub(super) const NEAR: f64 = 1e-10;

/// What is no farther outside a border of the unit square is on it.
pub(super) const SLACK: f64 = 1e-9;

/// Where the sine of the angle between the surfaces is less than this, they are not solved for points.
const FLAT: f64 = 5e-4;

/// The same at the ends of arcs.
const END_FLAT: f64 = 1e-2;

/// The first step along a curve, the longest and the least, as shares of the unit square.
const FIRST: f64 = 0.125;
const LONGEST: f64 = 0.5;
const LEAST: f64 = 1e-7;

/// Arcs of one curve, at most.
const MOST: usize = 4000;

/// A curve leaves a border that it is on if its parameter changes by this share of what changes most.
const STEEP: f64 = 1e-3;

/// A point is on a curve that was found if it is so near.
const SEEN: f64 = 1e-6;

/// How far the direction of a curve changes along an arc, at most, by the cosine.
const TURN: f64 = 0.5;

/// Where the points are that an arc goes through: at its ends too, or at its start only.
pub(super) const NODES: [f64; 6] = [
    0.0,
    0.095_491_502_812_526_3,
    0.345_491_502_812_526_3,
    0.654_508_497_187_473_7,
    0.904_508_497_187_473_7,
    1.0,
];
pub(super) const OPEN: [f64; 6] = [0.0, 0.09, 0.31, 0.58, 0.79, 0.91];

/// Where it is looked whether an arc is on the surfaces.
const CHECKS: [f64; 5] = [0.04, 0.22, 0.5, 0.78, 0.96];

/// A part of a curve: Bézier points of four parameters, of which one is linear.
struct Arc {
    points: [DVec4; 6],
    axis: usize,
}

impl Arc {
    fn at(&self, t: f64) -> DVec4 {
        bezier(self.points, t)
    }

    /// Where on the arc a point is, if it is on it.
    fn place(&self, point: DVec4, near: f64) -> Option<f64> {
        let (start, end) = (self.points[0][self.axis], self.points[5][self.axis]);
        let t = (point[self.axis] - start) / (end - start);
        let is_near =
            (-near..=1.0 + near).contains(&t) && (self.at(t) - point).abs().max_element() <= near;
        is_near.then_some(t)
    }

    fn reversed(mut self) -> Self {
        self.points.reverse();
        self
    }
}

/// A curve that two surfaces have in common.
pub(super) struct Trace {
    arcs: Vec<Arc>,
}

/// How far an end of a curve was followed.
enum End {
    /// It is on the border on which this parameter has a value.
    Border(usize),
    /// It is where the curve began.
    Closed,
    /// It is where nothing more could be found.
    Lost,
}

impl Trace {
    /// The curve through a point of both surfaces; none if it only touches a border, or if
    /// it is lost where the surfaces touch.
    pub(super) fn new(pair: &Pair<'_>, seed: DVec4) -> Option<Self> {
        let (mut arcs, ahead) = march(pair, seed, 1.0)?;
        let mut ends = vec![ahead];
        if !matches!(ends[0], End::Closed) {
            let (back, end) = march(pair, seed, -1.0)?;
            ends.push(end);
            let back = back.into_iter().rev().map(Arc::reversed);
            arcs = back.chain(arcs).collect();
        }
        let trace = Self { arcs };
        let is_none = ends.iter().any(|end| match end {
            End::Border(axis) => trace.is_along(*axis),
            End::Closed => false,
            End::Lost => true,
        });
        (!is_none && !trace.arcs.is_empty()).then_some(trace)
    }

    /// Whether it stays on the border of one parameter.
    fn is_along(&self, axis: usize) -> bool {
        let mut values = self.arcs.iter().flat_map(|arc| arc.points.map(|p| p[axis]));
        let first = values.clone().next().unwrap_or(0.0);
        let border = first.round();
        values.all(|value| (value - border).abs() <= 2.0 * SLACK)
    }

    /// Whether a point is on it.
    pub(super) fn has(&self, point: DVec4) -> bool {
        self.arcs.iter().any(|arc| arc.place(point, SEEN).is_some())
    }

    /// The curve in the parameters of the first surface and of the second, over the same domain.
    pub(super) fn curves(&self) -> Result<[Curve<DVec2>; 2], Error> {
        let curve = |points: &[DVec4; 6], half: usize| {
            let points = points.map(|p| snapped(if half == 0 { halves(p).0 } else { halves(p).1 }));
            Curve::new(KnotVector::trusted_bezier(5, &(0.0..1.0)), &points, None)
        };
        let joined = |half: usize| {
            let parts = self.arcs.iter().map(|arc| curve(&arc.points, half));
            let parts = parts.collect::<Result<Vec<_>, _>>()?;
            parts[0].joined(&parts[1..])
        };
        Ok([joined(0)?, joined(1)?])
    }
}

/// A point of the unit square, on its border if it is next to it.
pub(super) fn snapped(point: DVec2) -> DVec2 {
    let onto = |x: f64| {
        if (x - x.round()).abs() <= 2.0 * SLACK {
            x.round()
        } else {
            x
        }
    };
    DVec2::new(onto(point.x), onto(point.y))
}

/// Arcs from a point on, in the direction in which the surfaces meet or against it.
fn march(pair: &Pair<'_>, seed: DVec4, sign: f64) -> Option<(Vec<Arc>, End)> {
    let mut course = pair.course(seed)?;
    let (mut at, mut along, mut rate) = (seed, course.along * sign, course.rate * sign);
    let mut arcs: Vec<Arc> = Vec::new();
    let mut step = FIRST;
    while arcs.len() < MOST {
        if let Some(axis) = leaving(at, rate, STEEP) {
            return Some((arcs, End::Border(axis)));
        }
        let mut taken = None;
        let mut size = step;
        while size > LEAST {
            let from = From {
                at,
                along,
                rate,
                point: course.point,
            };
            taken = from.step(pair, size);
            if taken.is_some() {
                break;
            }
            // Not by halves: points where the surfaces touch each other are to be stepped over.
            size *= 0.6;
        }
        let Some(Step { arc, next, border }) = taken else {
            let end = leaving(at, rate, 0.0).map_or(End::Lost, End::Border);
            return Some((arcs, end));
        };
        let start = arc
            .place(seed, 1e-9)
            .filter(|t| *t > 1e-6 && !arcs.is_empty());
        if let Some(t) = start {
            arcs.push(Arc::between(pair, at, seed, &NODES).unwrap_or(arc.part(t)));
            return Some((arcs, End::Closed));
        }
        let end = arc.points[5];
        let chord = pair.first.evaluate(halves(end).0) - course.point;
        arcs.push(arc);
        if let Some(axis) = border {
            return Some((arcs, End::Border(axis)));
        }
        let next = next?;
        let way = next.along.dot(chord).signum();
        (at, along, rate) = (end, next.along * way, next.rate * way);
        course = next;
        step = (size * 1.6).min(LONGEST);
    }
    Some((arcs, End::Lost))
}

/// The parameter that leaves the unit square at a point of its border, if one does.
fn leaving(at: DVec4, rate: DVec4, steepness: f64) -> Option<usize> {
    let most = rate.abs().max_element();
    (0..4).find(|&axis| {
        let is_out = (at[axis] <= SLACK && rate[axis] < 0.0)
            || (at[axis] >= 1.0 - SLACK && rate[axis] > 0.0);
        is_out && rate[axis].abs() > steepness * most
    })
}

/// Where a step begins.
struct From {
    at: DVec4,
    along: DVec3,
    rate: DVec4,
    point: DVec3,
}

/// A step taken: its arc, how it goes on, and the parameter that is on its border if it ends there.
struct Step {
    arc: Arc,
    next: Option<Course>,
    border: Option<usize>,
}

impl From {
    /// A step in which the parameter that changes most changes by a size.
    fn step(&self, pair: &Pair<'_>, size: f64) -> Option<Step> {
        let axis = largest(self.rate);
        let whole = self.rate * (size / self.rate[axis].abs());
        let mut guess = self.at + whole;
        // Not past the border of this parameter.
        let inside = guess[axis].clamp(0.0, 1.0);
        let mut border = ((inside - guess[axis]).abs() > 0.0).then_some(axis);
        if border.is_some() {
            guess = self.at + whole * ((inside - self.at[axis]) / whole[axis]);
            guess[axis] = inside;
        }
        // Another border may come first, and the surfaces may not go on behind it.
        let mut end = pair.settled(guess, Some(axis)).or(border.map(|_| guess))?;
        for _ in 0..4 {
            let Some(other) = self.first_out(end) else {
                break;
            };
            let value = end[other].clamp(0.0, 1.0);
            let share = (value - self.at[other]) / (end[other] - self.at[other]);
            let mut guess = self.at + (end - self.at) * share;
            guess[other] = value;
            end = pair.settled(guess, Some(other))?;
            border = Some(other);
        }
        if !is_inside(end) {
            return None;
        }
        self.reach(pair, end, border)
    }

    /// The parameter that is outside first on the straight way to a point.
    fn first_out(&self, end: DVec4) -> Option<usize> {
        let share = |axis: usize| {
            let value = end[axis].clamp(0.0, 1.0);
            (value - self.at[axis]) / (end[axis] - self.at[axis])
        };
        let out = (0..4).filter(|&axis| (end[axis] - end[axis].clamp(0.0, 1.0)).abs() > SLACK);
        out.min_by(|&a, &b| share(a).total_cmp(&share(b)))
    }

    /// The step that ends at a point.
    fn reach(&self, pair: &Pair<'_>, end: DVec4, border: Option<usize>) -> Option<Step> {
        let next = pair.course(end);
        let is_flat = next.as_ref().is_none_or(|next| next.sine < END_FLAT);
        if is_flat {
            border?;
            let arc = Arc::between(pair, self.at, end, &OPEN)?;
            return Some(Step {
                arc,
                next: None,
                border,
            });
        }
        let chord = next.as_ref()?.point - self.point;
        let ahead = chord.try_normalize()?;
        let turned = next.as_ref()?.along.dot(ahead).abs();
        if ahead.dot(self.along) < TURN || turned < TURN {
            return None;
        }
        let arc = Arc::between(pair, self.at, end, &NODES)?;
        Some(Step { arc, next, border })
    }
}

impl Arc {
    /// The arc between two points of both surfaces, through others between them, if it is on the surfaces.
    fn between(pair: &Pair<'_>, start: DVec4, end: DVec4, nodes: &[f64; 6]) -> Option<Self> {
        let axis = largest(end - start);
        let mut values = [start; 6];
        for (value, &node) in values.iter_mut().zip(nodes).skip(1) {
            if node >= 1.0 {
                *value = end;
                continue;
            }
            *value = pair.settled(start.lerp(end, node), Some(axis))?;
            if !is_inside(*value) || pair.course(*value)?.sine < FLAT {
                return None;
            }
        }
        let mut points = through(nodes, &values)?;
        points[0] = start;
        for axis in 0..4 {
            // What the end is on, it is on to the last bit.
            if nodes[5] >= 1.0 || (end[axis].round() - end[axis]).abs() <= 0.0 {
                points[5][axis] = end[axis];
            }
        }
        let arc = Self { points, axis };
        let is_on = |t: f64| pair.distance(arc.at(t)) <= NEAR * pair.size;
        let is_near = (arc.at(1.0) - end).abs().max_element() < 0.1;
        (is_near && CHECKS.iter().all(|&t| is_on(t)) && is_on(1.0)).then_some(arc)
    }

    /// The arc as far as a place on it.
    fn part(&self, t: f64) -> Self {
        let mut points = self.points;
        for first in 1..points.len() {
            for i in (first..points.len()).rev() {
                points[i] = points[i - 1].lerp(points[i], t);
            }
        }
        Self {
            points,
            axis: self.axis,
        }
    }
}

/// A point of the polynomial with these Bézier points.
pub(super) fn bezier(mut points: [DVec4; 6], t: f64) -> DVec4 {
    for last in (1..points.len()).rev() {
        for i in 0..last {
            points[i] = points[i].lerp(points[i + 1], t);
        }
    }
    points[0]
}

/// Bézier points of the polynomial that has values at nodes.
pub(super) fn through(nodes: &[f64; 6], values: &[DVec4; 6]) -> Option<[DVec4; 6]> {
    let choices = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
    let mut rows: [[f64; 6]; 6] = nodes.map(|t| {
        let mut row = choices;
        let mut power = 1.0;
        for entry in &mut row {
            *entry *= power;
            power *= t;
        }
        power = 1.0;
        for entry in row.iter_mut().rev() {
            *entry *= power;
            power *= 1.0 - t;
        }
        row
    });
    let mut right = *values;
    for column in 0..6 {
        let pivot =
            (column..6).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        rows.swap(column, pivot);
        right.swap(column, pivot);
        for row in 0..6 {
            if row != column {
                let share = rows[row][column] / rows[column][column];
                let other = rows[column];
                for (entry, own) in rows[row].iter_mut().zip(other) {
                    *entry -= share * own;
                }
                let other = right[column];
                right[row] -= other * share;
            }
        }
    }
    let points: [DVec4; 6] = std::array::from_fn(|i| right[i] / rows[i][i]);
    points
        .iter()
        .all(|point| point.is_finite())
        .then_some(points)
}

fn largest(vector: DVec4) -> usize {
    (0..4)
        .max_by(|&a, &b| vector[a].abs().total_cmp(&vector[b].abs()))
        .unwrap_or(0)
}

/// Whether a point is in the unit square of both surfaces.
fn is_inside(at: DVec4) -> bool {
    at.min_element() >= -SLACK && at.max_element() <= 1.0 + SLACK
}
