//! Flattening: cutting surfaces by their curvature until their parts are nearly flat
//! \[Martin 2000, section 2\].

use glam::{DVec2, DVec3};
use kernel::{Aabb, KnotVector, Surface};

use super::boxes::{Boxes, Rule};
use super::world::{Piece, World};
use crate::intersect::net::restrict;

/// The constant of the paper times the square root of the scene's size: the formula gives the
/// root of a length. A quarter of a circle as large as the scene is cut into about this many
/// times 1.5 parts.
const FINENESS: f64 = 10.0;

/// Parts of a span, at most.
const MOST: f64 = 64.0;

/// Parts of all surfaces with a hierarchy over their boxes.
#[derive(Debug)]
pub(super) struct Leaves {
    pub(super) boxes: Boxes,
    pub(super) parts: Vec<Part>,
}

/// A rectangle of a sheet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) sheet: u32,
    /// Where to begin: the middle.
    pub(super) middle: DVec2,
}

impl Leaves {
    pub(super) fn build(world: &World, rule: Rule) -> Self {
        let all = world
            .pieces
            .iter()
            .fold(Aabb::EMPTY, |b, p| b.union(p.bounds));
        let size = all.diagonal();
        let constant = if size > 0.0 {
            FINENESS / size.sqrt()
        } else {
            0.0
        };
        let (mut parts, mut boxes) = (Vec::new(), Vec::new());
        let mut pieces = world.pieces.iter();
        for sheet in &world.sheets {
            let counts_u = span_counts(&sheet.surface, constant);
            let counts_v = span_counts(&sheet.surface.transposed(), constant);
            // Pieces come with v running fastest.
            for &m in &counts_u {
                for (&n, piece) in counts_v.iter().zip(pieces.by_ref()) {
                    cut(world, piece, [m, n], &mut parts, &mut boxes);
                }
            }
        }
        Self {
            boxes: Boxes::build(&boxes, rule),
            parts,
        }
    }
}

/// Cuts a piece evenly, and appends the parts with boxes around their nets.
fn cut(
    world: &World,
    piece: &Piece,
    [m, n]: [usize; 2],
    parts: &mut Vec<Part>,
    boxes: &mut Vec<Aabb>,
) {
    let share = |k: usize, n: usize| k as f64 / n as f64;
    let mut spare = world.net(piece).to_vec();
    for i in 0..m {
        for j in 0..n {
            let mut net = world.net(piece).to_vec();
            let (u, v) = (
                (share(i, m), share(i + 1, m)),
                (share(j, n), share(j + 1, n)),
            );
            restrict(&mut net, &mut spare, piece.degrees, u, v);
            boxes.push(Aabb::around(
                net.iter().map(|h| DVec3::new(h[0], h[1], h[2]) / h[3]),
            ));
            let middle = DVec2::new(u.0 + u.1, v.0 + v.1) * 0.5;
            parts.push(Part {
                sheet: piece.sheet,
                middle: piece.global(middle),
            });
        }
    }
}

/// Into how many parts each span along u is cut: the most that a row of control points wants.
pub(super) fn span_counts(surface: &Surface, constant: f64) -> Vec<usize> {
    let knots = surface.knots_u();
    let points: Vec<_> = surface.points().collect();
    let row = points.len() / knots.count();
    let columns: Vec<Vec<_>> = (0..row)
        .map(|j| points.iter().skip(j).step_by(row).copied().collect())
        .collect();
    let spans =
        (knots.degree()..knots.count()).filter(|&i| knots.as_slice()[i] < knots.as_slice()[i + 1]);
    spans
        .map(|i| {
            let wanted = columns.iter().map(|column| measure(knots, column, i));
            let most = constant * wanted.fold(0.0, f64::max);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between 1 and MOST"
            )]
            let count = most.ceil().clamp(1.0, MOST) as usize;
            count
        })
        .collect()
}

/// Greatest curvature times length to the power of three halves over span `i` of a curve, from
/// the differences of its control points; weights are left out, as in the paper.
fn measure(knots: &KnotVector, points: &[DVec3], i: usize) -> f64 {
    let (k, t) = (knots.degree() + 1, knots.as_slice());
    let order = k as f64;
    let quotient = |difference: DVec3, wide: f64| {
        if wide > 0.0 {
            difference / wide
        } else {
            DVec3::ZERO
        }
    };
    let velocity = |j: usize| {
        quotient(
            (points[j] - points[j - 1]) * (order - 1.0),
            t[j + k - 1] - t[j],
        )
    };
    let acceleration = |j: usize| {
        quotient(
            (velocity(j) - velocity(j - 1)) * (order - 2.0),
            t[j + k - 2] - t[j],
        )
    };
    let bend = (i + 3 - k.min(i + 3)..=i)
        .filter(|&j| j >= 2)
        .map(|j| acceleration(j).length())
        .fold(0.0, f64::max);
    let speeds = (i + 2 - k.min(i + 2)..=i).filter(|&j| j >= 1);
    let speed = speeds.map(|j| velocity(j).length()).sum::<f64>() / (order - 1.0);
    if speed > 0.0 {
        bend * (t[i + 1] - t[i]).powf(1.5) / speed.sqrt()
    } else {
        0.0
    }
}
