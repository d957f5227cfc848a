//! Curves of space and of parameter domains: types 100 to 130.

use std::cell::Cell;
use std::ops::Range;

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Curve, KnotVector};

use super::boundary::Use;
use super::conic;
use super::directory::{File, WHOLE};
use super::net::Net;
use super::offset;
use super::parameters::Parameters;
use super::sheets::Warp;
use super::transform::{Transforms, check_finite};
use crate::Problem;

/// How deep composite and offset curves may nest.
const NESTING: usize = 8;

/// How many curves one composite curve may have at least, counting members of members; it may have
/// as many as the file has entities.
const MEMBERS: usize = 100_000;

/// Ends of the members of a composite curve no farther apart than this share of the largest meet.
const MEETS: f64 = 1e-5;

/// Chords of an arc over equal angles that are compared, and the share of one by which they may differ.
const CHORDS: u32 = 8;
const EVEN: f64 = 1e-6;

/// What is said of a curve of space that gives way.
pub(super) const OFF: &str =
    "a curve of space is off its surface; that of the parameter domain is used";

/// A curve, and what its parameter means.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rail {
    /// The curve; its domain is that of the file.
    pub curve: Curve<DVec3>,
    /// Parts of the domain in which the parameter of the file is an angle, which that of the
    /// curve is at the knots only.
    pub arcs: Vec<Range<f64>>,
}

impl From<Curve<DVec3>> for Rail {
    fn from(curve: Curve<DVec3>) -> Self {
        let arcs = Vec::new();
        Self { curve, arcs }
    }
}

impl Rail {
    /// An arc over its angles.
    pub(super) fn arc(curve: Curve<DVec3>) -> Self {
        let arcs = vec![curve.domain()];
        Self { curve, arcs }
    }

    /// The same rail run through backwards.
    pub(super) fn reversed(&self) -> Self {
        let Range { start, end } = self.curve.domain();
        let turned = |arc: &Range<f64>| start + end - arc.end..start + end - arc.start;
        Self {
            curve: self.curve.reversed(),
            arcs: self.arcs.iter().rev().map(turned).collect(),
        }
    }

    /// Whether its length grows evenly with the parameter, as along a line or an arc.
    pub(super) fn is_even(&self) -> bool {
        let domain = self.curve.domain();
        let is_line = self.curve.degree() == 1 && self.curve.points().count() == 2;
        if is_line || self.arcs != [domain.clone()] {
            return is_line;
        }
        // Arcs of ellipses have angles, too.
        let warp = Warp::new(self);
        let place = |k: u32| {
            let share = f64::from(k) / f64::from(CHORDS);
            let parameter = domain.start + (domain.end - domain.start) * share;
            self.curve.evaluate(warp.apply(parameter, &domain))
        };
        let chord = |k: u32| place(k).distance(place(k + 1));
        (1..CHORDS).all(|k| (chord(k) - chord(0)).abs() <= EVEN * chord(0))
    }
}

/// Reads curves.
#[derive(Debug)]
pub(super) struct Reader<'a, 'b> {
    pub file: &'a File<'b>,
    pub transforms: &'a mut Transforms,
    /// What had to be repaired, with the entity.
    pub repairs: Vec<(usize, Problem)>,
    /// The bases of offset surfaces.
    pub bases: Vec<usize>,
    /// How many more control points there may be.
    pub limit: usize,
    /// How much more work laying curves onto surfaces may take.
    pub laying: &'a Cell<usize>,
}

impl Reader<'_, '_> {
    /// Notes what had to be repaired of an entity.
    pub(super) fn repaired(&mut self, index: usize, text: &str) {
        let problem = Problem::Invalid(text.to_owned());
        self.repairs.push((index, problem));
    }

    /// Notes what of an entity is not as the file means it.
    pub(super) fn unsupported(&mut self, index: usize, text: impl Into<String>) {
        self.repairs
            .push((index, Problem::Unsupported(text.into())));
    }

    /// What comes of reading; what had to be repaired counts if that is used.
    pub(super) fn tried<T>(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<T, Problem>,
    ) -> Result<T, Problem> {
        let before = self.repairs.len();
        let result = read(self);
        if result.is_err() {
            self.repairs.truncate(before);
        }
        result
    }

