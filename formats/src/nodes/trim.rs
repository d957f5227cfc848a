//! `Contour2D`: the loops that trim a surface.

use glam::DVec2;
use kernel::{Curve, Error as GeometryError, Surface, TrimLoop};

use super::Node;
use super::curve::is_polyline;
use super::scene::Converter;
use crate::Error;

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
            if &*contour.kind != "Contour2D" {
                continue;
            }
            let curves = self.contour_curves(contour)?;
            match curves.and_then(|curves| TrimLoop::new(curves, gap)) {
                Ok(trim) => loops.push(trim),
                Err(problem) => {
                    let text = format!("{problem}; the surface is shown untrimmed");
                    self.warnings.invalid(contour.place(), text);
                    return Ok(Vec::new());
                }
            }
        }
        if let Err(problem) = TrimLoop::check_inside(&loops, &u, &v) {
            let text = format!("{problem}; the surface is shown untrimmed");
            self.warnings.invalid(node.place(), text);
            return Ok(Vec::new());
        }
        if runs_clockwise_outside(&loops) {
            loops.extend(TrimLoop::border(&u, &v));
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
                "NurbsCurve2D" => self.parameter_curve(node)?,
                kind if is_polyline(kind) => self.parameter_curve(node)?,
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

/// Whether the loop with the largest area runs clockwise: the border is left to the reader
/// of the file then.
fn runs_clockwise_outside(loops: &[TrimLoop]) -> bool {
    let areas = loops.iter().map(TrimLoop::signed_area);
    let largest = areas.fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    largest < 0.0
}
