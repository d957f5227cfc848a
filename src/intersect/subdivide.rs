//! All roots of a cell, whatever it looks like.
//!
//! The distances of a piece from two planes through the ray form a planar net. A part is
//! dropped when the hull of its net, or of the net preconditioned with the inverse of the
//! Jacobian in its middle, does not contain zero. When the derivatives of the preconditioned
//! net stray from the identity by less than one there is at most one root, and clamped
//! iteration finds it or proves that there is none. Otherwise the part is split.

use glam::{DVec2, DVec3};

use super::edge::edge_roots;
use super::net::{self, Degrees, bernstein};
use super::newton::{Inverse, STEPS, UNIQUE, WIDENED, within};
use super::tangent::{Contact, contact, distances};
use super::{Line, PieceNet, Rect, Root, Scratch, Target};
use crate::simd::{Part, Simd};

/// A Jacobian whose inverse blows up the rounding errors to this part of a cell is taken for
/// singular.
const BLURRED: f64 = 1e-3;

/// A cell whose distances vary by less than this many slacks cannot be resolved further.
const UNRESOLVED: f64 = 16.0;

/// An unresolved cell that is longer than this is one along which the ray runs.
const THIN: f64 = 1e-4;

/// After this many cells of one call arcs are looked for, and after as many more the wanted resolution is
/// relaxed step by step: a ray that runs along a curved surface would otherwise be followed to
/// the last bit.
const PATIENCE: u32 = 2000;

/// Appends all roots of a cell to those of the scratch, by subdivision.
pub(crate) struct Subdivide<'a>(pub(crate) &'a mut Scratch, pub(crate) &'a Target<'a>);

impl<S: Simd> Part<S> for Subdivide<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, _: S) {
        let Self(scratch, target) = self;
        let cubic = Degrees { p: 3, q: 3 };
        if target.piece.degrees == cubic {
            // As below, with a number of turns that is known.
            subdivide(scratch, target, cubic);
        } else {
            subdivide(scratch, target, target.piece.degrees);
        }
    }
}

#[inline(always)]
fn subdivide(scratch: &mut Scratch, target: &Target<'_>, degrees: Degrees) {
    let (piece, line) = (&target.piece, &target.line);
    let size = degrees.len();
    start(scratch, (piece, degrees), line, &target.cell);
    let (half_u, half_v) = (&net::HALF[degrees.p], &net::HALF[degrees.q]);
    let before = scratch.roots.len();
    let (mut visited, mut is_along) = (0, false);
    while let Some(rect) = pop(scratch, size) {
        visited += 1;
        if visited == PATIENCE && !is_along {
            // All anew, along the arcs that took so long.
            scratch.cells += u64::from(visited);
            (visited, is_along) = (0, true);
            scratch.roots.truncate(before);
            scratch.arcs.clear();
            start(scratch, (piece, degrees), line, &target.cell);
            continue;
        }
        let (d1, d2) = scratch.net.split_at(size);
        let slack = line.slack;
        let (box1, box2) = (net::range(d1), net::range(d2));
        if excludes(box1, slack) || excludes(box2, slack) {
            continue;
        }
        // Relax from the rounding errors towards the accuracy that is promised.
        let unresolved = UNRESOLVED * slack * f64::from(1 + visited / PATIENCE).powi(4);
        if (box1.1 - box1.0).max(box2.1 - box2.0) <= unresolved {
            unresolved_roots(&mut scratch.roots, target, rect);
            continue;
        }
        let [_, d1u, d1v] = net::evaluate(d1, degrees, half_u, half_v);
        let [_, d2u, d2v] = net::evaluate(d2, degrees, half_u, half_v);
        let jacobian = [d1u * 0.5, d1v * 0.5, d2u * 0.5, d2v * 0.5];
        let verdict = match Inverse::of(jacobian).filter(|i| slack * i.norm() < BLURRED) {
            Some(inverse) => examine(&mut scratch.spare, &scratch.net, degrees, &inverse, slack),
            None => {
                let Scratch {
                    net, spare, roots, ..
                } = &mut *scratch;
                examine_flat(spare, net, degrees, jacobian, slack, rect, roots)
            }
        };
        match verdict {
            Verdict::Empty => {}
            Verdict::One(x, y) => {
                let middle = |(a, b): (f64, f64), x: f64| a + (b - a) * 0.5 * (x + 1.0);
                let near = (middle(rect.u, x), middle(rect.v, y));
                let room = ((rect.u.1 - rect.u.0), (rect.v.1 - rect.v.0));
                scratch.roots.extend(polish(piece, line, near, room));
            }
            Verdict::Split if is_along && follow(scratch, degrees, jacobian, slack, rect) => {}
            Verdict::Split => split(scratch, rect, degrees),
        }
    }
    if is_along {
        let Scratch { arcs, roots, .. } = &mut *scratch;
        arcs.finish(roots);
    }
    scratch.cells += u64::from(visited);
}

