//! Trim loops: from curves of the parameter domain, or from curves of space laid onto the
//! surface.

mod along;
mod extent;
mod flat;
mod hairline;
mod laid;
pub(super) mod side;
#[cfg(test)]
mod slit_tests;
mod slits;
#[cfg(test)]
mod sphere_tests;
#[cfg(test)]
mod tests;

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::{HashMap, HashSet};
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::nearest::{self, Nearby};
use kernel::{Curve, Orientation, Surface, TrimLoop};

use self::laid::Laid;
use super::boundary::{self, Boundary, Edges, Loop, Use};
use super::curves::{Reader, fitted, up_to};
use super::directory::SHORT;
use super::order::{Chain, Order};
use super::quadric::Quadric;
use super::sheets::{self, Sheet, SheetShape};
use crate::loops::{self as trim_loops, LEAVES};
use crate::{Problem, lifted};

/// How far a curve laid onto a surface may stray, relative to the size of the surface.
const ACCURACY: f64 = 1e-7;

/// Ends of curves no farther apart than this share of the surface's size meet.
const MEETS: f64 = 1e-5;

/// The resolution that a file states counts up to this share of the surface's size; where a loop does
/// not close otherwise, gaps are bridged up to it.
const COARSE: f64 = 1e-3;

/// A curve of space that is farther off its surface, as a share of the size of that, is told.
const ASTRAY: f64 = 1e-3;

/// Gaps are bridged up to this share of the surface's size at last: without its loop a face would be
/// shown whole.
const BRIDGED: f64 = 1e-2;

/// Which curves a loop is made of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Source {
    /// Those of the parameter domain, where they are where those of space are.
    Flat,
    /// Those of the parameter domain, which run along those of space.
    FlatAlong,
    /// Those of the parameter domain, wherever they are.
    FlatAnywhere,
    /// Those of space.
    Space,
}

/// Which curves each loop is made of.
type Choice<'a> = &'a dyn Fn(&Loop) -> Source;

/// A face in parts: each a surface with its loops.
pub(super) type Parts = Vec<(Surface, Vec<TrimLoop>)>;

/// Trims a sheet. What had to be repaired goes to the reader.
pub(super) fn faces(
    reader: &mut Reader<'_, '_>,
    lists: &mut Edges,
    face: usize,
    mut sheet: Sheet,
    boundary: &Boundary,
) -> Result<Parts, Problem> {
    let loops = match loops(reader, lists, face, boundary, sheet.border.as_ref()) {
        Ok(loops) => loops,
        Err(problem) => {
            untrimmed(reader, face, &problem);
            None
        }
    };
    let mut border = matches!(boundary, Boundary::Holes(_)) && sheet.border.is_none();
    if border && loops.is_some() && sheet.is_boundless() {
        let text = "its surface has no end; its outermost hole counts as its border";
        reader.repaired(face, text);
        border = false;
    }
    let surfaces = match extent::surfaces(reader, loops.as_deref().unwrap_or_default(), &mut sheet)
    {
        Ok(surfaces) => surfaces,
        Err(problem) => return no_plane(reader, face, problem),
    };
    if surfaces.is_empty() {
        let text = "it has no end, because no curves of space bound it; it is not shown";
        reader.unsupported(face, text);
    }
    let mut parts = Vec::new();
    for surface in surfaces {
        let trims = match &loops {
            None => Vec::new(),
            Some(loops) => {
                let resolution = reader.file.global.resolution;
                let trimmer = Trimmer::new(&surface, &sheet, resolution, reader.laying);
                match reader.tried(|reader| trimmer.trims(reader, face, loops, border)) {
                    Ok(trims) => trims,
                    Err(NOTHING) if sheet.is_plane() => return no_plane(reader, face, NOTHING),
                    Err(NOTHING) if trimmer.are_hairlines(reader, loops) => {
                        return Ok(no_face(reader, face, "which are no wider than a line"));
                    }
                    Err(problem) => {
                        untrimmed(reader, face, &problem);
                        Vec::new()
                    }
                }
            }
        };
        parts.push((surface, trims));
    }
    if parts.len() > 1 {
        let problems = parts.iter().map(|(s, trims)| check_inside(s, trims).err());
        // Nothing of any part is inside.
        if let Some([problem, ..]) = problems.collect::<Option<Vec<_>>>().as_deref() {
            untrimmed(reader, face, problem);
            parts.iter_mut().for_each(|(_, trims)| trims.clear());
        }
    }
    for _ in 0..leaving(&parts) {
        reader.repaired(face, LEAVES);
    }
    Ok(parts)
}

