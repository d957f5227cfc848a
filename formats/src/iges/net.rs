//! Rational B-spline curves and surfaces (types 126, 128), with the repairs that real files need.

use std::ops::Range;

use glam::DVec3;
use kernel::{Curve, KnotVector, Surface, nearest};

use super::parameters::Parameters;
use crate::{Problem, common};

/// Largest step backwards of a knot that is taken for rounding, relative to all knots.
const KNOT_SLACK: f64 = 1e-3;

/// Knots that are nearer to each other, as a share of all, are one: they bound no part of a surface
/// that is larger than the rounding of its points.
const KNOT_ROUNDING: f64 = 1e-12;

/// Largest distance of two parameters that are taken for equal, relative to the domain.
const PARAMETER_SLACK: f64 = 1e-9;

/// A range that leaves the domain by no more than this share of that ends where the domain does.
const BEYOND: f64 = 1e-4;

/// Ends of a curve no farther apart than this share of its size meet.
const MEETS: f64 = 1e-9;

/// The range of a parameter that a file leaves empty.
const ALL: Range<f64> = 0.0..0.0;

/// How many control points may be copied to cut a surface.
pub(super) const TEARING: usize = 20_000_000;

/// The numbers of one surface, or of a curve as its row, while they are put in order.
#[derive(Clone, Debug)]
pub(crate) struct Net {
    degrees: [usize; 2],
    knots: [Vec<f64>; 2],
    /// Points, u running fastest.
    points: Vec<DVec3>,
    weights: Vec<f64>,
}

/// Reads a surface from its parameters, in several pieces where it is torn. What had to be
/// repaired goes to `repairs`; `limit` bounds the control points.
///
/// Where loops alone bound it, a closed surface stays closed whatever part of it the file asks for: they may
/// run over its seam.
pub(super) fn read(
    parameters: &mut Parameters<'_>,
    limit: usize,
    is_bounded: bool,
    repairs: &mut Vec<Problem>,
) -> Result<Vec<Surface>, Problem> {
    let mut net = Net::read(parameters, limit)?;
    let mut domain = || -> Result<Range<f64>, Problem> {
        Ok(parameters.real_or(0.0)?..parameters.real_or(0.0)?)
    };
    let wanted = [domain()?, domain()?];
    net.repair(&[0, 1], repairs)?;
    restricted(net.into_strips(repairs)?, wanted, is_bounded, repairs)
}

/// A point of three coordinates.
fn point(parameters: &mut Parameters<'_>) -> Result<DVec3, Problem> {
    Ok(DVec3::new(
        parameters.real()?,
        parameters.real()?,
        parameters.real()?,
    ))
}

impl Net {
    /// Reads counts, knots, weights and points.
    fn read(parameters: &mut Parameters<'_>, limit: usize) -> Result<Self, Problem> {
        let upper = [parameters.count()?, parameters.count()?];
        let degrees = [parameters.count()?, parameters.count()?];
        for _ in 0..5 {
            parameters.integer()?;
        }
        let counts = upper.map(|k| k.saturating_add(1));
        let net = counts[0].saturating_mul(counts[1]);
        let knots = |d: usize| counts[d].saturating_add(degrees[d]).saturating_add(1);
        // All that follows must be there before anything is stored.
        let values = net
            .saturating_mul(4)
            .saturating_add(knots(0))
            .saturating_add(knots(1));
        parameters.expect(values, "knots, weights and coordinates")?;
        let count = parameters.expect(net, "control points")?;
        if count > limit {
            return Err(Problem::TooLarge(format!(
                "{count} control points; the limit leaves {limit}"
            )));
        }
        for (d, name) in ["u", "v"].into_iter().enumerate() {
            if degrees[d] > upper[d] {
                return Err(Problem::Invalid(format!(
                    "degree {} needs {} control points along {name}; there are {}",
                    degrees[d],
                    degrees[d].saturating_add(1),
                    counts[d]
                )));
            }
        }
        let degrees = [
            parameters.expect(degrees[0], "knots")?,
            parameters.expect(degrees[1], "knots")?,
        ];
        let mut list = |count| {
            let count = parameters.expect(count, "values")?;
            parameters.reals(count, "values")
        };
        let knots = [list(knots(0))?, list(knots(1))?];
        let weights = list(net)?;
        let points = parameters.list(count, point)?;
        Ok(Self {
            degrees,
            knots,
            points,
            weights,
        })
    }

