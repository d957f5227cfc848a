//! The production method: subdivision until Newton's iteration is proven to be safe.
//!
//! A cell knows how far its derivatives stray from those in its middle. Where that is little,
//! as seen along the ray, there is at most one root, and clamped iteration finds it or proves
//! that there is none. Everything else is subdivided until the same holds or the cell is
//! excluded ([`super::subdivide`]). So no root is lost and none is invented, whatever the
//! start.

use glam::DVec4;

use super::net;
use super::subdivide::Subdivide;
use super::{Intersector, Root, Scratch, Target};
use crate::simd::{Portable, Singles};

/// See the module.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Newton;

/// Deviation from the identity below which a cell is left to the iteration. One is enough for
/// the proof that there is at most one root; less bounds the number of steps.
pub(crate) const UNIQUE: f64 = 0.85;

/// A Jacobian with a relative determinant below this is not inverted.
const SINGULAR: f64 = 1e-12;

/// Cells are entered this much beyond their borders, in units of half the cell, so that
/// roots on common borders are not lost; what is found twice is merged later.
pub(super) const WIDENED: f64 = 1.0 + 1e-9;

/// Places in a piece that rounding hides more of are looked for with twice the precision.
pub(super) const BLUR: f64 = 1e-10;

/// Steps of the iteration. Newton's own need six; who needs more is better cut in two.
pub(super) const STEPS: usize = 12;

impl Intersector for Newton {
    const NAME: &'static str = "newton";
    const SUMMARY: &'static str =
        "hull exclusion, uniqueness test and clamped Newton, else split: complete";

    #[inline(always)]
    fn roots(scratch: &mut Scratch, target: &Target<'_>) {
        scratch.roots.clear();
        if target.stray < UNIQUE {
            scratch.cells += 1;
            match only_root(target) {
                Decision::Root(root) => return scratch.roots.push(root),
                Decision::None => return,
                Decision::Open => {}
            }
        }
        Portable.apart(Subdivide(scratch, target));
    }
}

/// What clamped iteration says of a cell with at most one root.
enum Decision {
    None,
    Root(Root),
    /// It was too slow to tell.
    Open,
}

impl From<Option<Root>> for Decision {
    fn from(root: Option<Root>) -> Self {
        root.map_or(Self::None, Self::Root)
    }
}

/// The root of a cell that strays little from its frame, as seen along the line; `None` if
/// there is none.
///
/// With `G(x) = x + rest(x)` and a rest that contracts by `q`, the root lies within
/// `q / (1 - q) |G(x)|` of `x - G(x)`. So a cell without a root is often left after the first
/// step. Newton's step is taken while it halves the residual, else `x - G(x)`.
#[inline(always)]
fn only_root(target: &Target<'_>) -> Decision {
    let Target {
        piece,
        line,
        cell,
        rows,
        ..
    } = target;
    let along = rows.map(|row| row.dot(line.direction));
    let (g1, g2) = (along[0] / along[2], along[1] / along[2]);
    // Rows of the map from space to the cell, along the line.
    let (row1, row2) = (rows[0] - rows[2] * g1, rows[1] - rows[2] * g2);
    let slack = line.slack * row1.abs().element_sum().max(row2.abs().element_sum());
    let (half_u, half_v) = ((cell.u.1 - cell.u.0) * 0.5, (cell.v.1 - cell.v.0) * 0.5);
    let (middle_u, middle_v) = (cell.u.0 + half_u, cell.v.0 + half_v);
    let reach = target.stray / (1.0 - target.stray);
    let clamp = |x: f64| x.clamp(-WIDENED, WIDENED);
    // Distances are weighted with the weight over that in the middle: the bound is for those.
    let scale = net::evaluate_at(piece, middle_u, middle_v)[0].w.recip();
    let (row1, row2) = (row1 * scale, row2 * scale);
    let (offset1, offset2) = (row1.dot(line.origin), row2.dot(line.origin));
    let (mut x, mut y) = (clamp(target.start[0]), clamp(target.start[1]));
    let mut before = f64::INFINITY;
    let mut chord = (x, y);
    let mut certain = false;
    for _ in 0..STEPS {
        let [h, hu, hv] = net::evaluate_at(piece, middle_u + half_u * x, middle_v + half_v * y);
        let distances = |h: DVec4| {
            let x = h.truncate();
            (row1.dot(x) - offset1 * h.w, row2.dot(x) - offset2 * h.w)
        };
        let (f1, f2) = distances(h);
        let residual = f1.abs().max(f2.abs());
        let target_1 = x - f1;
        let target_2 = y - f2;
        if target_1.abs().max(target_2.abs()) > WIDENED + reach * residual + slack {
            return Decision::None;
        }
        if residual > 0.5 * before && !certain {
            // Newton did not help: go on from where it started with the sure step.
            (x, y) = chord;
            certain = true;
            continue;
        }
        if residual <= slack {
            let margin = 1e-12 + 4.0 * slack * half_u.max(half_v);
            return within(
                middle_u + half_u * (x - f1),
                middle_v + half_v * (y - f2),
                margin,
            )
            .into();
        }
        (before, chord, certain) = (residual, (clamp(target_1), clamp(target_2)), false);
        let (f1u, f2u) = distances(hu * half_u);
        let (f1v, f2v) = distances(hv * half_v);
        let jacobian = [f1u, f1v, f2u, f2v];
        let mut next = Inverse::of(jacobian).map_or(chord, |Inverse([a, b, c, d])| {
            (clamp(x - (a * f1 + b * f2)), clamp(y - (c * f1 + d * f2)))
        });
        let stays = |next: (f64, f64)| (next.0 - x).abs().max((next.1 - y).abs()) < 1e-15;
        if stays(next) {
            // Where Newton's step stands still on the border only the sure step is a proof.
            (next, certain) = (chord, true);
        }
        if stays(next) {
            // Settled on the border, or as near to a root as rounding lets it come.
            let settled = residual <= 4.0 * slack + 1e-12;
            let margin = 1e-12 + 4.0 * slack * half_u.max(half_v);
            let place = (middle_u + half_u * x, middle_v + half_v * y);
            return settled
                .then(|| within(place.0, place.1, margin))
                .flatten()
                .into();
        }
        (x, y) = next;
    }
    Decision::Open
}

/// A proven root, unless it lies outside the piece by more than its error.
#[inline(always)]
pub(super) fn within(u: f64, v: f64, margin: f64) -> Option<Root> {
    let inside = |x: f64| (-margin..=1.0 + margin).contains(&x);
    (inside(u) && inside(v)).then(|| Root {
        u: u.clamp(0.0, 1.0),
        v: v.clamp(0.0, 1.0),
        tangential: false,
        blurred: margin > BLUR,
        flat: false,
    })
}

/// The inverse of a 2 x 2 matrix, row by row.
pub(super) struct Inverse(pub(super) [f64; 4]);

impl Inverse {
    pub(super) fn of([a, b, c, d]: [f64; 4]) -> Option<Self> {
        let determinant = a * d - b * c;
        let size = a.abs() + b.abs() + c.abs() + d.abs();
        (determinant.abs() > SINGULAR * size * size)
            .then(|| Self([d, -b, -c, a].map(|x| x / determinant)))
    }

    /// The largest sum of a row.
    pub(super) fn norm(&self) -> f64 {
        let [a, b, c, d] = self.0;
        (a.abs() + b.abs()).max(c.abs() + d.abs())
    }
}