/// How many loops leave the surface that all parts make. Where it is closed they lie in its domain.
fn leaving(parts: &Parts) -> usize {
    let domain = trim_loops::domain(parts.iter().map(|(surface, _)| surface));
    let (Some(domain), Some((_, loops))) = (domain, parts.first()) else {
        return 0;
    };
    let leaves = |one: &&TrimLoop| trim_loops::leaves(one, &domain, [false; 2]);
    loops.iter().filter(leaves).count()
}

/// Makes sure that something of a surface is inside loops.
fn check_inside(surface: &Surface, loops: &[TrimLoop]) -> Result<(), Problem> {
    let [u, v] = [surface.knots_u(), surface.knots_v()].map(kernel::KnotVector::domain);
    TrimLoop::check_inside(loops, &u, &v, surface.closed()).map_err(Problem::Geometry)
}

/// Why loops bound nothing.
const NOTHING: Problem = Problem::Geometry(kernel::Error::NothingInside);

/// Notes that a plane is not shown because nothing is inside its loops: they alone tell how large it
/// is. Other problems stay.
fn no_plane(reader: &mut Reader<'_, '_>, face: usize, problem: Problem) -> Result<Parts, Problem> {
    if problem != NOTHING {
        return Err(problem);
    }
    Ok(no_face(reader, face, "and it has no border of its own"))
}

/// Notes that nothing is shown of a face inside whose loops is nothing, and why.
fn no_face(reader: &mut Reader<'_, '_>, face: usize, why: &str) -> Parts {
    reader.repaired(face, &format!("{NOTHING}, {why}; it is not shown"));
    Vec::new()
}

/// The curves of a curve on a surface (type 142) for its own sake: those of space, or else those
/// of the parameter domain, fitted to the surface.
pub(super) fn on_surface(
    reader: &mut Reader<'_, '_>,
    index: usize,
) -> Result<Vec<Curve<DVec3>>, Problem> {
    let file = reader.file;
    let pointer = i64::try_from(file.entries[index].number).unwrap_or_default();
    let uses = boundary::read(file, pointer)?.unwrap_or_default().uses;
    let Some(stretch) = uses.first() else {
        return Ok(Vec::new());
    };
    if stretch.space != 0 {
        let rails = reader.rails_along(stretch)?.into_iter();
        return Ok(rails.map(|rail| rail.curve).collect());
    }
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, SHORT, &mut buffer)?;
    parameters.integer()?;
    let base = file.follow(parameters.integer()?, "the surface")?;
    let sheet = sheets::read(reader, base, true)?;
    let SheetShape::Splines(pieces, _) = &sheet.shape else {
        let text = "curves in the parameters of planes and quadrics are not shown";
        return Err(Problem::Unsupported(text.to_owned()));
    };
    let surface = pieces.first().ok_or(kernel::Error::NothingInside);
    let surface = surface.map_err(Problem::Geometry)?;
    let trimmer = Trimmer::new(surface, &sheet, 0.0, reader.laying);
    let flat = trimmer.flat(reader, index, stretch, Source::FlatAnywhere)?;
    let (mut curves, mut strays) = (Vec::new(), 0.0_f64);
    for curve in &flat {
        let lifted = lifted::onto(trimmer.surface, curve, |uv| trimmer.point(uv))?;
        strays = strays.max(lifted.deviation / trimmer.size);
        curves.push(lifted.curve);
    }
    if strays > lifted::ACCURACY {
        reader.unsupported(index, fitted("it", strays, lifted::ACCURACY));
    }
    Ok(curves)
}

/// Notes that the loops of a face cannot be used.
fn untrimmed(reader: &mut Reader<'_, '_>, face: usize, problem: &Problem) {
    let why = match problem {
        // Without the numbers, so that such warnings are counted as one.
        Problem::Geometry(kernel::Error::LoopGap { .. }) => "a trim loop does not close".to_owned(),
        problem => problem.to_string(),
    };
    let noun = super::types::noun(reader.file.entries[face].kind);
    reader.unsupported(face, format!("{noun} is shown untrimmed: {why}"));
}

