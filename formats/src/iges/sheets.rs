//! Surfaces: types 108, 114 to 128, 140 and 190 to 198.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Curve, KnotVector, Surface, modelling};

use super::boundary::Use;
use super::curves::{self, Rail, Reader};
use super::directory::WHOLE;
use super::parameters::Parameters;
use super::quadric::{self, Quadric, wound};
use super::transform::check_finite;
use super::{net, offset, ruled};
use crate::Problem;

/// How deep offset surfaces may nest.
const NESTING: usize = 8;

/// Angles up to this share above a whole turn are one: they are written with few digits.
const TURN_SLACK: f64 = 1e-6;

/// How often the range is halved in which a parameter is looked for.
const HALVINGS: usize = 60;

/// A surface before it is trimmed.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    pub shape: SheetShape,
    /// Where it stands, from its own transformation and that of the base of an offset.
    pub place: DAffine3,
    /// The closed curve that bounds a plane.
    pub border: Option<Use>,
    /// The name among its properties.
    pub name: String,
}

impl Sheet {
    /// Whether it has no border of its own, and no end.
    pub(super) fn is_boundless(&self) -> bool {
        matches!(&self.shape, SheetShape::Quadric(quadric) if quadric.is_boundless())
    }

    /// Whether it is a plane.
    pub(super) fn is_plane(&self) -> bool {
        matches!(&self.shape, SheetShape::Quadric(quadric) if quadric.shape == quadric::Shape::Plane)
    }
}

#[derive(Clone, Debug)]
pub(super) enum SheetShape {
    /// Surfaces with the parameters of the file, but for the warps; several where one is torn.
    Splines(Vec<Surface>, [Warp; 2]),
    /// A surface that is made as large as its trim curves need.
    Quadric(Quadric),
}

/// What a parameter of the file is to that of the surface, which has the same domain.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Warp {
    /// Knots over the parameter of the file, and the parts of their domain in which it is an
    /// angle.
    angles: Option<(KnotVector, Vec<Range<f64>>)>,
}

impl Warp {
    /// The warp along a rail, or along a parameter that is an angle everywhere.
    pub(super) fn new(rail: &Rail) -> Self {
        let knots = rail.curve.knots().clone();
        let arcs = rail.arcs.clone();
        Self {
            angles: (!arcs.is_empty()).then_some((knots, arcs)),
        }
    }

    /// Whether it changes nothing.
    pub(super) fn is_identity(&self) -> bool {
        self.angles.is_none()
    }

    /// The length of a full turn, where the parameter is an angle throughout.
    pub(super) fn turn(&self, domain: &Range<f64>) -> Option<f64> {
        let (knots, arcs) = self.angles.as_ref()?;
        let own = knots.domain();
        let scale = (own.end - own.start) / (domain.end - domain.start);
        (*arcs == [own]).then_some(TAU / scale)
    }

    /// The parameter of the surface for one of the file; `domain` is that of both.
    pub(super) fn apply(&self, parameter: f64, domain: &Range<f64>) -> f64 {
        let Some((knots, arcs)) = &self.angles else {
            return parameter;
        };
        let own = knots.domain();
        let scale = (own.end - own.start) / (domain.end - domain.start);
        let angle = own.start + (parameter - domain.start) * scale;
        let is_angle = arcs
            .iter()
            .any(|arc| arc.start <= angle && angle <= arc.end)
            || arcs.len() == 1 && arcs[0] == own;
        if !is_angle {
            return parameter;
        }
        domain.start + (wound(knots, angle) - own.start) / scale
    }