    /// The curves of space of a stretch of a loop, as they run.
    pub(super) fn rails_along(&mut self, stretch: &Use) -> Result<Vec<Rail>, Problem> {
        let index = self.file.follow(stretch.space, "a trim curve")?;
        let mended = self.file.mended.get().and_then(|all| all.get(&index));
        let mut rails = match mended {
            Some(curve) => vec![Rail::from(curve.clone())],
            None => self.rails(index)?,
        };
        let map = self.transforms.follow(self.file, stretch.matrix)?;
        if map != DAffine3::IDENTITY {
            for rail in &mut rails {
                rail.curve = rail.curve.transformed(&map);
            }
            check_finite(rails.iter().flat_map(|rail| rail.curve.points()))?;
        }
        Ok(rails)
    }

    /// As [`Reader::rails_along`], to be looked at only: nothing is noted.
    pub(super) fn glimpse_along(&mut self, stretch: &Use) -> Result<Vec<Rail>, Problem> {
        let before = self.repairs.len();
        let rails = self.rails_along(stretch);
        self.repairs.truncate(before);
        rails
    }

    /// The curve a pointer leads to, in one piece.
    pub(super) fn rail(&mut self, pointer: i64) -> Result<Rail, Problem> {
        let index = self.file.follow(pointer, "a curve")?;
        let rails = self.rails(index)?;
        self.whole(index, rails)
    }

    /// Refuses curves of which there would be more control points than are left, in so many rows,
    /// once they have one degree.
    pub(super) fn check_room<'c>(
        &self,
        curves: impl Iterator<Item = &'c Curve<DVec3>>,
        rows: usize,
    ) -> Result<(), Problem> {
        let (mut pieces, mut degree) = (0, 0);
        for curve in curves {
            pieces += curve.knots().breaks().len() - 1;
            degree = degree.max(curve.degree());
        }
        let count = pieces.saturating_mul(rows * (degree + 1));
        if count > self.limit {
            let text = format!("{count} control points; the limit leaves {}", self.limit);
            return Err(Problem::TooLarge(text));
        }
        Ok(())
    }

    /// The curves of an entity in one; the parameter of a composite curve begins at zero.
    pub(super) fn whole(&mut self, index: usize, mut rails: Vec<Rail>) -> Result<Rail, Problem> {
        self.check_room(rails.iter().map(|rail| &rail.curve), 1)?;
        if turn(&mut rails) {
            let text = "members of a composite curve run backwards; they are turned";
            self.repaired(index, text);
        }
        let near = near(&rails);
        let is_apart = |pair: &[Rail]| pair[0].curve.end().distance(pair[1].curve.start()) > near;
        if rails.windows(2).any(is_apart) {
            let text = "pieces of a curve do not meet; each begins where the one before ends";
            self.repaired(index, text);
        }
        let rail = joined(rails)?;
        if self.file.entries[index].kind != 102 {
            return Ok(rail);
        }
        let Range { start, end } = rail.curve.domain();
        let curve = rail.curve.remapped(0.0..end - start);
        let moved = |arc: &Range<f64>| arc.start - start..arc.end - start;
        Ok(Rail {
            curve: curve.map_err(Problem::Geometry)?,
            arcs: rail.arcs.iter().map(moved).collect(),
        })
    }

    /// The curve of an entity in the coordinates of those that refer to it, in pieces where
    /// it is composite; a point is a curve without length.
    pub(super) fn rails(&mut self, index: usize) -> Result<Vec<Rail>, Problem> {
        let mut rails = Vec::new();
        self.collect(index, 0, &mut rails)?;
        Ok(rails)
    }

    /// As [`Reader::rails`] for curves of a parameter domain.
    pub(super) fn flat(&mut self, pointer: i64) -> Result<Vec<Curve<DVec2>>, Problem> {
        let index = self.file.follow(pointer, "a trim curve")?;
        let rails = self.rails(index)?;
        Ok(rails.iter().map(|rail| rail.curve.flattened()).collect())
    }

    pub(super) fn collect(
        &mut self,
        index: usize,
        depth: usize,
        to: &mut Vec<Rail>,
    ) -> Result<(), Problem> {
        let file = self.file;
        let entry = &file.entries[index];
        if depth > NESTING {
            let text = format!("curves are nested more than {NESTING} deep");
            return Err(Problem::Unsupported(text));
        }
        let most = MEMBERS.max(file.entries.len());
        if to.len() >= most {
            let text = format!("a composite curve has more than {most} members");
            return Err(Problem::Unsupported(text));
        }
        let map = self.transforms.follow(file, entry.transform)?;
        let first = to.len();
        if entry.kind == 102 {
            let mut buffer = Vec::new();
            let members = file
                .parameters(index, WHOLE, &mut buffer)?
                .pointers("curves")?;
            for member in members {
                let member = file.follow(member, "a curve")?;
                // Points between the curves say nothing about them.
                if !matches!(file.entries[member].kind, 116 | 132) {
                    self.collect(member, depth + 1, to)?;
                }
            }
        } else {
            self.single(index, depth, to)?;
        }
        if map != DAffine3::IDENTITY {
            for rail in &mut to[first..] {
                rail.curve = rail.curve.transformed(&map);
                check_finite(rail.curve.points())?;
            }
        }
        Ok(())
    }

    /// An entity that is no composite, in its own coordinates.
    fn single(&mut self, index: usize, depth: usize, to: &mut Vec<Rail>) -> Result<(), Problem> {
        let file = self.file;
        let entry = &file.entries[index];
        let mut buffer = Vec::new();
        let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
        let parameters = &mut parameters;
        let rail = match entry.kind {
            100 => conic::circle(parameters, file.global.resolution)?,
            104 => {
                let (rail, is_on) = conic::read(parameters, file.global.resolution)?;
                if !is_on {
                    self.repaired(index, "the ends of a conic arc are not on its conic");
                }
                rail
            }
            106 => polyline(parameters, entry.form)?,
            110 => {
                let [start, end] = [point(parameters)?, point(parameters)?];
                let line = Curve::line(start, end, 0.0..1.0).map_err(Problem::Geometry)?;
                Rail::from(line)
            }
            112 => {
                let (rail, gap) = cubics(parameters)?;
                if gap > GAP {
                    self.repaired(index, BRIDGED);
                }
                rail
            }
            116 => {
                let point = point(parameters)?;
                let line = Curve::line(point, point, 0.0..1.0).map_err(Problem::Geometry)?;
                Rail::from(line)
            }
            126 => {
                let mut repairs = Vec::new();
                let curves = spline(parameters, &mut repairs)?;
                self.repairs.extend(repairs.into_iter().map(|r| (index, r)));
                to.extend(curves.into_iter().map(Rail::from));
                return Ok(());
            }
            130 => {
                to.extend(offset::curves(self, index, depth)?);
                return Ok(());
            }
            _ => {
                let text = format!("{} is no curve", file.source(index));
                return Err(Problem::Unsupported(text));
            }
        };
        to.push(rail);
        Ok(())
    }
}

