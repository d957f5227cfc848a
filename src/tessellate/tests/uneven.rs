//! Parameters that run unevenly cost few triangles more.

use super::round::{assert_near, made};
use kernel::KnotVector;

use super::*;

/// A wave over knots along u and others along v, with points as far apart everywhere.
fn wave(knots: [Vec<f64>; 2], weight: impl Fn(DVec2) -> f64) -> Patch {
    let degree = 3;
    let counts = knots.each_ref().map(|knots| knots.len() - degree - 1);
    let share = |k: usize, axis: usize| k as f64 / (counts[axis] - 1) as f64;
    let places = (0..counts[0]).flat_map(|i| (0..counts[1]).map(move |j| (i, j)));
    let places: Vec<_> = places
        .map(|(i, j)| DVec2::new(share(i, 0), share(j, 1)))
        .collect();
    let height = |at: &DVec2| 0.3 * (5.0 * at.x).sin() * (4.0 * at.y).cos();
    let points: Vec<_> = places.iter().map(|at| at.extend(height(at))).collect();
    let weights: Vec<_> = places.iter().map(|at| weight(*at)).collect();
    let [u, v] = knots.map(|knots| KnotVector::new(degree, knots).unwrap());
    Patch::from(Surface::new(u, v, &points, Some(&weights)).unwrap())
}

/// Knots of these spans, with ends as often as there are points to a piece.
fn knots(spans: &[f64]) -> Vec<f64> {
    let ends = spans.iter().scan(0.0, |end, span| {
        *end += span;
        Some(*end)
    });
    let mut knots = vec![0.0; 4];
    knots.extend(ends);
    let last = knots[knots.len() - 1];
    knots.extend([last; 3]);
    knots
}

#[test]
fn short_spans_that_cover_as_much_cost_few_triangles_more() {
    let made_of = |short: f64| {
        let spans = [[1.0, short], [short, 1.0]].concat();
        let patch = wave([knots(&spans), knots(&[1.0, 1.0])], |_| 1.0);
        let (face, count) = made(&patch, 2e-3);
        assert_near(&face, &patch, 2e-3);
        count
    };
    let even = made_of(1.0);
    for (short, most) in [(0.1, 3), (1e-3, 8), (1e-5, 14)] {
        let count = made_of(short);
        assert!(count < most * even, "{short}: {count}, {even}");
    }
}

#[test]
fn weights_far_apart_cost_few_triangles_more() {
    let middle = DVec2::new(0.5, 0.5);
    for place in [DVec2::ZERO, DVec2::new(0.5, 0.0), middle] {
        let made_of = |heavy: f64| {
            let weight = |at: DVec2| if at.distance(place) < 0.3 { heavy } else { 1.0 };
            let patch = wave([knots(&[1.0]), knots(&[1.0, 1.0])], weight);
            let (face, count) = made(&patch, 5e-3);
            assert_near(&face, &patch, 5e-3);
            count
        };
        let even = made_of(1.0);
        for (heavy, most) in [(10.0, 8), (1e3, 25), (1e5, 50)] {
            let count = made_of(heavy);
            assert!(count < most * even, "{place} {heavy}: {count}, {even}");
        }
    }
}