    /// The parameter of the file for one of the surface.
    pub(super) fn undone(&self, parameter: f64, domain: &Range<f64>) -> f64 {
        if self.is_identity() {
            return parameter;
        }
        let (mut low, mut high) = (domain.start, domain.end);
        if parameter <= low || parameter >= high {
            return parameter.clamp(low, high);
        }
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if self.apply(middle, domain) < parameter {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}

/// Whether we read surfaces of this type.
pub(super) fn is_sheet(kind: i64) -> bool {
    matches!(
        kind,
        108 | 114 | 118 | 120 | 122 | 128 | 140 | 190 | 192 | 194 | 196 | 198
    )
}

/// Reads a surface; loops alone may [bound](net::read) it.
pub(super) fn read(
    reader: &mut Reader<'_, '_>,
    index: usize,
    is_bounded: bool,
) -> Result<Sheet, Problem> {
    nested(reader, index, is_bounded, 0, 1.0)
}

/// Reads an offset on the other side of its base than the file tells.
pub(super) fn other_side(
    reader: &mut Reader<'_, '_>,
    index: usize,
    is_bounded: bool,
) -> Result<Sheet, Problem> {
    nested(reader, index, is_bounded, 0, -1.0)
}

/// Reads a surface; the distance of an offset from its base is so many times what the file tells.
fn nested(
    reader: &mut Reader<'_, '_>,
    index: usize,
    is_bounded: bool,
    depth: usize,
    times: f64,
) -> Result<Sheet, Problem> {
    let file = reader.file;
    let entry = &file.entries[index];
    let mut place = reader.transforms.follow(file, entry.transform)?;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let p = &mut parameters;
    let one = |surface: Surface, warps| SheetShape::Splines(vec![surface], warps);
    let mut border = None;
    let shape = match entry.kind {
        108 => {
            let plane = quadric::plane(p)?;
            let curve = p.integer_or(0)?;
            // What follows places a symbol.
            for _ in 0..4 {
                p.real_or(0.0)?;
            }
            border = (entry.form != 0 && curve != 0).then(|| Use {
                space: curve,
                matrix: entry.transform,
                ..Use::default()
            });
            SheetShape::Quadric(plane)
        }
        190 | 192 | 194 | 196 | 198 => SheetShape::Quadric(quadric::read(reader, entry, p)?),
        114 => {
            let (surface, gap) = cubics(p, reader.limit)?;
            if gap > curves::GAP {
                reader.repaired(index, curves::BRIDGED);
            }
            one(surface, Default::default())
        }
        118 => ruled::surface(reader, index, p, entry.form)?,
        120 => revolved(reader, index, p)?,
        122 => {
            let rail = reader.rail(p.integer()?)?;
            let end = DVec3::new(p.real()?, p.real()?, p.real_or(0.0)?);
            let along = end - rail.curve.start();
            let curve = rail.curve.remapped(0.0..1.0).map_err(Problem::Geometry)?;
            let surface = modelling::extrude(&curve, along).map_err(Problem::Geometry)?;
            one(surface, [Warp::new(&rail), Warp::default()])
        }
        128 => {
            let mut repairs = Vec::new();
            let pieces = net::read(p, reader.limit, is_bounded, &mut repairs)?;
            reader
                .repairs
                .extend(repairs.into_iter().map(|r| (index, r)));
            SheetShape::Splines(pieces, Default::default())
        }
        140 => {
            let (shape, of_base) = offset(reader, index, p, is_bounded, (depth, times))?;
            place *= of_base;
            shape
        }
        _ => {
            let text = format!("{} is no surface that is read", file.source(index));
            return Err(Problem::Unsupported(text));
        }
    };
    let shape = match shape {
        SheetShape::Splines(pieces, warps) if place != DAffine3::IDENTITY => {
            let pieces: Vec<_> = pieces.iter().map(|s| s.transformed(&place)).collect();
            check_finite(pieces.iter().flat_map(Surface::points))?;
            SheetShape::Splines(pieces, warps)
        }
        shape => shape,
    };
    let name = super::entities::trailing_name(file, &mut parameters);
    Ok(Sheet {
        shape,
        place,
        border,
        name,
    })
}

/// An offset surface (type 140), and what places it beside its own transformation.
fn offset(
    reader: &mut Reader<'_, '_>,
    index: usize,
    parameters: &mut Parameters<'_>,
    is_bounded: bool,
    (depth, times): (usize, f64),
) -> Result<(SheetShape, DAffine3), Problem> {
    let mut real = || parameters.real();
    let side = DVec3::new(real()?, real()?, real()?);
    let distance = real()? * times;
    let base = reader
        .file
        .follow(parameters.integer()?, "the base of an offset surface")?;
    if depth >= NESTING {
        let text = format!("offset surfaces are nested more than {NESTING} deep");
        return Err(Problem::Unsupported(text));
    }
    reader.bases.push(base);
    let base = nested(reader, base, is_bounded, depth + 1, 1.0)?;
    let made = offset::surface(&base, side, distance)?;
    if made.is_cut {
        reader.unsupported(index, "the offset of a surface with creases is in pieces");
    }
    if made.deviation > offset::EXACT {
        let text = curves::fitted("it", made.deviation, offset::ACCURACY);
        reader.unsupported(index, text);
    }
    let place = match made.shape {
        SheetShape::Quadric(_) => base.place,
        SheetShape::Splines(..) => DAffine3::IDENTITY,
    };
    Ok((made.shape, place))
}

/// A surface of revolution (type 120).
fn revolved(
    reader: &mut Reader<'_, '_>,
    index: usize,
    parameters: &mut Parameters<'_>,
) -> Result<SheetShape, Problem> {
    let axis = reader.rail(parameters.integer()?)?.curve;
    let rail = reader.rail(parameters.integer()?)?;
    let start = parameters.real()?;
    let mut end = parameters.real()?;
    if end <= start {
        end += TAU * ((start - end) / TAU).floor() + TAU;
        let text = "it ends at no larger angle than where it begins; whole turns are added";
        reader.repaired(index, text);
    } else if end - start > TAU * (1.0 + TURN_SLACK) {
        reader.repaired(index, "it turns more than once; one turn is shown");
    }
    let origin = axis.start();
    let direction = axis.end() - origin;
    let angles = start..end.min(start + TAU);
    let surface =
        modelling::revolve(&rail.curve, origin, direction, angles).map_err(Problem::Geometry)?;
    let turn = Warp {
        angles: Some((surface.knots_v().clone(), vec![surface.knots_v().domain()])),
    };
    Ok(SheetShape::Splines(vec![surface], [Warp::new(&rail), turn]))
}

/// A parametric spline surface (type 114): bicubic polynomials between breakpoints; and how far these are
/// apart where they should meet, as a share of its size.
fn cubics(parameters: &mut Parameters<'_>, limit: usize) -> Result<(Surface, f64), Problem> {
    parameters.integer()?;
    parameters.integer()?;
    let counts = [parameters.count()?, parameters.count()?];
    let pieces = counts[0].saturating_mul(counts[1]);
    parameters.expect(pieces.saturating_mul(48), "coefficients")?;
    if pieces.saturating_mul(16) > limit as u64 {
        let text = format!("{pieces} pieces; the limit leaves {limit} control points");
        return Err(Problem::TooLarge(text));
    }
    let counts = [
        parameters.expect(counts[0], "pieces")?,
        parameters.expect(counts[1], "pieces")?,
    ];
    let breaks = [
        parameters.reals(counts[0].saturating_add(1), "breakpoints")?,
        parameters.reals(counts[1].saturating_add(1), "breakpoints")?,
    ];
    // One more block ends each row, and one more row the surface; they say nothing, and some
    // programs leave them out.
    let has_ends = parameters.left() / 48 > counts[0].saturating_mul(counts[1]);
    let [rows, row] = counts.map(|count| 3 * count + 1);
    let mut points = vec![DVec3::ZERO; rows.saturating_mul(row)];
    let mut gap = 0.0_f64;
    for i in 0..counts[0] {
        for j in 0..counts[1] {
            // Powers of the first parameter run fastest.
            let mut powers = [[DVec3::ZERO; 4]; 4];
            for axis in 0..3 {
                for line in &mut powers {
                    for coefficient in line {
                        coefficient[axis] = parameters.real()?;
                    }
                }
            }
            let [h, k] =
                [(0, i), (1, j)].map(|(d, n): (usize, usize)| breaks[d][n + 1] - breaks[d][n]);
            let lines = powers.map(|line| curves::bezier(line, h));
            for a in 0..4 {
                let across =
                    curves::bezier([lines[0][a], lines[1][a], lines[2][a], lines[3][a]], k);
                for (b, point) in across.into_iter().enumerate() {
                    let place = &mut points[(3 * i + a) * row + 3 * j + b];
                    if i > 0 && a == 0 || j > 0 && b == 0 {
                        gap = gap.max(place.distance(point));
                    }
                    *place = point;
                }
            }
        }
        for _ in 0..if has_ends { 48 } else { 0 } {
            parameters.real_or(0.0)?;
        }
    }
    for _ in 0..if has_ends { 48 * (counts[1] + 1) } else { 0 } {
        parameters.real_or(0.0)?;
    }
    let knots = |breaks: &[f64]| {
        let mut knots: Vec<f64> = breaks.iter().flat_map(|&t| [t; 3]).collect();
        knots.extend(breaks.last());
        knots.insert(0, breaks[0]);
        KnotVector::new(3, knots)
    };
    let surface =
        knots(&breaks[0]).and_then(|u| Surface::new(u, knots(&breaks[1])?, &points, None));
    let surface = surface.map_err(Problem::Geometry)?;
    let gap = gap / surface.hull_bounds().diagonal();
    Ok((surface, gap))
}

/// The parameters of a parallelogram's points, if the surface is one: the corner and both
/// edges.
pub(super) fn parallelogram(surface: &Surface) -> Option<[DVec3; 3]> {
    let degrees = [surface.knots_u().degree(), surface.knots_v().degree()];
    if degrees != [1, 1] || surface.homogeneous().len() != 4 || surface.is_rational() {
        return None;
    }
    let [[a, b], [c, d]] = surface.corners();
    let edges = [c - a, b - a];
    let size = edges[0].length() + edges[1].length();
    ((a + d).distance(b + c) <= 1e-12 * size).then_some([a, edges[0], edges[1]])
}

/// The exact image of a curve in the plane of a parallelogram, in its parameters.
pub(super) fn in_parallelogram(
    surface: &Surface,
    [corner, along_u, along_v]: [DVec3; 3],
    curve: &Curve<DVec3>,
) -> Option<Curve<DVec2>> {
    let normal = along_u.cross(along_v);
    let axes = glam::DMat3::from_cols(along_u, along_v, normal);
    let inverse = Some(axes.inverse()).filter(|m| m.is_finite())?;
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let scale = DVec3::new(u.end - u.start, v.end - v.start, 1.0);
    let linear = glam::DMat3::from_diagonal(scale) * inverse;
    let shift = DVec3::new(u.start, v.start, 0.0) - linear * corner;
    let map = DAffine3::from_mat3_translation(linear, shift);
    Some(curve.transformed(&map).flattened())
}
