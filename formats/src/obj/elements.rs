//! Opening and closing free-form elements, with all that may be wrong with them.

use std::ops::Range;

use glam::DVec4;
use kernel::{Surface, TrimLoop, WireShape};

use super::basis::Basis;
use super::freeform::{Attributes, Element, Kind};
use super::polygons::Tag;
use super::seams::Merging;
use super::specials::{Specials, TrimCurve};
use super::statements::{Statement, number, reference};
use super::trims::{LoopText, lifted};
use super::{Reader, SurfacePart, invalid};
use crate::loops::{self, LEAVES};
use crate::{Place, Problem};

/// An element whose `end` has not come yet.
#[derive(Clone, Debug)]
pub(super) struct Open {
    line: usize,
    /// What it is, in the words of the file.
    what: String,
    /// What its first line says, or why that cannot be used.
    element: Result<Element, Problem>,
    /// The first thing wrong with a `trim` or `hole`, and its line.
    bad_loop: Option<(Place, Problem)>,
    /// Its group, material and merging group: what counted at its first line.
    state: (Tag, Merging),
    /// The first statement in its body that does not belong there.
    stranger: Option<Place>,
}

impl Open {
    /// Notes a statement in its body that is about something else.
    pub(super) fn pass(&mut self, statement: &Statement<'_>) {
        self.stranger
            .get_or_insert_with(|| Place::item(statement.line, statement.keyword()));
    }

    /// Takes the values of a `parm`; the last one for a direction counts.
    pub(super) fn set_parm(&mut self, index: usize, values: Vec<f64>) {
        if let Ok(element) = &mut self.element {
            element.parms[index] = values;
        }
    }

    /// Takes a `trim` or `hole`.
    pub(super) fn add_loop(
        &mut self,
        statement: &Statement<'_>,
        curves: usize,
    ) -> Result<(), Problem> {
        match (LoopText::parse(statement, curves), &mut self.element) {
            (Ok(text), Ok(element)) => element.loops.push(text),
            (Err(problem), _) => {
                let place = Place::item(statement.line, statement.keyword());
                self.bad_loop.get_or_insert((place, problem));
            }
            (Ok(_), Err(_)) => {}
        }
        Ok(())
    }

    /// The special curves and points of its body; `None` if it cannot be used.
    pub(super) fn specials(&mut self) -> Option<&mut Specials> {
        self.element.as_mut().ok().map(|e| &mut e.specials)
    }
}