/// What is known about a cell.
enum Verdict {
    /// It holds no root (any more).
    Empty,
    /// It holds exactly one, here, in coordinates from -1 to 1.
    One(f64, f64),
    /// It must be split.
    Split,
}

#[inline(always)]
fn excludes((min, max): (f64, f64), slack: f64) -> bool {
    min > slack || max < -slack
}

/// Puts the distance nets of the cell on the empty stack.
#[inline(always)]
fn start(
    scratch: &mut Scratch,
    (piece, degrees): (&PieceNet<'_>, Degrees),
    line: &Line,
    cell: &Rect,
) {
    let size = degrees.len();
    let Scratch {
        stack, net, spare, ..
    } = scratch;
    stack.clear();
    net.clear();
    spare.clear();
    spare.resize(2 * size, 0.0);
    for (e, c) in [(line.e1, line.c1), (line.e2, line.c2)] {
        let distance = |[x, y, z, w]: &[f64; 4]| e.x * x + e.y * y + e.z * z - c * w;
        net.extend(piece.points.iter().map(distance));
    }
    let (d1, d2) = net.split_at_mut(size);
    net::restrict(d1, &mut spare[..size], degrees, cell.u, cell.v);
    net::restrict(d2, &mut spare[..size], degrees, cell.u, cell.v);
    stack.extend_from_slice(net);
    stack.extend([cell.u.0, cell.u.1, cell.v.0, cell.v.1]);
}

/// Moves the top of the stack to `scratch.net`.
#[inline(always)]
fn pop(scratch: &mut Scratch, size: usize) -> Option<Rect> {
    let rest = scratch.stack.len().checked_sub(2 * size + 4)?;
    let frame = &scratch.stack[rest..];
    scratch.net.copy_from_slice(&frame[..2 * size]);
    let [u0, u1, v0, v1] = [0, 1, 2, 3].map(|k| frame[2 * size + k]);
    scratch.stack.truncate(rest);
    Some(Rect {
        u: (u0, u1),
        v: (v0, v1),
    })
}

/// Pushes both halves of the cell, cut across the direction of the larger variation.
#[inline(always)]
fn split(scratch: &mut Scratch, rect: Rect, degrees: Degrees) {
    let size = degrees.len();
    let Scratch { stack, net, .. } = scratch;
    let (d1, d2) = net.split_at(size);
    let (u1, v1) = net::variation(d1, degrees);
    let (u2, v2) = net::variation(d2, degrees);
    let across_u = u1.max(u2) >= v1.max(v2);
    let base = stack.len();
    let frame = 2 * size + 4;
    let middle = |(a, b): (f64, f64)| f64::midpoint(a, b);
    let (first, second) = if across_u {
        let m = middle(rect.u);
        (
            Rect {
                u: (rect.u.0, m),
                ..rect
            },
            Rect {
                u: (m, rect.u.1),
                ..rect
            },
        )
    } else {
        let m = middle(rect.v);
        (
            Rect {
                v: (rect.v.0, m),
                ..rect
            },
            Rect {
                v: (m, rect.v.1),
                ..rect
            },
        )
    };
    for rect in [first, second] {
        stack.extend_from_slice(net);
        stack.extend([rect.u.0, rect.u.1, rect.v.0, rect.v.1]);
    }
    let (left, right) = stack[base..].split_at_mut(frame);
    for k in [0, size] {
        let (left, right) = (&mut left[k..k + size], &mut right[k..k + size]);
        if across_u {
            net::split_u(left, right, degrees, 0.5);
        } else {
            net::split_v(left, right, degrees, 0.5);
        }
    }
}

/// Exclusion, uniqueness and iteration on the preconditioned net of a regular cell.
#[inline(always)]
fn examine(
    spare: &mut [f64],
    net: &[f64],
    degrees: Degrees,
    inverse: &Inverse,
    slack: f64,
) -> Verdict {
    let size = degrees.len();
    let [a, b, c, d] = inverse.0;
    let (d1, d2) = net.split_at(size);
    let (g1, g2) = spare.split_at_mut(size);
    for (((g1, g2), d1), d2) in g1.iter_mut().zip(g2.iter_mut()).zip(d1).zip(d2) {
        (*g1, *g2) = (a * d1 + b * d2, c * d1 + d * d2);
    }
    let slack = slack * inverse.norm();
    if excludes(net::range(g1), slack) || excludes(net::range(g2), slack) {
        return Verdict::Empty;
    }
    // The local parameter runs over a length of two: derivatives count half.
    let stray1 = net::deviation(g1, degrees, 2.0, 0.0) * 0.5;
    let stray2 = net::deviation(g2, degrees, 0.0, 2.0) * 0.5;
    if stray1.max(stray2) >= UNIQUE {
        return Verdict::Split;
    }
    iterate(g1, g2, degrees, slack)
}

/// Clamped iteration on a cell that holds at most one root.
///
/// Newton's step is taken while it halves the residual; the chord step `x - G(x)` contracts
/// by the deviation in any case. A border point where the residual stays is no root, and then
/// there is none: it would have attracted the iteration.
#[inline(always)]
fn iterate(g1: &[f64], g2: &[f64], degrees: Degrees, slack: f64) -> Verdict {
    let at = |x: f64, y: f64| both(g1, g2, degrees, x, y);
    let clamp = |x: f64| x.clamp(-WIDENED, WIDENED);
    let (mut x, mut y) = (0.0_f64, 0.0_f64);
    let (mut f1, mut f2) = at(x, y);
    for _ in 0..STEPS {
        let residual = f1[0].abs().max(f2[0].abs());
        if residual <= slack {
            return Verdict::One(x, y);
        }
        let (mut nx, mut ny) = (clamp(x - f1[0]), clamp(y - f2[0]));
        let mut next = None;
        if let Some(Inverse([a, b, c, d])) =
            Inverse::of([f1[1] * 0.5, f1[2] * 0.5, f2[1] * 0.5, f2[2] * 0.5])
        {
            let tx = clamp(x - (a * f1[0] + b * f2[0]));
            let ty = clamp(y - (c * f1[0] + d * f2[0]));
            let (t1, t2) = at(tx, ty);
            if t1[0].abs().max(t2[0].abs()) < 0.5 * residual {
                (nx, ny, next) = (tx, ty, Some((t1, t2)));
            }
        }
        let moved = (nx - x).abs().max((ny - y).abs());
        (x, y) = (nx, ny);
        (f1, f2) = match next {
            Some(next) => next,
            None => at(x, y),
        };
        if moved < 1e-15 {
            // Settled: a root within the widened cell leaves no more than rounding errors.
            let settled = f1[0].abs().max(f2[0].abs()) <= 4.0 * slack + 1e-12;
            return if settled {
                Verdict::One(x, y)
            } else {
                Verdict::Empty
            };
        }
    }
    Verdict::Split
}

/// Two nets and their derivatives at a place, in coordinates from -1 to 1.
#[inline(always)]
fn both(g1: &[f64], g2: &[f64], degrees: Degrees, x: f64, y: f64) -> ([f64; 3], [f64; 3]) {
    let u = bernstein(degrees.p, 0.5 * (x + 1.0));
    let v = bernstein(degrees.q, 0.5 * (y + 1.0));
    (
        net::evaluate(g1, degrees, &u, &v),
        net::evaluate(g2, degrees, &u, &v),
    )
}

/// The nets of distances from planes that are turned so that the first lies along the larger derivative;
/// `None` where there is none.
#[inline(always)]
fn turned<'s>(
    spare: &'s mut [f64],
    net: &[f64],
    degrees: Degrees,
    [d1u, d1v, d2u, d2v]: [f64; 4],
) -> Option<[&'s [f64]; 2]> {
    let size = degrees.len();
    let (d1, d2) = net.split_at(size);
    let (du, dv) = ((d1u, d2u), (d1v, d2v));
    let square = |(a, b): (f64, f64)| a * a + b * b;
    let along = if square(du) >= square(dv) { du } else { dv };
    let length = square(along).sqrt();
    if length <= f64::MIN_POSITIVE {
        return None;
    }
    let (c, s) = (along.0 / length, along.1 / length);
    let (across, lengthwise) = spare.split_at_mut(size);
    for (((across, lengthwise), d1), d2) in
        across.iter_mut().zip(lengthwise.iter_mut()).zip(d1).zip(d2)
    {
        (*across, *lengthwise) = (c * d2 - s * d1, c * d1 + s * d2);
    }
    Some([lengthwise, across])
}