/// The loops of a face; `None` if nothing is cut off.
fn loops(
    reader: &mut Reader<'_, '_>,
    lists: &mut Edges,
    face: usize,
    boundary: &Boundary,
    border: Option<&Use>,
) -> Result<Option<Vec<Loop>>, Problem> {
    let pointers: &[i64] = match boundary {
        Boundary::Natural => &[],
        Boundary::Loops(pointers) | Boundary::Holes(pointers) => pointers,
    };
    let mut loops = Vec::new();
    let mut seen = HashSet::new();
    for &pointer in pointers {
        if !seen.insert(pointer) {
            let text = "a boundary is named twice; it counts once";
            reader.repaired(face, text);
            continue;
        }
        if let Some(mut one) = boundary::read(reader.file, pointer)? {
            lists.resolve(reader.file, &mut one)?;
            loops.push(one);
        }
    }
    if let Some(border) = border
        && !matches!(boundary, Boundary::Loops(_))
    {
        let uses = vec![border.clone()];
        loops.push(Loop {
            uses,
            ..Loop::default()
        });
    }
    if loops.iter().any(Loop::has_curves) {
        let before = loops.len();
        loops.retain(Loop::has_curves);
        for _ in loops.len()..before {
            reader.repaired(face, "a trim loop has no curves; it does not count");
        }
    }
    Ok(Some(loops).filter(|loops| !loops.is_empty()))
}

/// One surface with what is needed to trim it.
struct Trimmer<'a> {
    surface: &'a Surface,
    sheet: &'a Sheet,
    domain: [Range<f64>; 2],
    /// The domain of all pieces of the sheet together.
    whole: [Range<f64>; 2],
    closed: [bool; 2],
    size: f64,
    /// Points no farther apart are one.
    accuracy: f64,
    /// Points of space that take a whole side of the domain.
    poles: Vec<DVec3>,
    nearby: OnceCell<Nearby<'a>>,
    /// How far curves of the loops stray from what they were fitted to, as a share of the size.
    strays: Cell<f64>,
    /// How far curves of space were beside the surface they were laid onto, as a share of the size.
    beside: Cell<f64>,
    /// The curves of space that have been laid onto it, as they are used and turned: the others are
    /// tried, and the same again with wider gaps, where they bound no face.
    laid: RefCell<HashMap<Use, Laid>>,
    /// How much more work laying curves onto surfaces may take.
    left: &'a Cell<usize>,
}

impl<'a> Trimmer<'a> {
    fn new(surface: &'a Surface, sheet: &'a Sheet, resolution: f64, left: &'a Cell<usize>) -> Self {
        let size = surface.hull_bounds().diagonal();
        let most = size * COARSE;
        let domain = [surface.knots_u().domain(), surface.knots_v().domain()];
        let whole = match &sheet.shape {
            SheetShape::Splines(pieces, _) => {
                trim_loops::domain(pieces).unwrap_or_else(|| domain.clone())
            }
            SheetShape::Quadric(_) => domain.clone(),
        };
        Self {
            surface,
            sheet,
            domain,
            whole,
            closed: nearest::closed(surface),
            size,
            accuracy: (size * MEETS).max(resolution.min(most)),
            poles: (0..4)
                .filter_map(|side| nearest::pole(surface, side / 2, side % 2, size * ACCURACY))
                .collect(),
            nearby: OnceCell::new(),
            strays: Cell::new(0.0),
            beside: Cell::new(0.0),
            laid: RefCell::default(),
            left,
        }
    }

    /// The loops in the parameters of the surface.
    fn trims(
        &self,
        reader: &mut Reader<'_, '_>,
        face: usize,
        loops: &[Loop],
        border: bool,
    ) -> Result<Vec<TrimLoop>, Problem> {
        let mut trims = self.best_closed(reader, face, loops)?;
        if self.strays.get() > ACCURACY {
            reader.unsupported(face, fitted("a trim curve", self.strays.get(), ACCURACY));
        }
        let beside = self.beside.get();
        if beside > ASTRAY && !self.is_torn() {
            let most = up_to(beside);
            let text = format!(
                "a trim curve is off its surface by up to {most} of the size of that; it is laid onto it"
            );
            reader.repaired(face, &text);
        }
        if border {
            if trim_loops::surrounded(&mut trims, &self.domain).map_err(Problem::Geometry)? {
                let text = "a hole is the border of its surface; it counts as that";
                reader.repaired(face, text);
            }
            self.check_inside(&trims)?;
        }
        Ok(trims)
    }