impl Reader<'_> {
    /// Begins a `surf`, `curv` or `curv2`.
    pub(super) fn open_element(&mut self, statement: &Statement<'_>) {
        let mut element = self.element(statement);
        let early = std::mem::take(&mut self.early_parms);
        if let Ok(element) = &mut element {
            element.parms = early;
        }
        let number = match statement.keyword() {
            "surf" => self.surface_parts.len() + 1,
            "curv2" => self.trim_curves.len() + 1,
            _ => {
                self.curve_count += 1;
                self.curve_count
            }
        };
        self.open = Some(Open {
            line: statement.line,
            what: format!("{} {number}", statement.keyword()),
            element,
            bad_loop: None,
            state: (self.tag, self.merging),
            stranger: None,
        });
    }

    /// What the first line of an element says.
    fn element(&mut self, statement: &Statement<'_>) -> Result<Element, Problem> {
        let words = statement.arguments();
        let ranges = match statement.keyword() {
            "surf" => 4,
            "curv" => 2,
            _ => 0,
        };
        let range = words.clone().take(ranges).map(number);
        let range = range.collect::<Result<Vec<_>, _>>().map_err(invalid)?;
        let kind = match range[..] {
            [s0, s1, t0, t1] => Kind::Surface([s0..s1, t0..t1]),
            [start, end] => Kind::Curve(start..end),
            [] if ranges == 0 => Kind::TrimCurve,
            _ => {
                let found = range.len();
                return Err(invalid(format!(
                    "{found} range values; {ranges} are needed"
                )));
            }
        };
        let mut texture = Vec::new();
        let mut has_normals = false;
        let point = |word: &str| -> Result<DVec4, String> {
            if kind == Kind::TrimCurve {
                let list = &self.lists.parameters;
                return Ok(lifted(
                    list[reference(word, list.len(), "parameter vertices")?],
                ));
            }
            let mut parts = word.split('/');
            let vertex = parts.next().unwrap_or("");
            if let Some(part) = parts.next().filter(|part| !part.is_empty()) {
                let list = &self.lists.texcoords;
                let found = list[reference(part, list.len(), "texture vertices")?];
                texture.push(found.extend(0.0).extend(1.0));
            }
            has_normals |= parts.next().is_some();
            let list = &self.lists.positions;
            Ok(list[reference(vertex, list.len(), "vertices")?])
        };
        let points = words.skip(ranges).map(point).collect::<Result<_, _>>();
        let points: Vec<_> = points.map_err(invalid)?;
        let place = || Place::item(statement.line, statement.keyword());
        if has_normals {
            let text = "normals of surfaces are not used; theirs are exact";
            self.warnings.unsupported(place(), text);
        }
        if !texture.is_empty() && texture.len() != points.len() {
            let text = "some points have texture vertices, others not; none is used";
            self.warnings.invalid(place(), text);
        }
        Ok(Element {
            kind,
            texture: Some(texture).filter(|texture| texture.len() == points.len()),
            points,
            parms: Default::default(),
            loops: Vec::new(),
            specials: Specials::default(),
        })
    }

    /// Ends the open element, if any; `end` is the line of its `end` statement.
    pub(super) fn close_element(&mut self, end: Option<usize>) {
        let Some(open) = self.open.take() else {
            return;
        };
        let place = Place::item(open.line, open.what.as_str());
        if end.is_none() {
            let text = "no \"end\" follows; taken as ended before the next statement";
            self.warnings.invalid(place.clone(), text);
        } else if let Some(stranger) = &open.stranger {
            let text = "a statement before the \"end\" of an element; taken for what follows it";
            self.warnings.invalid(stranger.clone(), text);
        }
        let attributes = std::mem::take(&mut self.attributes);
        let after = (self.tag, self.merging);
        (self.tag, self.merging) = open.state;
        let result = match &open.element {
            Err(problem) => Err(problem.clone()),
            Ok(element) => self.build(element, &attributes, &open),
        };
        self.attributes = attributes;
        (self.tag, self.merging) = after;
        if let Err(problem) = result {
            // What could not be read keeps its number.
            if open.what.starts_with("curv2") {
                self.trim_curves.push(None);
            } else if open.what.starts_with("surf") {
                self.surface_parts.push(0..0);
            }
            self.fail(place, problem);
        }
    }

    /// Makes curves and surfaces of a complete element.
    fn build(
        &mut self,
        element: &Element,
        attributes: &Attributes,
        open: &Open,
    ) -> Result<(), Problem> {
        let limit = self.options.limits.points;
        let place = || Place::item(open.line, open.what.as_str());
        let repairs = match &element.kind {
            Kind::Curve(_) => {
                let built = element.space_curves(attributes, limit)?;
                self.points_on_curve(&built.shape, &element.specials);
                for curve in built.shape {
                    self.add_wire(WireShape::Curve(curve), open.line, &open.what);
                }
                built.repairs
            }
            Kind::TrimCurve => {
                let built = element.trim_curve(attributes, limit)?;
                let curve = built.shape;
                let points = element.specials.points.iter();
                let points = points.flat_map(|(_, list)| list).map(|p| p.x).collect();
                self.trim_curves.push(Some(TrimCurve { curve, points }));
                built.repairs
            }
            Kind::Surface(_) => {
                let built = element.surfaces(attributes, limit)?;
                let loops = match loops::domain(&built.shape) {
                    Some(domain) => self.loops(element, open, &built.shape, &domain),
                    None => Vec::new(),
                };
                self.specials_on_surface(&built.shape, &element.specials, &element.loops);
                let first = self.surfaces.len();
                self.surface_parts.push(first..first + built.shape.len());
                let mut texture = self.texture(element, attributes, open, &built.shape);
                for surface in built.shape {
                    self.surfaces.push(SurfacePart {
                        surface,
                        texture: texture.next(),
                        loops: loops.clone(),
                        tag: self.tag,
                        merging: self.merging,
                        line: open.line,
                        what: open.what.clone(),
                    });
                }
                built.repairs
            }
        };
        for text in repairs {
            self.warnings.invalid(place(), text);
        }
        Ok(())
    }

    /// Texture coordinates for each part of a surface; nothing if it has none that fit.
    fn texture(
        &mut self,
        element: &Element,
        attributes: &Attributes,
        open: &Open,
        parts: &[Surface],
    ) -> std::vec::IntoIter<Surface> {
        let domain = |s: &Surface| [s.knots_u().domain(), s.knots_v().domain()];
        let problem = match element.texture(attributes, self.options.limits.points) {
            Ok(None) => None,
            Ok(Some(found)) if found.iter().map(domain).eq(parts.iter().map(domain)) => {
                return found.into_iter();
            }
            Ok(Some(_)) => Some(invalid(
                "texture vertices in pieces that are not the surface's",
            )),
            Err(problem) => Some(problem),
        };
        if let Some(problem) = problem {
            let place = Place::item(open.line, open.what.as_str());
            self.warnings.add(place, problem);
        }
        Vec::new().into_iter()
    }

    /// The loops of a surface; none at all if one of them is wrong, since the others would
    /// then show the wrong part.
    fn loops(
        &mut self,
        element: &Element,
        open: &Open,
        parts: &[Surface],
        domain: &[Range<f64>; 2],
    ) -> Vec<TrimLoop> {
        let mut loops = Vec::new();
        let mut bad = open.bad_loop.clone();
        let closed = match parts {
            [whole] => whole.closed(),
            _ => [false; 2],
        };
        let mut cut_off = Vec::new();
        let limit = self.options.limits.points;
        if element.loops.first().is_some_and(|text| text.hole) {
            // A rectangle of positive sides is always a loop.
            loops.extend(TrimLoop::border(&domain[0], &domain[1]));
        }
        for text in &element.loops {
            // Curves may be used again and again: what they cost is counted before.
            let cost = text.size(&self.trim_curves).saturating_mul(parts.len());
            self.loop_points = self.loop_points.saturating_add(cost);
            if self.loop_points > limit {
                let problem = Problem::TooLarge(format!("more than {limit} points in trim loops"));
                bad.get_or_insert((Place::line(text.line), problem));
                break;
            }
            let place = Place::item(text.line, if text.hole { "hole" } else { "trim" });
            match text.close(&self.trim_curves, domain) {
                Ok(one) => {
                    if loops::leaves(&one, domain, closed) {
                        cut_off.push(place);
                    }
                    loops.push(one);
                }
                Err(problem) => {
                    bad.get_or_insert((place, problem));
                }
            }
        }
        if loops::removed(&mut loops, domain) {
            let place = Place::item(open.line, open.what.as_str());
            let text = "two trim loops are the same; they count once";
            self.warnings.invalid(place, text);
        }
        if let Err(problem) = TrimLoop::check_inside(&loops, &domain[0], &domain[1], closed) {
            let place = Place::item(open.line, open.what.as_str());
            bad.get_or_insert((place, Problem::Geometry(problem)));
        }
        if let Some((place, problem)) = bad {
            loops.clear();
            self.fail(place, problem);
            let place = Place::item(open.line, open.what.as_str());
            self.warnings
                .unsupported(place, "the surface is shown untrimmed");
            return loops;
        }
        for place in cut_off {
            self.warnings.invalid(place, LEAVES);
        }
        loops
    }

    /// Takes a patch or curve of the versions before 3.0: 16 points, the rows from the last
    /// to the first.
    pub(super) fn superseded(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        let (list, keyword) = (&self.lists.positions, statement.keyword());
        let point = |word| Ok(list[reference(word, list.len(), "vertices")?]);
        let points: Result<Vec<DVec4>, String> = statement.arguments().map(point).collect();
        let points = points.map_err(invalid)?;
        let found = points.len();
        let values = |from: i32, count: usize| (from..).map(f64::from).take(count).collect();
        let (basis, parms, kind): (_, [Vec<f64>; 2], _) = match keyword {
            "cdc" if found < 4 => {
                return Err(invalid(format!("{found} vertices; at least 4 are needed")));
            }
            "cdc" => {
                let range = 0.0..(found - 3) as f64;
                let parms = [values(0, found - 2), Vec::new()];
                (Basis::Cardinal, parms, Kind::Curve(range))
            }
            _ if found != 16 => return Err(invalid(format!("{found} vertices; a patch has 16"))),
            _ => {
                let (basis, parm) = match keyword {
                    "bsp" => (Basis::Bspline, values(-3, 8)),
                    "bzp" => (Basis::Bezier, values(0, 2)),
                    _ => (Basis::Cardinal, values(0, 2)),
                };
                let kind = Kind::Surface([0.0..1.0, 0.0..1.0]);
                (basis, [parm.clone(), parm], kind)
            }
        };
        let points = match kind {
            Kind::Surface(_) => points.chunks(4).rev().flatten().copied().collect(),
            _ => points,
        };
        let element = Element {
            kind,
            points,
            texture: None,
            parms,
            loops: Vec::new(),
            specials: Specials::default(),
        };
        let open = Open {
            line: statement.line,
            what: keyword.to_owned(),
            element: Ok(element.clone()),
            bad_loop: None,
            state: (self.tag, self.merging),
            stranger: None,
        };
        self.build(&element, &Attributes::cubic(basis), &open)
    }
}