    /// Reads counts, knots, weights and points of a curve.
    pub(super) fn curve(parameters: &mut Parameters<'_>) -> Result<Self, Problem> {
        let (upper, degree) = (parameters.count()?, parameters.count()?);
        for _ in 0..4 {
            parameters.integer()?;
        }
        let count = upper.saturating_add(1);
        let knots = count.saturating_add(degree).saturating_add(1);
        let values = count.saturating_mul(4).saturating_add(knots);
        parameters.expect(values, "knots, weights and coordinates")?;
        let count = parameters.expect(count, "control points")?;
        let degree = parameters.expect(degree, "knots")?;
        if degree >= count {
            let needed = degree + 1;
            return Err(Problem::Invalid(format!(
                "degree {degree} needs {needed} control points; there are {count}"
            )));
        }
        let knots = parameters.reals(count + degree + 1, "knots")?;
        let weights = parameters.reals(count, "weights")?;
        let points = parameters.list(count, point)?;
        Ok(Self::row(degree, knots, points, weights))
    }

    /// The numbers of a curve as a row.
    fn row(degree: usize, knots: Vec<f64>, points: Vec<DVec3>, weights: Vec<f64>) -> Self {
        Self {
            degrees: [degree, 0],
            knots: [knots, vec![0.0, 1.0]],
            points,
            weights,
        }
    }

    /// The surfaces of these parts, points with u running fastest: several where knots tear it. What had to be
    /// repaired goes to `repairs`.
    pub(crate) fn surfaces_of(
        degrees: [usize; 2],
        knots: [Vec<f64>; 2],
        points: Vec<DVec3>,
        weights: Vec<f64>,
        repairs: &mut Vec<Problem>,
    ) -> Result<Vec<Surface>, Problem> {
        let mut net = Self {
            degrees,
            knots,
            points,
            weights,
        };
        net.repair(&[0, 1], repairs)?;
        Ok(net.into_strips(repairs)?.concat())
    }

    /// The surfaces between the places where the net is torn, by strips along v.
    fn into_strips(self, repairs: &mut Vec<Problem>) -> Result<Vec<Vec<Surface>>, Problem> {
        let mut strips = Vec::new();
        for strip in self.untorn(0, repairs) {
            let pieces = strip.untorn(1, repairs).into_iter();
            let pieces: Result<Vec<_>, _> = pieces.map(Self::into_surface).collect();
            strips.push(pieces?);
        }
        Ok(strips)
    }

    /// The curve of these parts, of which knots that stand too often are dropped, with the control points that belong
    /// to them.
    pub(crate) fn curve_of(
        degree: usize,
        knots: Vec<f64>,
        points: Vec<DVec3>,
        weights: Vec<f64>,
    ) -> Result<Curve<DVec3>, kernel::Error> {
        let mut net = Self::row(degree, knots, points, weights);
        net.drop_unused(0, &mut Vec::new());
        // Where it is torn, the knots say so.
        if net.tears(0).saturating_mul(net.points.len()) <= TEARING {
            let mut pieces = net.clone().untorn(0, &mut Vec::new());
            if pieces.len() == 1 {
                net = pieces.swap_remove(0);
            }
        }
        net.into_curve()
    }

    fn into_curve(self) -> Result<Curve<DVec3>, kernel::Error> {
        let [knots, _] = self.knots;
        let knots = KnotVector::new(self.degrees[0], knots)?;
        Curve::new(knots, &self.points, Some(&self.weights))
    }

