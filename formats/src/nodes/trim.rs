//! `Contour2D`: the loops that trim a surface.

use std::collections::BTreeSet;

use glam::DVec2;
use kernel::{Curve, Error as GeometryError, Surface, TrimLoop};

use super::curve::is_parameter_curve;
use super::scene::Converter;
use super::{Link, Node};
use crate::Error;
use crate::loops::{self, LEAVES};

/// Gaps between the curves of a contour that are bridged, as a share of the diagonal of the
/// parameter domain. Some programs write few digits; a picture does not show the rest.
const GAP: f64 = 1e-3;

impl Converter<'_> {
    /// The loops of a surface. If one of them is unusable, none is kept: a hole without
    /// its border would show the wrong part.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn trim_loops(
        &mut self,
        node: &Node,
        surface: &Surface,
    ) -> Result<Vec<TrimLoop>, Error> {
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        let gap = GAP * DVec2::new(u.end - u.start, v.end - v.start).length();
        let mut loops = Vec::new();
        for link in &node.children {
            let contour = &self.tree.nodes[link.node];
            let curves = match &*contour.kind {
                "Contour2D" => self.contour_curves(contour)?,
                kind if is_parameter_curve(kind) && is_trim(link) => {
                    let text = "it stands in no Contour2D; it is taken for one";
                    self.warnings.invalid(contour.place(), text);
                    self.parameter_curve(contour)?.map(|curve| vec![curve])
                }
                _ => continue,
            };
            match curves.and_then(|curves| joined(curves, gap)) {
                Ok(joined) => {
                    loops.extend(joined.loops);
                    for text in joined.repairs {
                        self.warnings.invalid(contour.place(), text);
                    }
                }
                Err(problem) => {
                    let text = format!("{problem}; the surface is shown untrimmed");
                    self.warnings.invalid(contour.place(), text);
                    return Ok(Vec::new());
                }
            }
        }
        let domain = [u.clone(), v.clone()];
        if loops::removed(&mut loops, &domain) {
            let text = "two contours are the same; they count once";
            self.warnings.invalid(node.place(), text);
        }
        let closed = surface.closed();
        let check = |loops: &[TrimLoop]| TrimLoop::check_inside(loops, &u, &v, closed);
        let mut checked = check(&loops);
        if checked.is_ok() && runs_clockwise_outside(&loops) {
            if loops::surrounded(&mut loops, &domain) == Ok(true) {
                let text = "the border runs clockwise, as a hole does; it counts as the border";
                self.warnings.invalid(node.place(), text);
            }
            checked = check(&loops);
        }
        if let Err(problem) = checked {
            let text = format!("{problem}; the surface is shown untrimmed");
            self.warnings.invalid(node.place(), text);
            return Ok(Vec::new());
        }
        let leaves = |one: &&TrimLoop| loops::leaves(one, &domain, closed);
        for _ in loops.iter().filter(leaves) {
            self.warnings.invalid(node.place(), LEAVES);
        }
        Ok(loops)
    }

    /// The curves of a contour, in order.
    fn contour_curves(
        &mut self,
        contour: &Node,
    ) -> Result<Result<Vec<Curve<DVec2>>, GeometryError>, Error> {
        let mut curves = Vec::new();
        for link in &contour.children {
            let node = &self.tree.nodes[link.node];
            let curve = match &*node.kind {
                kind if is_parameter_curve(kind) => self.parameter_curve(node)?,
                _ if node.is_metadata() => continue,
                kind => {
                    let text = format!("{kind} is not read as part of a contour");
                    self.warnings.unsupported(node.place(), text);
                    continue;
                }
            };
            match curve {
                Ok(curve) => curves.push(curve),
                Err(problem) => return Ok(Err(problem)),
            }
        }
        Ok(Ok(curves))
    }
}

/// Whether a node is in the field for contours, or in none.
fn is_trim(link: &Link) -> bool {
    matches!(link.field.as_deref(), None | Some("trimmingContour"))
}

/// The loops of a contour, and what had to be repaired for them.
#[derive(Default)]
struct Joined {
    loops: Vec<TrimLoop>,
    repairs: BTreeSet<&'static str>,
}

/// The loop of the curves of a contour, end to start.
///
/// If they do not make one as they are, curves may run backwards, several loops may stand one
/// after the other, and a line may close what is open: some viewers take each curve for a loop
/// of its own, and close it.
fn joined(curves: Vec<Curve<DVec2>>, gap: f64) -> Result<Joined, GeometryError> {
    let problem = match TrimLoop::new(curves.clone(), gap) {
        Ok(whole) => {
            return Ok(Joined {
                loops: vec![whole],
                ..Joined::default()
            });
        }
        Err(problem) => problem,
    };
    let near = |a: DVec2, b: DVec2| a.distance(b) <= gap;
    let mut joined = Joined::default();
    let mut rest = curves.into_iter().peekable();
    while let Some(first) = rest.next() {
        let mut chain = vec![first];
        while let Some(next) = rest.peek() {
            let (start, end) = (chain[0].start(), chain[chain.len() - 1].end());
            let (from, to) = (next.start(), next.end());
            let is_open = !near(start, end);
            let turns = if near(end, from) {
                false
            } else if is_open && near(end, to) {
                true
            } else if is_open && chain.len() == 1 && (near(start, from) || near(start, to)) {
                chain[0] = chain[0].reversed();
                joined.repairs.insert(TURNED);
                !near(start, from)
            } else {
                break;
            };
            let next = rest.next().into_iter();
            if turns {
                joined.repairs.insert(TURNED);
                chain.extend(next.map(|curve| curve.reversed()));
            } else {
                chain.extend(next);
            }
        }
        let (start, end) = (chain[0].start(), chain[chain.len() - 1].end());
        if !near(start, end) {
            // What is open in the middle is no loop that lacks its last side.
            if !joined.loops.is_empty() || rest.peek().is_some() {
                return Err(problem);
            }
            joined.repairs.insert(CLOSED);
            chain.push(Curve::line(end, start, 0.0..1.0)?);
        }
        joined.loops.push(TrimLoop::new(chain, gap)?);
    }
    if joined.loops.len() > 1 {
        joined.repairs.insert(SEVERAL);
    }
    Ok(joined)
}

const TURNED: &str = "curves run against each other; they are turned";
const CLOSED: &str = "the contour is open; a line closes it";
const SEVERAL: &str = "several loops stand in one contour; each counts by itself";

/// Whether the loop with the largest area runs clockwise: the border is left to the reader
/// of the file then.
fn runs_clockwise_outside(loops: &[TrimLoop]) -> bool {
    let areas = loops.iter().map(TrimLoop::signed_area);
    let largest = areas.fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    largest < 0.0
}
