//! What has no area: curves and points, on their own and on surfaces.

use std::collections::HashSet;
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::{Curve, Surface, WireShape};

use super::polygons::{Tag, vertex};
use super::statements::{Statement, reference};
use super::trims::LoopText;
use super::{Reader, invalid};
use crate::{Place, Problem, lifted};

/// How many control points and special points all special curves of a file may have together.
const POINTS: usize = 1_000_000;

/// A curve or points, with their place in the file.
#[derive(Clone, Debug)]
pub(super) struct WirePart {
    pub(super) shape: WireShape,
    pub(super) tag: Tag,
    pub(super) line: usize,
    pub(super) what: String,
}

/// A `curv2` that could be read.
#[derive(Clone, Debug)]
pub(super) struct TrimCurve {
    /// The curve.
    pub(super) curve: Curve<DVec2>,
    /// Parameters of its special points.
    pub(super) points: Vec<f64>,
}

/// The special curves and points of an element.
#[derive(Clone, Debug, Default)]
pub(super) struct Specials {
    /// `scrv`.
    pub(super) curves: Vec<LoopText>,
    /// `sp`, each with its line.
    pub(super) points: Vec<(usize, Vec<DVec2>)>,
}

impl Reader<'_> {
    /// Takes an `sp`.
    pub(super) fn special_points(&self, statement: &Statement<'_>) -> Result<Vec<DVec2>, Problem> {
        let list = &self.lists.parameters;
        let point = |word| -> Result<DVec2, String> {
            let index = reference(word, list.len(), "parameter vertices")?;
            let point = list[index].truncate();
            let message = || format!("parameter vertex {} could not be read", index + 1);
            point.is_finite().then_some(point).ok_or_else(message)
        };
        let points: Result<Vec<_>, _> = statement.arguments().map(point).collect();
        points.map_err(invalid)
    }

    /// Takes a `p`.
    pub(super) fn points(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        let point = |word: &str| -> Result<DVec3, String> {
            let vertex = vertex(word.split('/').next().unwrap_or(""), &self.lists)?;
            Ok(self.lists.positions[vertex as usize].truncate())
        };
        let points = statement.arguments().map(point);
        let points = points.collect::<Result<Vec<_>, _>>().map_err(invalid)?;
        if points.is_empty() {
            return Err(invalid("0 vertices; at least 1 are needed"));
        }
        // Clouds of points have a statement for each.
        match self.wires.last_mut() {
            Some(WirePart {
                shape: WireShape::Points(list),
                tag,
                what,
                ..
            }) if *tag == self.tag && what == "p" => list.extend(points),
            _ => self.add_wire(WireShape::Points(points), statement.line, "p"),
        }
        Ok(())
    }

    /// Adds a curve or points.
    pub(super) fn add_wire(&mut self, shape: WireShape, line: usize, what: &str) {
        self.wires.push(WirePart {
            shape,
            tag: self.tag,
            line,
            what: what.to_owned(),
        });
    }

    /// Adds the special points of a curve of space, which may have several parts.
    pub(super) fn points_on_curve(&mut self, curves: &[Curve<DVec3>], specials: &Specials) {
        for (line, list) in &specials.points {
            let at = |p: &DVec2| {
                let holds = |curve: &&Curve<DVec3>| holds(&curve.domain(), p.x);
                curves.iter().find(holds).map(|curve| curve.evaluate(p.x))
            };
            self.add_special_points(*line, list.iter().map(at).collect());
        }
    }

    /// Adds the special curves and points of a surface, those on its trim curves among them.
    pub(super) fn specials_on_surface(
        &mut self,
        parts: &[Surface],
        specials: &Specials,
        loops: &[LoopText],
    ) {
        let at = |p: DVec2| {
            let surface = parts.iter().find(|surface| is_on(surface, p))?;
            Some(surface.evaluate(clamped(surface, p)))
        };
        for (line, list) in &specials.points {
            self.add_special_points(*line, list.iter().map(|p| at(*p)).collect());
        }
        // Both a loop and a special curve may run along the same points.
        let mut known = HashSet::new();
        for text in specials.curves.iter().chain(loops) {
            let mut points = text.special_points(&self.trim_curves);
            points.retain(|p| known.insert(p.to_array().map(f64::to_bits)));
            if points.is_empty() {
                continue;
            }
            if let Err(problem) = self.spend(points.len()) {
                self.fail(Place::item(text.line, "sp"), problem);
                break;
            }
            self.add_special_points(text.line, points.into_iter().map(at).collect());
        }
        for text in &specials.curves {
            if let Err(problem) = self.special_curve(parts, text) {
                self.fail(Place::item(text.line, "scrv"), problem);
            }
        }
    }

    /// Adds special points; there are none in place of those outside of their element.
    fn add_special_points(&mut self, line: usize, points: Vec<Option<DVec3>>) {
        if points.contains(&None) {
            let text = "a special point is not on its curve or surface";
            self.warnings.invalid(Place::item(line, "sp"), text);
        }
        let points: Vec<_> = points.into_iter().flatten().collect();
        if !points.is_empty() {
            self.add_wire(WireShape::Points(points), line, "sp");
        }
    }

    /// Counts points of special curves.
    fn spend(&mut self, count: usize) -> Result<(), Problem> {
        self.special_cost += count;
        if self.special_cost <= POINTS {
            return Ok(());
        }
        let text = format!("more than {POINTS} points on special curves");
        Err(Problem::TooLarge(text))
    }

    /// Adds the curves of space that a special curve consists of.
    fn special_curve(&mut self, parts: &[Surface], text: &LoopText) -> Result<(), Problem> {
        for piece in &text.pieces {
            let curve = piece.cut(&self.trim_curves)?;
            let middle = curve.evaluate(f64::midpoint(curve.domain().start, curve.domain().end));
            let Some(surface) = parts.iter().find(|surface| is_on(surface, middle)) else {
                return Err(invalid("the special curve is not on the surface"));
            };
            let point = |uv| surface.evaluate(clamped(surface, uv));
            let lifted = lifted::onto(surface, &curve, point)?;
            self.spend(lifted.curve.homogeneous().len())?;
            self.add_wire(WireShape::Curve(lifted.curve), text.line, "scrv");
        }
        Ok(())
    }
}

/// Whether a parameter is in a domain, up to rounding.
fn holds(domain: &Range<f64>, t: f64) -> bool {
    let near = 1e-9 * (domain.end - domain.start);
    domain.start - near <= t && t <= domain.end + near
}

/// Whether parameters are in the domain of a surface, up to rounding.
pub(super) fn is_on(surface: &Surface, p: DVec2) -> bool {
    holds(&surface.knots_u().domain(), p.x) && holds(&surface.knots_v().domain(), p.y)
}

/// The nearest parameters of the domain.
pub(super) fn clamped(surface: &Surface, p: DVec2) -> DVec2 {
    let [u, v] = [surface.knots_u().domain(), surface.knots_v().domain()];
    p.clamp(DVec2::new(u.start, v.start), DVec2::new(u.end, v.end))
}