    /// The part over a range of the curves, if they can exist: several where the knots tear them.
    pub(super) fn into_curves(
        mut self,
        mut wanted: Range<f64>,
        repairs: &mut Vec<Problem>,
    ) -> Result<Vec<Curve<DVec3>>, Problem> {
        self.repair(&[0], repairs)?;
        let pieces = self.untorn(0, repairs).into_iter();
        let curves: Result<Vec<_>, _> = pieces.map(Self::into_curve).collect();
        let curves = curves.map_err(Problem::Geometry)?;
        if let [curve] = curves.as_slice()
            && curve.start().distance(curve.end()) <= curve.hull_bounds().diagonal() * MEETS
            && is_period(&wanted, curve.knots())
        {
            wanted = ALL;
        }
        let ranges = parts("t", &wanted, curves.iter().map(Curve::knots), repairs);
        let pairs = curves.into_iter().zip(ranges);
        let part = |(curve, range): (Curve<DVec3>, Option<Range<f64>>)| match range? {
            range if range == curve.domain() => Some(Ok(curve)),
            range => Some(curve.restricted(range).map_err(Problem::Geometry)),
        };
        pairs.filter_map(part).collect()
    }

    /// Levels knots, drops surplus ones and makes weights positive.
    fn repair(&mut self, directions: &[usize], repairs: &mut Vec<Problem>) -> Result<(), Problem> {
        for &direction in directions {
            straighten(&mut self.knots[direction], direction, repairs);
            self.drop_unused(direction, repairs);
            if self.close_up(direction, repairs) {
                // What is unused now was told.
                self.drop_unused(direction, &mut Vec::new());
            }
        }
        if let Some(index) = self.weights.iter().position(|w| *w <= 0.0) {
            let found = self.weights[index];
            if self.weights.iter().all(|w| *w < 0.0) {
                // Only their ratios count.
                repairs.push(Problem::Invalid("all weights are negative".to_owned()));
                self.weights.iter_mut().for_each(|w| *w = -*w);
            } else {
                repairs.push(Problem::Invalid(format!(
                    "weight {index} is {found}; weights must be positive, all are set to 1"
                )));
                self.weights.fill(1.0);
            }
        }
        let tears: usize = directions.iter().map(|d| self.tears(*d)).sum();
        if tears.saturating_mul(self.points.len()) > TEARING {
            let text = format!("it is torn in {tears} places");
            return Err(Problem::Unsupported(text));
        }
        Ok(())
    }

    /// Makes one knot of those at an end of the domain that differ by rounding only; the spans
    /// between them would have derivatives without meaning.
    fn close_up(&mut self, direction: usize, repairs: &mut Vec<Problem>) -> bool {
        let (degree, count) = (self.degrees[direction], self.count(direction));
        let knots = &mut self.knots[direction];
        let (first, last) = (knots[degree], knots[count]);
        let slack = (last - first) * KNOT_ROUNDING;
        let near = |end: f64| move |knot: &f64| *knot - end != 0.0 && (*knot - end).abs() <= slack;
        let moved = knots
            .iter()
            .filter(|k| near(first)(k) || near(last)(k))
            .count();
        if moved == 0 {
            return false;
        }
        for knot in knots {
            for end in [first, last] {
                if near(end)(knot) {
                    *knot = end;
                }
            }
        }
        repairs.push(Problem::Invalid(format!(
            "{} knots at an end of the domain differ by rounding; they are made equal",
            name(direction)
        )));
        true
    }

    /// Number of control points along a direction.
    fn count(&self, direction: usize) -> usize {
        self.knots[direction].len() - self.degrees[direction] - 1
    }

    /// The positions in the net with their index along `direction`.
    fn indices(&self, direction: usize) -> impl Iterator<Item = usize> + use<> {
        let row = self.count(0);
        (0..self.points.len()).map(move |k| if direction == 0 { k % row } else { k / row })
    }

    /// Keeps the control points whose index along `direction` is wanted.
    fn select(&self, direction: usize, knots: Vec<f64>, keep: impl Fn(usize) -> bool) -> Self {
        let kept = || self.indices(direction).map(&keep);
        let mut result = self.clone();
        let pick = |(wanted, &value)| Some(value).filter(|_| wanted);
        result.points = kept().zip(&self.points).filter_map(pick).collect();
        let pick = |(wanted, &value)| Some(value).filter(|_| wanted);
        result.weights = kept().zip(&self.weights).filter_map(pick).collect();
        result.knots[direction] = knots;
        result
    }