/// What to tell of something that was fitted and strays by a share of its size.
pub(super) fn fitted(what: &str, deviation: f64, accuracy: f64) -> String {
    if deviation <= accuracy {
        return format!("{what} is fitted to {accuracy:e} of its size");
    }
    let most = up_to(deviation);
    format!("{what} is fitted, but strays by up to {most} of its size")
}

/// A positive number rounded up to 1, 2 or 5 times a power of ten, so that what is alike is told as one.
pub(super) fn up_to(number: f64) -> String {
    let power = 10.0_f64.powf(number.log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|step| step * power);
    let most = steps.into_iter().find(|step| *step >= number);
    format!("{:.0e}", most.unwrap_or(10.0 * power))
}

/// How far ends of curves may be apart to meet.
fn near(rails: &[Rail]) -> f64 {
    let sizes = rails.iter().map(|r| r.curve.hull_bounds().diagonal());
    sizes.fold(0.0, f64::max) * MEETS
}

/// Turns curves round, each only where that clearly lets it begin where the one before ends;
/// whether any was.
fn turn(rails: &mut [Rail]) -> bool {
    let near = near(rails);
    let better = |turned: f64, straight: f64| straight > near && turned < 0.5 * straight;
    let mut is_any = false;
    if let [first, second, ..] = rails {
        let [start, end] = [first.curve.start(), first.curve.end()];
        let next = [second.curve.start(), second.curve.end()];
        let to_next = |p: DVec3| p.distance(next[0]).min(p.distance(next[1]));
        if better(to_next(start), to_next(end)) {
            *first = first.reversed();
            is_any = true;
        }
    }
    for k in 1..rails.len() {
        let before = rails[k - 1].curve.end();
        let [start, end] = [rails[k].curve.start(), rails[k].curve.end()];
        if better(before.distance(end), before.distance(start)) {
            rails[k] = rails[k].reversed();
            is_any = true;
        }
    }
    is_any
}

/// One curve from several; each begins where the one before ends, parameters go on.
pub(super) fn joined(rails: Vec<Rail>) -> Result<Rail, Problem> {
    let mut rails = rails.into_iter();
    let Some(Rail { curve, mut arcs }) = rails.next() else {
        return Err(Problem::Invalid("a composite curve is empty".to_owned()));
    };
    let mut others = Vec::new();
    let mut end = curve.domain().end;
    for rail in rails {
        let domain = rail.curve.domain();
        let shift = end - domain.start;
        let moved = |arc: &Range<f64>| arc.start + shift..arc.end + shift;
        arcs.extend(rail.arcs.iter().map(moved));
        end = domain.end + shift;
        others.push(rail.curve);
    }
    if others.is_empty() {
        return Ok(Rail { curve, arcs });
    }
    let curve = curve.joined(&others).map_err(Problem::Geometry)?;
    Ok(Rail { curve, arcs })
}