    /// The loops of the curves that each prefers, of the others where those bound no face, or with
    /// wider gaps. What was repaired for those that are given up is not told.
    ///
    /// On a closed surface curves of space do not tell which side of them is the face, nor which way
    /// round they are meant; where those of the parameter domain run along them, they do.
    fn best_closed(
        &self,
        reader: &mut Reader<'_, '_>,
        face: usize,
        loops: &[Loop],
    ) -> Result<Vec<TrimLoop>, Problem> {
        let is_quadric = self.quadric().is_some();
        let preferred = |l: &Loop| {
            if l.prefers_space || is_quadric {
                Source::Space
            } else {
                Source::Flat
            }
        };
        let other = |l: &Loop| match preferred(l) {
            Source::Space => Source::Flat,
            _ => Source::Space,
        };
        let mut made = |source: Choice<'_>, accuracy: f64, repair: Option<Problem>| {
            reader.tried(|reader| {
                let made = self.closed(reader, face, loops, source, accuracy)?;
                reader.repairs.extend(repair.map(|repair| (face, repair)));
                Ok(made)
            })
        };
        let tells = |l: &Loop| l.prefers_space && l.uses.iter().all(|u| !u.flat.is_empty());
        if !is_quadric && self.closed != [false; 2] && loops.iter().any(tells) {
            let along = |l: &Loop| {
                if tells(l) {
                    Source::FlatAlong
                } else {
                    preferred(l)
                }
            };
            if let Ok(made) = made(&along, self.accuracy, None) {
                return Ok(made);
            }
        }
        let mut problem = match made(&preferred, self.accuracy, None) {
            Err(problem) => problem,
            made => return made,
        };
        let others: [(Choice<'_>, f64, &str); 4] = [
            (
                &other,
                self.accuracy,
                "a trim loop is made of the other curves of the file, because those it prefers \
                 bound no face",
            ),
            (
                &|_| Source::FlatAnywhere,
                self.accuracy,
                "a trim loop is made of curves of the parameter domain that are not where its \
                 curves of space are, because those bound no face",
            ),
            (
                &preferred,
                self.size * COARSE,
                "the curves of a trim loop meet within a thousandth of its surface only; the \
                 gaps are bridged",
            ),
            (
                &preferred,
                self.size * BRIDGED,
                "the curves of a trim loop meet within a hundredth of its surface only; the \
                 gaps are bridged",
            ),
        ];
        // Of quadrics only curves of space count.
        for (source, accuracy, text) in others.into_iter().skip(if is_quadric { 2 } else { 0 }) {
            let repair = if problem == laid::spent() {
                let text = format!("a trim loop is made of other curves of the file: {problem}");
                Problem::Unsupported(text)
            } else {
                Problem::Invalid(text.to_owned())
            };
            match made(source, accuracy, Some(repair)) {
                Ok(made) => return Ok(made),
                // Of what could have been tried, more than of what failed.
                Err(untried) if untried == laid::spent() => problem = untried,
                Err(_) => {}
            }
        }
        Err(problem)
    }