    /// Drops knots that are repeated more than degree + 1 times, and the control points that
    /// belong to them, which have no influence on the surface.
    fn drop_unused(&mut self, direction: usize, repairs: &mut Vec<Problem>) {
        let allowed = self.degrees[direction] + 1;
        let knots = &self.knots[direction];
        let mut surplus = Vec::new();
        let mut start = 0;
        for run in knots.chunk_by(|a, b| a - b == 0.0) {
            if run.len() > allowed {
                surplus.push(start..start + run.len() - allowed);
                repairs.push(Problem::Invalid(format!(
                    "{} knot {} stands {} times; {allowed} are kept",
                    name(direction),
                    run[0],
                    run.len()
                )));
            }
            start += run.len();
        }
        if surplus.is_empty() {
            return;
        }
        let keep = |index: usize| {
            let before = surplus.partition_point(|range| range.end <= index);
            !surplus
                .get(before)
                .is_some_and(|range| range.contains(&index))
        };
        let knots = knots.iter().enumerate().filter(|(k, _)| keep(*k));
        let knots = knots.map(|(_, &knot)| knot).collect();
        *self = self.select(direction, knots, keep);
    }

    /// An upper bound on the places where the net has to be cut.
    fn tears(&self, direction: usize) -> usize {
        let runs = self.knots[direction].chunk_by(|a, b| a - b == 0.0);
        let torn = runs.filter(|run| run.len() > self.degrees[direction]);
        torn.count().saturating_sub(2)
    }

    /// Cuts the net where an inner knot stands degree + 1 times; there the surface is torn.
    /// If both sides meet nevertheless, the knot and one of the equal rows are dropped.
    fn untorn(self, direction: usize, repairs: &mut Vec<Problem>) -> Vec<Self> {
        let degree = self.degrees[direction];
        let mut parts = Vec::new();
        let mut rest = self;
        loop {
            let knots = &rest.knots[direction];
            let count = rest.count(direction);
            let (first, last) = (knots[degree.min(knots.len() - 1)], knots[count]);
            let torn = (degree + 1..count).find(|&k| {
                let knot = knots[k];
                knots[k + degree] <= knot && first < knot && knot < last && knots[k - 1] < knot
            });
            let Some(at) = torn else {
                parts.push(rest);
                return parts;
            };
            let knot = knots[at];
            if rest.meets(direction, at) {
                let mut fewer = knots.clone();
                fewer.remove(at);
                repairs.push(Problem::Invalid(format!(
                    "{} knot {knot} stands {} times; {degree} are kept",
                    name(direction),
                    degree + 1
                )));
                rest = rest.select(direction, fewer, |index| index != at);
            } else {
                repairs.push(Problem::Invalid(format!(
                    "it is torn at {} = {knot}; it is cut there",
                    name(direction)
                )));
                let (left, right) = (knots[..=at + degree].to_vec(), knots[at..].to_vec());
                parts.push(rest.select(direction, left, |index| index < at));
                rest = rest.select(direction, right, |index| index >= at);
            }
        }
    }

    /// Whether the rows on both sides of a tear are the same, to the last bit.
    fn meets(&self, direction: usize, at: usize) -> bool {
        let row = |wanted: usize| {
            let chosen = self
                .indices(direction)
                .zip(self.points.iter().zip(&self.weights));
            chosen.filter_map(move |(index, pair)| (index == wanted).then_some(pair))
        };
        row(at - 1).eq(row(at))
    }

    /// The surface, if it can exist.
    fn into_surface(self) -> Result<Surface, Problem> {
        let [u, v] = self.knots;
        let geometry = Problem::Geometry;
        let u = KnotVector::new(self.degrees[0], u).map_err(geometry)?;
        let v = KnotVector::new(self.degrees[1], v).map_err(geometry)?;
        Surface::from_u_fastest(u, v, &self.points, Some(&self.weights)).map_err(geometry)
    }
}

/// The name of a direction.
fn name(direction: usize) -> &'static str {
    if direction == 0 { "u" } else { "v" }
}