/// A point of three coordinates; the last may be missing.
fn point(parameters: &mut Parameters<'_>) -> Result<DVec3, Problem> {
    let (x, y) = (parameters.real()?, parameters.real()?);
    Ok(DVec3::new(x, y, parameters.real_or(0.0)?))
}

/// A rational B-spline curve (type 126), in pieces where it is torn.
fn spline(
    parameters: &mut Parameters<'_>,
    repairs: &mut Vec<Problem>,
) -> Result<Vec<Curve<DVec3>>, Problem> {
    let net = Net::curve(parameters)?;
    let range = parameters.real_or(0.0)?..parameters.real_or(0.0)?;
    net.into_curves(range, repairs)
}

/// Passes over the parameters of a curve or point, to what follows them.
pub(super) fn skip(kind: i64, parameters: &mut Parameters<'_>) -> Result<(), Problem> {
    let left = match kind {
        100 => 7,
        102 => parameters.count()?,
        104 => 11,
        106 => {
            let (width, count) = (parameters.integer()?, parameters.count()?);
            match width {
                1 => count.saturating_mul(2).saturating_add(1),
                2 => count.saturating_mul(3),
                _ => count.saturating_mul(6),
            }
        }
        110 => 6,
        112 => {
            parameters.skip(3);
            parameters.count()?.saturating_add(1).saturating_mul(13)
        }
        116 => 4,
        126 => {
            let [last, degree] = [parameters.count()?, parameters.count()?];
            last.saturating_mul(5)
                .saturating_add(degree)
                .saturating_add(15)
        }
        130 => 14,
        _ => 5,
    };
    parameters.skip(left);
    Ok(())
}

/// The points of copious data (type 106).
pub(super) fn copious(parameters: &mut Parameters<'_>) -> Result<Vec<DVec3>, Problem> {
    let (width, count) = (parameters.integer()?, parameters.count()?);
    let flat = match width {
        1 => Some(parameters.real()?),
        2 | 3 => None,
        _ => {
            let text = format!("points of kind {width}; there are kinds 1, 2 and 3");
            return Err(Problem::Invalid(text));
        }
    };
    let count = parameters.expect(count, "points")?;
    let mut points = Vec::new();
    for _ in 0..count {
        let (x, y) = (parameters.real()?, parameters.real()?);
        let z = match flat {
            Some(z) => z,
            None => parameters.real()?,
        };
        points.push(DVec3::new(x, y, z));
        for _ in 0..if width == 3 { 3 } else { 0 } {
            parameters.real()?;
        }
    }
    Ok(points)
}

/// Copious data as straight segments; those of form 63 are closed, also where the file leaves the
/// last one out.
fn polyline(parameters: &mut Parameters<'_>, form: i64) -> Result<Rail, Problem> {
    let mut points = copious(parameters)?;
    points.extend(points.first().copied().filter(|_| form == 63));
    points.dedup();
    let line = Curve::polyline(&points).map_err(Problem::Geometry)?;
    Ok(Rail::from(line))
}

/// A parametric spline curve (type 112): cubic polynomials between breakpoints; and how far these are apart
/// where they should meet, as a share of its size.
fn cubics(parameters: &mut Parameters<'_>) -> Result<(Rail, f64), Problem> {
    for _ in 0..3 {
        parameters.integer()?;
    }
    let count = parameters.count()?;
    parameters.expect(count.saturating_mul(13), "breakpoints and coefficients")?;
    let count = parameters.expect(count, "segments")?;
    let breaks = parameters.reals(count.saturating_add(1), "breakpoints")?;
    let (mut knots, mut points) = (Vec::new(), Vec::new());
    let mut gap = 0.0_f64;
    for pair in breaks.windows(2) {
        let mut coefficients = [DVec3::ZERO; 4];
        for axis in 0..3 {
            for coefficient in &mut coefficients {
                coefficient[axis] = parameters.real()?;
            }
        }
        let bezier = bezier(coefficients, pair[1] - pair[0]);
        if points.is_empty() {
            points.push(bezier[0]);
            knots.extend([pair[0]; 4]);
        } else if let Some(last) = points.last_mut() {
            // Neighbours meet up to rounding.
            gap = gap.max(last.distance(bezier[0]));
            *last = (*last + bezier[0]) * 0.5;
        }
        points.extend(&bezier[1..]);
        knots.extend([pair[1]; 3]);
    }
    knots.extend(knots.last().copied());
    let knots = KnotVector::new(3, knots).map_err(Problem::Geometry)?;
    let curve = Curve::new(knots, &points, None).map_err(Problem::Geometry)?;
    let gap = gap / curve.hull_bounds().diagonal();
    Ok((Rail::from(curve), gap))
}

