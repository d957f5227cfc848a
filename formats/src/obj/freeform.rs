//! Free-form elements: attributes, and from `surf`, `curv` and `curv2` to surfaces and curves.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use kernel::{Curve, KnotVector, MAX_DEGREE, Surface};

use super::basis::{Basis, Direction, Run};
use super::invalid;
use super::specials::Specials;
use super::statements::{Statement, numbers, shown};
use super::trims::LoopText;
use crate::{Problem, common};

/// The statements that say how the next elements are meant.
#[derive(Clone, Debug, Default)]
pub(super) struct Attributes {
    basis: Option<Basis>,
    rational: bool,
    degrees: Vec<usize>,
    matrices: [Vec<f64>; 2],
    steps: Vec<usize>,
}

/// One or two whole numbers.
fn counts(statement: &Statement<'_>) -> Result<Vec<usize>, Problem> {
    let words: Vec<_> = statement.arguments().take(3).collect();
    if words.is_empty() || words.len() > 2 {
        return Err(invalid("one or two whole numbers are needed"));
    }
    let count = |word: &&str| {
        word.parse()
            .map_err(|_| invalid(format!("\"{}\" is not a whole number", shown(word))))
    };
    words.iter().map(count).collect()
}

impl Attributes {
    /// The attributes of the superseded patches: one polynomial basis of degree 3.
    pub(super) fn cubic(basis: Basis) -> Self {
        Self {
            basis: Some(basis),
            degrees: vec![3, 3],
            ..Self::default()
        }
    }

    /// Takes a `cstype`, `deg`, `bmat` or `step` statement; a wrong one undoes the one before.
    pub(super) fn set(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        match statement.keyword() {
            "cstype" => return self.set_basis(statement),
            "deg" => {
                self.degrees.clear();
                let degrees = counts(statement)?;
                if let Some(&found) = degrees.iter().find(|&&n| n == 0 || n > MAX_DEGREE) {
                    return Err(Problem::Geometry(kernel::Error::Degree { found }));
                }
                self.degrees = degrees;
            }
            "step" => {
                self.steps.clear();
                self.steps = counts(statement)?;
            }
            _ => {
                let index = direction_index(statement)?;
                self.matrices[index].clear();
                self.matrices[index] = numbers(statement.arguments().skip(1)).map_err(invalid)?;
            }
        }
        Ok(())
    }

    /// Takes a `cstype`; `rat` may stand before the basis or after it.
    fn set_basis(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        self.rational = statement.arguments().any(|word| word == "rat");
        let mut words = statement.arguments().filter(|&word| word != "rat");
        let word = words.next().unwrap_or("");
        self.basis = Basis::named(word);
        if self.basis.is_none() {
            return Err(invalid(format!(
                "\"{}\" is none of bmatrix, bezier, bspline, cardinal, taylor",
                shown(word)
            )));
        }
        match words.next() {
            Some(extra) => Err(invalid(format!(
                "\"{}\" after {word} is passed over; only rat may stand beside a basis",
                shown(extra)
            ))),
            None => Ok(()),
        }
    }

    /// One direction of an element, with its `parm`.
    fn direction<'a>(&'a self, index: usize, parm: &'a [f64]) -> Result<Direction<'a>, Problem> {
        let basis = self
            .basis
            .ok_or_else(|| invalid("no valid cstype before it"))?;
        let degree = match self.degrees.get(index) {
            _ if basis == Basis::Cardinal => 3,
            Some(&degree) => degree,
            None => match self.degrees.first() {
                Some(&degree) => degree,
                None => return Err(invalid("no valid deg before it")),
            },
        };
        Ok(Direction {
            name: ["u", "v"][index],
            basis,
            degree,
            parm,
            matrix: &self.matrices[index],
            step: self.steps.get(index).copied(),
        })
    }
}

/// Which direction the first argument of `parm` or `bmat` names: 0 for u, 1 for v.
pub(super) fn direction_index(statement: &Statement<'_>) -> Result<usize, Problem> {
    match statement.arguments().next() {
        Some("u") => Ok(0),
        Some("v") => Ok(1),
        other => Err(invalid(format!(
            "\"{}\" where u or v is needed",
            shown(other.unwrap_or(""))
        ))),
    }
}

/// What kind of element is open, with the range it is evaluated on.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// `curv`.
    Curve(Range<f64>),
    /// `curv2`.
    TrimCurve,
    /// `surf`.
    Surface([Range<f64>; 2]),
}

