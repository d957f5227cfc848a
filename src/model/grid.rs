//! Surfaces through grids of points.

use formats::{Error, Layer, Warnings};
use glam::DVec3;
use kernel::modelling::{Along, coons, interpolate};
use kernel::{Aabb, Patch};

use super::{About, ModelMethod, ModelOptions, closed, distinct, middle};

/// The faces of a body of which the layers are rows of a grid.
pub(super) fn faces(
    layers: &[Layer],
    about: &About<'_>,
    options: &ModelOptions,
    warnings: &mut Warnings,
) -> Result<Vec<Patch>, Error> {
    let mut rows = layers.to_vec();
    for row in &mut rows {
        // All points of a row may be one: a pole.
        if Aabb::around(row.points.iter().copied()).diagonal() > 0.0 {
            // Columns belong together: a point less would move all after it.
            distinct(row, options.closed[0], about, false, warnings)?;
        } else if options.closed[0] && row.points.len() > 1 {
            let full = layers.iter().map(|row| row.points.len()).max();
            if full == Some(row.points.len()) && repeats(layers) {
                row.points.pop();
            }
        }
    }
    let [first, ..] = rows.as_slice() else {
        return Ok(Vec::new());
    };
    for (number, row) in (1..).zip(&rows) {
        let (found, wanted) = (row.points.len(), first.points.len());
        if found != wanted {
            let text =
                format!("row {number} of the grid has {found} points; the first one has {wanted}");
            return Err(about.error(&row.place, text));
        }
    }
    for pair in rows.windows(2) {
        if pair[0].points == pair[1].points {
            let text = "the row is the same as the one before";
            return Err(about.error(&pair[1].place, text));
        }
    }
    if let ModelMethod::Interpolate([along, up]) = options.method {
        let sizes = [
            (along, first.points.len(), "points in a row", "along rows"),
            (up, rows.len(), "rows", "across them"),
        ];
        for (
            Along {
                degree, is_closed, ..
            },
            found,
            what,
            way,
        ) in sizes
        {
            if !is_closed && found <= degree {
                let needed = degree + 1;
                let text = format!(
                    "{found} {what}; degree {degree} {way} needs {needed}, a smaller degree fewer"
                );
                return Err(about.error(&first.place, text));
            }
        }
    }
    let points: Vec<DVec3> = rows.iter().flat_map(|row| row.points.clone()).collect();
    let [around, across] = options.closed;
    let surface = match options.method {
        ModelMethod::Interpolate([along, up]) => {
            interpolate(&points, rows.len(), [up, along]).map(|found| found.surface)
        }
        ModelMethod::Coons(twist) => coons(&points, rows.len(), [across, around], twist),
        _ => return Ok(Vec::new()),
    };
    // u around and v from row to row.
    let surface = surface.map_err(|error| about.geometry(error))?.transposed();
    if across || !around {
        return Ok(vec![surface.into()]);
    }
    let last = rows.len() - 1;
    let upwards = middle(&rows[last].points) - middle(&rows[0].points);
    let area: DVec3 = rows.iter().map(|row| area(&row.points)).sum();
    let surface = if area.dot(upwards) < 0.0 {
        surface.reversed_u()
    } else {
        surface
    };
    let rise = |a: usize, b: usize| middle(&rows[a].points).distance(middle(&rows[b].points));
    let rises = [rise(0, 1), rise(last, last - 1)];
    closed(vec![surface], options.caps, rises).map_err(|error| about.geometry(error))
}

/// Whether rows end with the point they begin with.
fn repeats(layers: &[Layer]) -> bool {
    layers
        .iter()
        .all(|row| row.points.first() == row.points.last())
}

fn area(points: &[DVec3]) -> DVec3 {
    let turns = points
        .windows(2)
        .map(|w| (w[0] - points[0]).cross(w[1] - points[0]));
    turns.sum()
}
