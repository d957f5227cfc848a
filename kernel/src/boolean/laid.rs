//! Borders of a face laid on a piece of another one that lies in the same surface.

use glam::{DVec2, DVec3, DVec4};

use super::face::Piece;
use super::pair::{foot, halves};
use super::trace::{NEAR, NODES, OPEN, SLACK, bezier, snapped, through};
use crate::{Aabb, Curve, Error, KnotVector, Surface};

/// Halvings of a border until its image is a polynomial.
const HALVINGS: u32 = 10;

/// Where it is looked whether it is.
const CHECKS: [f64; 3] = [0.05, 0.5, 0.8];

/// A border of a face: a curve over its unit square, without knots of the surface inside.
pub(super) struct Border<'a> {
    /// The surface of the face, over the unit square.
    pub(super) surface: &'a Surface,
    /// The curve.
    pub(super) curve: &'a Curve<DVec2>,
}

impl Border<'_> {
    fn point(&self, t: f64) -> DVec3 {
        self.surface.evaluate(self.curve.evaluate(t))
    }

    /// The border in the parameters of a piece of the same surface, as far as it is on that.
    pub(super) fn on(&self, piece: &Piece, size: f64) -> Result<Vec<Curve<DVec2>>, Error> {
        let domain = self.curve.domain();
        let ends = [domain.start, domain.start.midpoint(domain.end), domain.end];
        let [start, middle, end] = ends.map(|t| self.point(t));
        if start.distance(middle).max(start.distance(end)) <= NEAR * size {
            // Nothing but a pole.
            return Ok(Vec::new());
        }
        let mut parts: Vec<Vec<Curve<DVec2>>> = Vec::new();
        let mut todo = vec![(domain.start, domain.end, 0)];
        while let Some((from, to, depth)) = todo.pop() {
            let (part, is_done) = self.part(piece, [from, to], size);
            if let Some(points) = part {
                let knots = KnotVector::trusted_bezier(5, &(0.0..1.0));
                for part in inside(&Curve::new(knots, &points, None)?)? {
                    add(&mut parts, part);
                }
            } else if !is_done && depth < HALVINGS {
                let middle = from.midpoint(to);
                todo.push((middle, to, depth + 1));
                todo.push((from, middle, depth + 1));
            }
        }
        parts.iter().map(|run| run[0].joined(&run[1..])).collect()
    }

    /// The image of a part, if it is a polynomial; or that there is none.
    fn part(&self, piece: &Piece, [from, to]: [f64; 2], size: f64) -> (Option<[DVec2; 6]>, bool) {
        let at = |share: f64| self.point(from + (to - from) * share);
        let around = Aabb::around(NODES.map(at));
        let margin = DVec3::splat(around.diagonal() + NEAR * size);
        let wide = Aabb {
            min: around.min - margin,
            max: around.max + margin,
        };
        if !wide.meets(&piece.bounds) {
            return (None, true);
        }
        let feet = |nodes: &[f64; 6]| {
            let mut guess = DVec2::splat(0.5);
            let mut values = [DVec4::ZERO; 6];
            for (value, &node) in values.iter_mut().zip(nodes) {
                guess = foot(&piece.surface, at(node), guess, size)?;
                *value = guess.extend(0.0).extend(0.0);
            }
            Some(values)
        };
        // An end may be a pole, which has no foot.
        let choices = [NODES, OPEN, OPEN.map(|t| 1.0 - t)];
        let found = choices.iter().find_map(|nodes| Some((nodes, feet(nodes)?)));
        let Some((nodes, values)) = found else {
            return (None, false);
        };
        let is_out = |axis: usize| {
            let all = || values.iter().map(|value| value[axis]);
            all().all(|x| x < -SLACK) || all().all(|x| x > 1.0 + SLACK)
        };
        if is_out(0) || is_out(1) {
            return (None, true);
        }
        let Some(points) = through(nodes, &values) else {
            return (None, false);
        };
        let is_on = |t: f64| {
            let image = piece.surface.evaluate(halves(bezier(points, t)).0);
            image.distance(at(t)) <= NEAR * size
        };
        let is_image = CHECKS.iter().all(|&t| is_on(t));
        (is_image.then(|| points.map(|p| halves(p).0)), false)
    }
}

/// Adds a part of an image to that which ends where it begins.
fn add(parts: &mut Vec<Vec<Curve<DVec2>>>, part: Curve<DVec2>) {
    let is_next = |run: &Vec<Curve<DVec2>>| {
        run.last()
            .is_some_and(|last| last.end().distance(part.start()) <= SLACK)
    };
    match parts.last_mut().filter(|run| is_next(run)) {
        Some(run) => run.push(part),
        None => parts.push(vec![part]),
    }
}

/// Those parts of a curve that are in the unit square.
fn inside(curve: &Curve<DVec2>) -> Result<Vec<Curve<DVec2>>, Error> {
    let mut cuts = vec![0.0, 1.0];
    for axis in 0..2 {
        for value in [0.0, 1.0] {
            let is_along = curve.points().all(|p| (p[axis] - value).abs() <= SLACK);
            if !is_along {
                cuts.extend(curve.crossings(axis, value, SLACK));
            }
        }
    }
    cuts.sort_by(f64::total_cmp);
    let mut parts = Vec::new();
    for range in cuts.windows(2).filter(|range| range[1] - range[0] > SLACK) {
        let middle = curve.evaluate(range[0].midpoint(range[1]));
        if middle.min_element() >= -SLACK && middle.max_element() <= 1.0 + SLACK {
            let part = curve.restricted(range[0]..range[1])?;
            let points: Vec<_> = part.points().map(snapped).collect();
            parts.push(Curve::new(part.knots().clone(), &points, None)?);
        }
    }
    Ok(parts)
}