/// A free-form element with the statements of its body.
#[derive(Clone, Debug)]
pub(super) struct Element {
    /// What it is.
    pub(super) kind: Kind,
    /// Cartesian control points, each with its weight.
    pub(super) points: Vec<DVec4>,
    /// The texture vertex of each control point, if all have one.
    pub(super) texture: Option<Vec<DVec4>>,
    /// The values of `parm u` and `parm v`.
    pub(super) parms: [Vec<f64>; 2],
    /// Its `trim` and `hole` statements.
    pub(super) loops: Vec<LoopText>,
    /// Its `scrv` and `sp` statements.
    pub(super) specials: Specials,
}

/// Written parameters this close, as a share of the domain, are the same.
const ROUNDING: f64 = 1e-9;

/// What an element became, and what had to be repaired for it.
#[derive(Clone, Debug)]
pub(super) struct Built<T> {
    /// The curve or surface parts.
    pub(super) shape: T,
    /// Repairs, for warnings.
    pub(super) repairs: Vec<String>,
}

impl Element {
    /// The surfaces of a `surf`: one, or several where polynomial segments do not meet.
    ///
    /// `limit` bounds the number of control points after conversion.
    pub(super) fn surfaces(
        &self,
        attributes: &Attributes,
        limit: usize,
    ) -> Result<Built<Vec<Surface>>, Problem> {
        let Kind::Surface(ranges) = &self.kind else {
            return Err(invalid("not a surface"));
        };
        let mut repairs = Vec::new();
        if attributes.degrees.len() == 1 && attributes.basis != Some(Basis::Cardinal) {
            repairs.push("deg has one number; it is taken for both directions".to_owned());
        }
        let mut parms = self.parms.clone();
        for (i, parm) in parms.iter_mut().enumerate() {
            let direction = attributes.direction(i, &self.parms[i])?;
            repairs.extend(with_span(&direction, parm, &ranges[i]));
            let other = attributes.direction(1 - i, &self.parms[1 - i])?;
            let others = other.count().ok();
            let points = others.map(|count| self.points.len() / count.max(1));
            repairs.extend(with_steps(&direction, parm, points, &ranges[i]));
        }
        let spans = [0, 1].map(|i| attributes.direction(i, &parms[i]).map(|d| d.outer_count()));
        if let [Ok(Some(u)), Ok(Some(v))] = spans
            && u.saturating_mul(v) == self.points.len()
        {
            for (parm, name) in parms.iter_mut().zip(["u", "v"]) {
                repairs.push(with_outer(parm, name));
            }
        }
        let u = attributes.direction(0, &parms[0])?;
        let v = attributes.direction(1, &parms[1])?;
        let (count_u, count_v, found) = (u.count()?, v.count()?, self.points.len());
        let expected = count_u.saturating_mul(count_v);
        if found != expected {
            return Err(invalid(format!(
                "{found} control points; parm u asks for {count_u} and parm v for {count_v}, \
                 which makes {expected}"
            )));
        }
        check_size(
            u.converted_count().saturating_mul(v.converted_count()),
            limit,
        )?;
        let range_u = used_range(u.name, &u.domain(), &ranges[0], &mut repairs);
        let range_v = used_range(v.name, &v.domain(), &ranges[1], &mut repairs);

        let points = prepared(&self.points, attributes);
        let rows = points.chunks(count_u).map(<[DVec4]>::to_vec).collect();
        let mut shape = Vec::new();
        for run_u in u.runs(rows)? {
            for run_v in v.runs(transposed(&run_u.lines))? {
                let surface = surface(&run_u.knots, &run_v, attributes)?;
                shape.extend(restricted(surface, &range_u, &range_v)?);
            }
        }
        Ok(Built { shape, repairs })
    }

    /// The texture coordinates of a `surf`, part by part as [`Element::surfaces`]: the same
    /// functions of the texture vertices, without weights.
    pub(super) fn texture(
        &self,
        attributes: &Attributes,
        limit: usize,
    ) -> Result<Option<Vec<Surface>>, Problem> {
        let Some(points) = &self.texture else {
            return Ok(None);
        };
        let element = Self {
            kind: self.kind.clone(),
            points: points.clone(),
            texture: None,
            parms: self.parms.clone(),
            loops: Vec::new(),
            specials: Specials::default(),
        };
        let attributes = Attributes {
            rational: false,
            ..attributes.clone()
        };
        Ok(Some(element.surfaces(&attributes, limit)?.shape))
    }

    /// The curve of a `curv2`, over all its parameters.
    pub(super) fn trim_curve(
        &self,
        attributes: &Attributes,
        limit: usize,
    ) -> Result<Built<Curve<DVec2>>, Problem> {
        let mut built = self.curves(attributes, limit, 0.0..1.0, |p| p.truncate().truncate())?;
        let Some(shape) = built.shape.pop().filter(|_| built.shape.is_empty()) else {
            let text = "a curve in pieces that do not meet";
            return Err(Problem::Unsupported(text.to_owned()));
        };
        let repairs = built.repairs;
        Ok(Built { shape, repairs })
    }