    /// The loops of these curves, if they close and something is inside them.
    fn closed(
        &self,
        reader: &mut Reader<'_, '_>,
        face: usize,
        loops: &[Loop],
        source: Choice<'_>,
        accuracy: f64,
    ) -> Result<Vec<TrimLoop>, Problem> {
        let mut chains = Vec::new();
        self.strays.set(0.0);
        self.beside.set(0.0);
        for one in loops {
            let chain = self.chain(reader, face, one, source(one), accuracy)?;
            let is_laid =
                source(one) == Source::Space || one.uses.iter().all(|u| u.flat.is_empty());
            chains.push((chain, is_laid));
        }
        let are_told = loops.iter().all(|l| l.is_oriented);
        let orientation = if are_told {
            Orientation::Left
        } else if loops.iter().all(|l| source(l) != Source::Space) {
            Orientation::Literal
        } else {
            Orientation::Unknown
        };
        let slit = if are_told {
            None
        } else {
            let untold = chains.iter().zip(loops);
            let untold =
                untold.map(|((chain, is_laid), one)| (chain.clone(), *is_laid && !one.is_oriented));
            self.unslit(&untold.collect::<Vec<_>>(), accuracy)
        };
        let mut made = if let Some(made) = slit {
            made
        } else {
            let chains = chains.iter().map(|(chain, _)| chain.clone()).collect();
            let made =
                kernel::close_loops(self.surface, self.closed, chains, accuracy, orientation);
            made.map_err(Problem::Geometry)?
        };
        if are_told && let Some(turned) = self.turned(&chains, &made.loops, accuracy) {
            let text = "its loops run the other way round than the seam of its surface tells; they are turned";
            reader.repaired(face, text);
            made = turned;
        }
        let text = "the curves of a trim loop do not quite meet; the gaps are bridged";
        if made.wide_gaps > 0 && loops.iter().any(|l| source(l) == Source::FlatAlong) {
            return Err(Problem::Invalid(text.to_owned()));
        }
        for _ in 0..made.wide_gaps {
            reader.repaired(face, text);
        }
        let mut loops = made.loops;
        if trim_loops::removed(&mut loops, &self.domain) {
            let text = "two trim loops are the same; they count once";
            reader.repaired(face, text);
        }
        self.check_inside(&loops)?;
        Ok(loops)
    }

    /// Makes sure that something is inside the loops; of a part of a torn surface nothing may be.
    fn check_inside(&self, loops: &[TrimLoop]) -> Result<(), Problem> {
        if self.is_torn() {
            return Ok(());
        }
        check_inside(self.surface, loops)
    }

    /// Whether it is one of several parts of its sheet, which all have the same loops.
    fn is_torn(&self) -> bool {
        matches!(&self.sheet.shape, SheetShape::Splines(pieces, _) if pieces.len() > 1)
    }

    /// The curves of one loop, turned so that each begins where the one before ends.
    fn chain(
        &self,
        reader: &mut Reader<'_, '_>,
        face: usize,
        one: &Loop,
        source: Source,
        accuracy: f64,
    ) -> Result<Chain, Problem> {
        let mut chain = Vec::new();
        for stretch in &one.uses {
            let flat = if source != Source::Space && !stretch.flat.is_empty() {
                let found = reader.tried(|reader| self.flat(reader, face, stretch, source));
                if let Err(problem) = &found {
                    let text = format!("{problem}; the curve of space is used");
                    if stretch.space != 0 {
                        reader.repairs.push((face, Problem::Invalid(text)));
                    }
                }
                found
            } else if stretch.space == 0 && !stretch.flat.is_empty() && self.quadric().is_none() {
                self.flat(reader, face, stretch, source)
            } else {
                Ok(Vec::new())
            };
            match flat {
                Ok(flat) if !flat.is_empty() => chain.extend(flat),
                Err(problem) if stretch.space == 0 || source == Source::FlatAlong => {
                    return Err(problem);
                }
                // A vertex: the loop goes on from the same point.
                _ if stretch.space == 0 => {}
                _ => chain.extend(self.laid(reader, stretch)?),
            }
        }
        if chain.is_empty() {
            return Err(Problem::Invalid("a trim loop without curves".to_owned()));
        }
        let order = Order {
            point: |uv| self.point(uv),
            periods: [0, 1].map(|axis| self.closed[axis].then(|| self.domain[axis].clone())),
            near: self.size * MEETS,
            accuracy,
        };
        let (chain, repairs) = order.aligned(chain);
        for text in repairs {
            reader.repaired(face, text);
        }
        Ok(chain)
    }

    fn quadric(&self) -> Option<&'a Quadric> {
        match &self.sheet.shape {
            SheetShape::Quadric(quadric) => Some(quadric),
            SheetShape::Splines(..) => None,
        }
    }

    /// The point of the surface, with parameters beyond its seams brought back and others
    /// moved to its border.
    fn point(&self, uv: DVec2) -> DVec3 {
        let mut inside = uv;
        for axis in 0..2 {
            let Range { start, end } = self.domain[axis].clone();
            if self.closed[axis] && !(start..=end).contains(&uv[axis]) {
                inside[axis] = start + (uv[axis] - start).rem_euclid(end - start);
            }
            inside[axis] = inside[axis].max(start).min(end);
        }
        self.surface.evaluate(inside)
    }
}