/// Follows the arc in a cell, if it holds a single one.
#[inline(never)]
fn follow(
    scratch: &mut Scratch,
    degrees: Degrees,
    jacobian: [f64; 4],
    slack: f64,
    rect: Rect,
) -> bool {
    let Scratch {
        net,
        spare,
        roots,
        arcs,
        ..
    } = scratch;
    let planes = turned(spare, net, degrees, jacobian);
    planes.is_some_and(|planes| arcs.follow(planes, degrees, 4.0 * slack, rect, roots))
}

/// A cell on which both derivatives are parallel: the ray is tangential, or the piece is
/// seen from its edge.
#[inline(always)]
fn examine_flat(
    spare: &mut [f64],
    net: &[f64],
    degrees: Degrees,
    jacobian: [f64; 4],
    slack: f64,
    rect: Rect,
    roots: &mut Vec<Root>,
) -> Verdict {
    let Some([lengthwise, across]) = turned(spare, net, degrees, jacobian) else {
        return Verdict::Split;
    };
    let (min, max) = net::range(across);
    let slack = 2.0 * slack;
    if excludes((min, max), slack) || excludes(net::range(lengthwise), slack) {
        return Verdict::Empty;
    }
    if max.max(-min) > slack {
        return Verdict::Split;
    }
    // The whole cell lies in a plane with the ray: it enters and leaves through the edges.
    edge_roots(lengthwise, degrees, slack, rect, roots);
    Verdict::Empty
}