    /// The curves of a `curv`: one, or several where polynomial segments do not meet.
    pub(super) fn space_curves(
        &self,
        attributes: &Attributes,
        limit: usize,
    ) -> Result<Built<Vec<Curve<DVec3>>>, Problem> {
        let Kind::Curve(asked) = &self.kind else {
            return Err(invalid("not a curve"));
        };
        let mut built = self.curves(attributes, limit, asked.clone(), DVec4::truncate)?;
        let domain = |curves: &[Curve<DVec3>]| {
            let [first, .., last] = curves else {
                return curves.first().map(Curve::domain);
            };
            Some(first.domain().start..last.domain().end)
        };
        if let Some(domain) = domain(&built.shape) {
            let range = used_range("u", &domain, asked, &mut built.repairs);
            let mut shape = Vec::new();
            for curve in built.shape {
                let part = common(&curve.domain(), &range);
                match part {
                    part if part == curve.domain() => shape.push(curve),
                    part if part.start < part.end => shape.push(curve.restricted(part)?),
                    _ => {}
                }
            }
            built.shape = shape;
        }
        Ok(built)
    }

    /// The curves of a one-dimensional element over all its parameters; `range` is where it is
    /// used, if its knots say nothing.
    fn curves<P: kernel::Point>(
        &self,
        attributes: &Attributes,
        limit: usize,
        range: Range<f64>,
        place: impl Fn(DVec4) -> P,
    ) -> Result<Built<Vec<Curve<P>>>, Problem> {
        let mut parm = self.parms[0].clone();
        let direction = attributes.direction(0, &self.parms[0])?;
        let points = Some(self.points.len());
        let outer = direction.outer_count();
        let repairs = with_span(&direction, &mut parm, &range)
            .or_else(|| with_steps(&direction, &mut parm, points, &range))
            .or_else(|| (outer == points).then(|| with_outer(&mut parm, "u")))
            .into_iter()
            .collect();
        let direction = attributes.direction(0, &parm)?;
        let (found, expected) = (self.points.len(), direction.count()?);
        if found != expected {
            return Err(invalid(format!(
                "{found} control points; parm u asks for {expected}"
            )));
        }
        check_size(direction.converted_count(), limit)?;
        let mut shape = Vec::new();
        for run in direction.runs(vec![prepared(&self.points, attributes)])? {
            let (points, weights) = finished(&run.lines, attributes);
            let points: Vec<P> = points.into_iter().map(&place).collect();
            shape.push(Curve::new(run.knots, &points, weights.as_deref())?);
        }
        Ok(Built { shape, repairs })
    }
}

/// Replaces B-spline knots that span nothing, as misprinted files have them, by clamped
/// uniform ones over `range`, and says so.
fn with_span(direction: &Direction<'_>, parm: &mut Vec<f64>, range: &Range<f64>) -> Option<String> {
    let count = direction.count().ok()?;
    let domain = direction.domain();
    if direction.basis != Basis::Bspline || domain.start < domain.end {
        return None;
    }
    if parm.windows(2).any(|pair| pair[1] < pair[0]) {
        return None;
    }
    let knots = KnotVector::clamped_uniform(direction.degree, count, range.clone()).ok()?;
    *parm = knots.as_slice().to_vec();
    let (name, at) = (direction.name, domain.start);
    Some(format!(
        "the knots along {name} span nothing, from {at} to {at}; equal steps from {} to {} are \
         taken",
        range.start, range.end
    ))
}

/// Repeats the first and the last knot, which some programs leave out as superfluous, and says so.
fn with_outer(parm: &mut Vec<f64>, name: &str) -> String {
    let [first, .., last] = parm[..] else {
        return String::new();
    };
    parm.insert(0, first);
    parm.push(last);
    format!("two knots along {name} are missing; the first and the last are repeated")
}

/// Gives segments without `parm` equal steps over `range`, as many as there are `points` for, or
/// one if that is not known, and says so. B-splines are clamped then.
fn with_steps(
    direction: &Direction<'_>,
    parm: &mut Vec<f64>,
    points: Option<usize>,
    range: &Range<f64>,
) -> Option<String> {
    if !parm.is_empty() {
        return None;
    }
    let name = direction.name;
    let [start, end] = [range.start, range.end];
    let told = format!("parm {name} is missing; equal steps from {start} to {end} are taken");
    if direction.basis == Basis::Bspline {
        let count = points.unwrap_or(direction.degree + 1);
        let knots = KnotVector::clamped_uniform(direction.degree, count, start..end).ok()?;
        *parm = knots.as_slice().to_vec();
        return Some(told);
    }
    let count = |parm: &[f64]| Direction { parm, ..*direction }.count().ok();
    let [one, two] = [count(&[0.0, 1.0])?, count(&[0.0, 1.0, 2.0])?];
    let more = points.unwrap_or(one).checked_sub(one)?;
    let segments = 1 + more / (two - one);
    let at = |k: usize| range.start + (range.end - range.start) * k as f64 / segments as f64;
    *parm = (0..=segments).map(at).collect();
    Some(told)
}

