//! Weights with which double precision does not tell the points of a surface apart by their
//! parameters.

use kernel::{KnotVector, Scene, Surface};

use crate::{Place, Warnings};

/// Weights of a piece that differ by more than this leave no hit within 1e-9 of the size.
const UNEVEN: f64 = 1e7;

/// Notes the surfaces of which the weights differ so much.
pub(crate) fn tell(scene: &Scene, warnings: &mut Warnings) {
    for patch in scene.patches() {
        let ratio = ratio(&patch.surface);
        if ratio > UNEVEN {
            let text = format!(
                "weights beside each other differ by a factor of {ratio:.0e}, of at most {UNEVEN:.0e} that \
                 double precision can follow: what is hit may be off by {:.0e} of the size",
                (ratio * f64::EPSILON).min(1.0)
            );
            warnings.invalid(Place::item(0, &patch.source), text);
        }
    }
}

/// The largest ratio of two weights of one piece, if it is larger than [`UNEVEN`].
fn ratio(surface: &Surface) -> f64 {
    let weights: Vec<f64> = surface.weights().collect();
    if spread(weights.iter()) <= UNEVEN {
        return 1.0;
    }
    let row = surface.knots_v().count();
    let windows = windows(surface.knots_u());
    let pieces =
        windows.flat_map(|i| self::windows(surface.knots_v()).map(move |j| (i.clone(), j)));
    let ratios = pieces.map(|(rows, columns)| {
        let rows = rows.map(|i| &weights[i * row..][..row]);
        spread(rows.flat_map(|row| &row[columns.clone()]))
    });
    ratios.fold(1.0, f64::max)
}

/// The control points of each span that has a length.
fn windows(knots: &KnotVector) -> impl Iterator<Item = std::ops::Range<usize>> {
    let (degree, list) = (knots.degree(), knots.as_slice());
    let spans = (degree..knots.count()).filter(|&k| list[k] < list[k + 1]);
    spans.map(move |k| k - degree..k + 1)
}

/// The largest of numbers over the smallest.
fn spread<'a>(weights: impl Iterator<Item = &'a f64>) -> f64 {
    let (least, most) = weights.fold((f64::INFINITY, 0.0_f64), |(least, most), w| {
        (w.min(least), w.max(most))
    });
    most / least
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn weights_count_where_they_are_of_one_piece() {
        let line = |weights: [f64; 5]| {
            let knots = [
                KnotVector::clamped_uniform(1, 5, 0.0..4.0),
                KnotVector::bezier(1, 0.0..1.0),
            ];
            let [u, v] = knots.map(Result::unwrap);
            let point = |k: u32| DVec3::new(f64::from(k / 2), f64::from(k % 2), 0.0);
            let points: Vec<DVec3> = (0..10).map(point).collect();
            let weights: Vec<f64> = weights.iter().flat_map(|w| [*w; 2]).collect();
            ratio(&Surface::new(u, v, &points, Some(&weights)).unwrap())
        };
        // Between neighbours 1e5, from end to end 1e20.
        assert!(line([1e-10, 1e-5, 1.0, 1e5, 1e10]) < 1.1e5);
        let far = line([1.0, 1.0, 1e8, 1.0, 1.0]);
        assert!((far - 1e8).abs() < 1.0, "{far}");
        assert!((line([2.0; 5]) - 1.0).abs() < 1e-12);
    }
}