/// Stands for a cell that cannot be resolved: the contact next to it, and its corners if the
/// ray may run along it.
#[inline(never)]
fn unresolved_roots(roots: &mut Vec<Root>, target: &Target<'_>, rect: Rect) {
    let middle = |(a, b): (f64, f64)| f64::midpoint(a, b);
    let root = |u, v| Root {
        u,
        v,
        tangential: true,
        blurred: false,
        flat: false,
    };
    let (thin_u, thin_v) = (rect.u.1 - rect.u.0 < THIN, rect.v.1 - rect.v.0 < THIN);
    if thin_u && thin_v {
        let near = DVec2::new(middle(rect.u), middle(rect.v));
        let (piece, line) = (&target.piece, &target.line);
        match contact(&|at| distances(piece, line, at), near, [line.slack; 2]) {
            Contact::None => {}
            Contact::Roots(found) => roots.extend(found.into_iter().flatten()),
            Contact::Unclear => roots.push(root(near.x, near.y)),
        }
        return;
    }
    let ends = |(a, b): (f64, f64), thin: bool| if thin { [middle((a, b)); 2] } else { [a, b] };
    let (us, vs) = (ends(rect.u, thin_u), ends(rect.v, thin_v));
    roots.extend([root(us[0], vs[0]), root(us[1], vs[1])]);
    if !thin_u && !thin_v {
        roots.extend([root(us[0], vs[1]), root(us[1], vs[0])]);
    }
}

/// Two Newton steps on the whole piece, free of the rounding errors of subdivision.
///
/// `room` is the size of the cell. `None` if the root turns out to lie beyond the border of
/// the piece by more than the errors.
#[inline(always)]
fn polish(piece: &PieceNet<'_>, line: &Line, near: (f64, f64), room: (f64, f64)) -> Option<Root> {
    let (mut u, mut v) = near;
    let mut uncertain = 0.0;
    for _ in 0..2 {
        let point = net::evaluate_at(piece, u, v);
        let distance = |e: DVec3, c: f64| point.map(|x| e.dot(x.truncate()) - c * x.w);
        let [f1, f1u, f1v] = distance(line.e1, line.c1);
        let [f2, f2u, f2v] = distance(line.e2, line.c2);
        let Some(inverse) = Inverse::of([f1u, f1v, f2u, f2v]) else {
            break;
        };
        let [a, b, c, d] = inverse.0;
        let (su, sv) = (a * f1 + b * f2, c * f1 + d * f2);
        if su.abs() > room.0 || sv.abs() > room.1 {
            break;
        }
        (u, v) = (u - su, v - sv);
        uncertain = line.slack * inverse.norm();
    }
    let margin = 1e-12 + 2.0 * uncertain;
    within(u, v, margin)
}