/// The part of the domain that an element is to be shown on: `asked`, cut to the domain.
fn used_range(
    name: &str,
    domain: &Range<f64>,
    asked: &Range<f64>,
    repairs: &mut Vec<String>,
) -> Range<f64> {
    // Written numbers are rounded: an end this close to that of the domain means that end.
    let near = ROUNDING * (domain.end - domain.start);
    let (mut start, mut end) = (asked.start, asked.end);
    if start < domain.start - near || end > domain.end + near || start >= end {
        let used = common(asked, domain);
        let used = if used.start < used.end {
            used
        } else {
            domain.clone()
        };
        repairs.push(format!(
            "the range {start} to {end} along {name} is not in the domain {} to {}; {} to {} is \
             shown",
            domain.start, domain.end, used.start, used.end
        ));
        (start, end) = (used.start, used.end);
    }
    let snapped = |x: f64, to: f64| if (x - to).abs() <= near { to } else { x };
    snapped(start, domain.start)..snapped(end, domain.end)
}

fn check_size(count: usize, limit: usize) -> Result<(), Problem> {
    if count <= limit {
        return Ok(());
    }
    let text = format!("{count} control points after conversion; the limit is {limit}");
    Err(Problem::TooLarge(text))
}

/// Points as the basis wants them: weights dropped unless rational, homogeneous where
/// segments are converted. Dropped weights are zero, which every conversion keeps.
fn prepared(points: &[DVec4], attributes: &Attributes) -> Vec<DVec4> {
    let keeps = attributes.basis.is_some_and(Basis::keeps_points);
    let prepare = |p: &DVec4| match (attributes.rational, keeps) {
        (false, _) => p.truncate().extend(0.0),
        (true, true) => *p,
        (true, false) => (p.truncate() * p.w).extend(p.w),
    };
    points.iter().map(prepare).collect()
}

/// Lines of points put one after the other, Cartesian again, and weights if rational.
fn finished(lines: &[Vec<DVec4>], attributes: &Attributes) -> (Vec<DVec4>, Option<Vec<f64>>) {
    let projected = attributes.rational && !attributes.basis.is_some_and(Basis::keeps_points);
    let finish = |p: &DVec4| {
        if projected {
            (p.truncate() / p.w).extend(p.w)
        } else {
            *p
        }
    };
    let points: Vec<_> = lines.iter().flatten().map(finish).collect();
    let weights = attributes
        .rational
        .then(|| points.iter().map(|p| p.w).collect());
    (points, weights)
}

/// Columns from rows of equal lengths.
fn transposed(rows: &[Vec<DVec4>]) -> Vec<Vec<DVec4>> {
    let columns = rows.first().map_or(0, Vec::len);
    let column = |i: usize| rows.iter().map(|row| row[i]).collect();
    (0..columns).map(column).collect()
}

/// The surface of a run along v, of which the lines stand along u.
fn surface(knots_u: &KnotVector, run_v: &Run, attributes: &Attributes) -> Result<Surface, Problem> {
    let (points, weights) = finished(&run_v.lines, attributes);
    let points: Vec<_> = points.iter().map(|p| p.truncate()).collect();
    let (knots_u, knots_v) = (knots_u.clone(), run_v.knots.clone());
    Ok(Surface::new(knots_u, knots_v, &points, weights.as_deref())?)
}

/// The part of a surface inside the ranges; `None` if there is none.
fn restricted(
    mut surface: Surface,
    range_u: &Range<f64>,
    range_v: &Range<f64>,
) -> Result<Option<Surface>, Problem> {
    let (domain_u, domain_v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let (u, v) = (common(&domain_u, range_u), common(&domain_v, range_v));
    let (u, v) = (
        surface.knots_u().snapped(u, ROUNDING),
        surface.knots_v().snapped(v, ROUNDING),
    );
    if u.start >= u.end || v.start >= v.end {
        return Ok(None);
    }
    if u != domain_u {
        surface = surface.restricted_u(u)?;
    }
    if v != domain_v {
        surface = surface.restricted_v(v)?;
    }
    Ok(Some(surface))
}