/// Gaps between the pieces of cubic curves and surfaces that are told, as a share of the size of these,
/// and how.
pub(super) const GAP: f64 = 1e-5;
pub(super) const BRIDGED: &str = "its pieces do not meet; their borders are moved together";

/// The Bézier points of `a + b s + c s^2 + d s^3` for `s` from 0 to `h`.
pub(super) fn bezier([a, b, c, d]: [DVec3; 4], h: f64) -> [DVec3; 4] {
    let (b, c, d) = (b * h, c * (h * h), d * (h * h * h));
    [a, a + b / 3.0, a + (b * 2.0 + c) / 3.0, a + b + c + d]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::iges::parameters::Delimiters;

    fn parameters(record: &str) -> Parameters<'_> {
        Parameters::new(record.as_bytes(), Delimiters::default(), 1)
    }

    #[test]
    fn splines_are_restricted_to_their_range() {
        let record = "1,1,1,0,1,0,0.,0.,1.,1.,1.,1.,2.,0.,9.,4.,0.,9.,0.5,1.,0.,0.,1.;";
        let curve = spline(&mut parameters(record), &mut Vec::new())
            .unwrap()
            .remove(0);
        assert_eq!(curve.start(), DVec3::new(3.0, 0.0, 9.0));
        assert_eq!(curve.end(), DVec3::new(4.0, 0.0, 9.0));
        let hostile = spline(&mut parameters("1000000000,1,0,0,0,0,1.;"), &mut Vec::new());
        assert!(hostile.is_err());
    }

    #[test]
    fn polylines_come_in_three_kinds() {
        let flat = polyline(&mut parameters("1,3,7.,0.,0.,1.,0.,1.,1.;"), 11).unwrap();
        let deep = polyline(&mut parameters("2,3,0.,0.,7.,1.,0.,7.,1.,1.,7.;"), 12).unwrap();
        assert_eq!(flat, deep);
        let turned = "3,2,0.,0.,7.,9.,9.,9.,1.,1.,7.,9.,9.,9.;";
        let turned = polyline(&mut parameters(turned), 13).unwrap();
        assert_eq!(turned.curve.end(), DVec3::new(1.0, 1.0, 7.0));
        for last in ["", ",0.,0."] {
            let count = if last.is_empty() { 3 } else { 4 };
            let record = format!("1,{count},7.,0.,0.,1.,0.,1.,1.{last};");
            let closed = polyline(&mut parameters(&record), 63).unwrap().curve;
            assert_eq!(closed.end(), closed.start());
            assert_eq!(closed.points().count(), 4);
        }
    }

    #[test]
    fn cubic_segments_keep_their_polynomials() {
        // x = s + s^3 over 1..3, then x = 10 + s over 3..4; y = 2, z = s^2 and 4.
        let record = "3,0,3,2,1.,3.,4.,0.,1.,0.,1.,2.,0.,0.,0.,0.,0.,1.,0.,\
                      10.,1.,0.,0.,2.,0.,0.,0.,4.,0.,0.,0.;";
        let curve = cubics(&mut parameters(record)).unwrap().0.curve;
        let expected = DVec3::new(1.5 + 1.5_f64.powi(3), 2.0, 2.25);
        assert!(curve.evaluate(2.5).distance(expected) < 1e-14);
        assert!(curve.evaluate(3.5).distance(DVec3::new(10.5, 2.0, 4.0)) < 1e-14);
    }

    #[test]
    fn joined_curves_go_on_with_their_parameters() {
        let arc = conic::circle(&mut parameters("0.,0.,0.,0.,1.,-1.,0.;"), 0.0).unwrap();
        let line = Curve::line(DVec3::NEG_X, DVec3::NEG_X * 3.0, 0.0..1.0).unwrap();
        let sweep = arc.curve.domain();
        let joined = joined(vec![arc, Rail::from(line)]).unwrap();
        assert_eq!(joined.curve.domain(), sweep.start..sweep.end + 1.0);
        let there = joined.curve.evaluate(sweep.end + 0.25);
        assert!(there.distance(DVec3::NEG_X * 1.5) < 1e-14);
        assert_eq!(joined.arcs, [sweep]);
    }
}
