//! Surfaces of control points, and matrices, as parameters of entities.

use glam::{DAffine3, DMat3, DVec3};
use kernel::{KnotVector, Surface};

use super::curves::{Geometry, expanded, implied, number_rows, reference_rows};
use super::values::Record;
use crate::Problem;
use crate::iges::Fields;

/// The parameters of a B-spline or Bézier surface as an entity; `None` if the record is none.
pub(super) fn spline(
    geometry: Geometry<'_>,
    record: &Record<'_>,
) -> Result<Option<Fields>, Problem> {
    let named = |name: &str| record.part(name).filter(|_| record.parts.len() > 1);
    let (at, first) = match named("B_SPLINE_SURFACE") {
        Some(at) => (at, 0),
        None => (record.attributes(), 1),
    };
    let names = [
        "B_SPLINE_SURFACE_WITH_KNOTS",
        "QUASI_UNIFORM_SURFACE",
        "UNIFORM_SURFACE",
        "BEZIER_SURFACE",
    ];
    let Some(name) = names.iter().find(|name| record.part(name).is_some()) else {
        return Ok(None);
    };
    let degrees = [at.count(first)?, at.count(first + 1)?];
    let rows = reference_rows(at.list(first + 2)?)?;
    let counts = [rows.len(), rows[0].len()];
    if counts[0].saturating_mul(counts[1]) > geometry.limit {
        let [u, v] = counts;
        let text = format!("{u} times {v} points; the limit is {}", geometry.limit);
        return Err(Problem::TooLarge(text));
    }
    let knots = |axis: usize| -> Result<Vec<f64>, Problem> {
        if *name != names[0] {
            return implied(name, degrees[axis], counts[axis]);
        }
        let (at, first) = match named(name) {
            Some(at) => (at, 0),
            None => (record.attributes(), 8),
        };
        expanded(
            at,
            [first + axis, first + 2 + axis],
            degrees[axis],
            counts[axis],
        )
    };
    let knots = [knots(0)?, knots(1)?];
    let weights = match named("RATIONAL_B_SPLINE_SURFACE") {
        None => None,
        Some(at) => {
            let weights = number_rows(at.list(0)?)?;
            if [weights.len(), weights[0].len()] != counts {
                let text = "there are not as many weights as points";
                return Err(Problem::Invalid(text.to_owned()));
            }
            Some(weights)
        }
    };
    // Rows are along the first parameter, which runs fastest there.
    let order = || (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| (i, j)));
    let mut points = Vec::new();
    for (i, j) in order() {
        points.push(geometry.point(rows[i][j])?);
    }
    let weight = |(i, j): (usize, usize)| weights.as_ref().map_or(1.0, |rows| rows[i][j]);
    let weights: Vec<f64> = order().map(weight).collect();
    Ok(Some(entity(degrees, counts, &knots, &weights, &points)))
}

/// The parameters of a surface (type 128); points run fastest along the first parameter.
fn entity(
    degrees: [usize; 2],
    counts: [usize; 2],
    knots: &[Vec<f64>; 2],
    weights: &[f64],
    points: &[DVec3],
) -> Fields {
    let end = |axis: usize, at: usize| knots[axis].get(at).copied().unwrap_or_default();
    let domain = |axis: usize| [end(axis, degrees[axis]), end(axis, counts[axis])];
    Fields::new(128)
        .count(counts[0] - 1)
        .count(counts[1] - 1)
        .count(degrees[0])
        .count(degrees[1])
        .integers([0; 5])
        .reals(knots.iter().flatten().copied())
        .reals(weights.iter().copied())
        .reals(points.iter().flat_map(|point| point.to_array()))
        .reals(domain(0))
        .reals(domain(1))
}

/// The parameters of a surface that is there already.
pub(super) fn of_surface(surface: &Surface) -> Fields {
    let turned = surface.transposed();
    let axis = |knots: &KnotVector| (knots.degree(), knots.count(), knots.as_slice().to_vec());
    let [u, v] = [surface.knots_u(), surface.knots_v()].map(axis);
    let weights: Vec<f64> = turned.weights().collect();
    let points: Vec<DVec3> = turned.points().collect();
    entity([u.0, v.0], [u.1, v.1], &[u.2, v.2], &weights, &points)
}

/// The matrix of a map, row by row, as the parameters of a transformation (type 124).
pub(super) fn matrix(map: &DAffine3) -> Fields {
    let DAffine3 {
        matrix3,
        translation,
    } = map;
    let rows = (0..3).flat_map(|row| {
        let DMat3 {
            x_axis,
            y_axis,
            z_axis,
        } = *matrix3;
        [x_axis[row], y_axis[row], z_axis[row], translation[row]]
    });
    Fields::new(124).reals(rows)
}