/// Replaces knots that step back a little by the largest knot before them.
fn straighten(knots: &mut [f64], direction: usize, repairs: &mut Vec<Problem>) {
    let (Some(&first), Some(&last)) = (knots.first(), knots.last()) else {
        return;
    };
    let slack = (last - first).abs() * KNOT_SLACK;
    let back = |pair: &[f64]| pair[0] - pair[1];
    if !knots.windows(2).any(|pair| back(pair) > 0.0) {
        return;
    }
    let mut largest = first;
    let mut step = 0.0_f64;
    for &knot in &*knots {
        step = step.max(largest - knot);
        largest = largest.max(knot);
    }
    if step > slack {
        // Left to the check of all knot vectors.
        return;
    }
    let mut largest = first;
    for knot in knots {
        largest = largest.max(*knot);
        *knot = largest;
    }
    repairs.push(Problem::Invalid(format!(
        "{} knots decrease by {step:e}; they are levelled",
        name(direction)
    )));
}

/// The part of a surface in strips of pieces that a file asks for; all of it if that part is not a
/// part.
fn restricted(
    strips: Vec<Vec<Surface>>,
    mut wanted: [Range<f64>; 2],
    is_bounded: bool,
    repairs: &mut Vec<Problem>,
) -> Result<Vec<Surface>, Problem> {
    if let [strip] = strips.as_slice()
        && let [surface] = strip.as_slice()
    {
        let closed = nearest::closed(surface);
        for (axis, knots) in [surface.knots_u(), surface.knots_v()].iter().enumerate() {
            if closed[axis] && (is_bounded || is_period(&wanted[axis], knots)) {
                wanted[axis] = ALL;
            }
        }
    }
    let [wanted_u, wanted_v] = wanted;
    let mut surfaces = Vec::new();
    let ranges = parts(
        "u",
        &wanted_u,
        strips.iter().map(|s| s[0].knots_u()),
        repairs,
    );
    for (strip, u) in strips.into_iter().zip(ranges) {
        let Some(u) = u else { continue };
        let ranges = parts("v", &wanted_v, strip.iter().map(Surface::knots_v), repairs);
        for (mut surface, v) in strip.into_iter().zip(ranges) {
            let Some(v) = v else { continue };
            if u != surface.knots_u().domain() {
                surface = surface.restricted_u(u.clone()).map_err(Problem::Geometry)?;
            }
            if v != surface.knots_v().domain() {
                surface = surface.restricted_v(v).map_err(Problem::Geometry)?;
            }
            surfaces.push(surface);
        }
    }
    Ok(surfaces)
}

/// Whether a range is as long as a domain: where that is closed, it is all of it, wherever it
/// begins.
fn is_period(wanted: &Range<f64>, knots: &KnotVector) -> bool {
    let [domain, wanted] = [&knots.domain(), wanted].map(|r| r.end - r.start);
    (wanted - domain).abs() <= domain * PARAMETER_SLACK
}

/// What lies in a wanted range of each of the domains that follow each other; all of them if the
/// range is no part of these.
fn parts<'k>(
    name: &str,
    wanted: &Range<f64>,
    knots: impl Iterator<Item = &'k KnotVector>,
    repairs: &mut Vec<Problem>,
) -> Vec<Option<Range<f64>>> {
    let (mut domains, mut found) = (Vec::new(), Vec::new());
    for knots in knots {
        let domain = knots.domain();
        let part = knots.snapped(common(wanted, &domain), PARAMETER_SLACK);
        found.push(Some(part).filter(|part| part.start < part.end));
        domains.push(domain);
    }
    let ends = domains.first().zip(domains.last());
    let Range { start, end } = ends.map_or(ALL, |(first, last)| first.start..last.end);
    let slack = (end - start) * BEYOND;
    let is_part = start - slack <= wanted.start && wanted.end <= end + slack;
    if is_part && found.iter().any(Option::is_some) {
        return found;
    }
    if *wanted != ALL {
        repairs.push(Problem::Invalid(format!(
            "the wanted range of {name} from {} to {} is no part of the domain from {start} to \
             {end}; the whole domain is used",
            wanted.start, wanted.end
        )));
    }
    domains.into_iter().map(Some).collect()
}

#[cfg(test)]
mod tests;
