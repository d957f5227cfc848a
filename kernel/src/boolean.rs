//! Solids that are united, cut by each other or taken from each other: the faces of the result are
//! parts of theirs, on the same surfaces.
//!
//! Faces meet in curves of both their parameter planes (`search`, `trace`); faces in one surface have
//! their borders laid on each other (`laid`). What of a face `remains` is bounded by those parts of
//! all curves across it that are between what is kept and what is not.

mod cut;
mod face;
mod inside;
mod join;
mod laid;
mod pair;
mod remains;
mod search;
#[cfg(test)]
mod tests;
mod trace;

use std::cell::Cell;

use glam::{DVec2, DVec3};

use crate::{Aabb, Curve, Error, Patch};
use face::Face;
use inside::Body;
use laid::Border;
use remains::remains;
use search::{Meeting, meeting, nearly_meet};

/// How far from a face it is looked what is on its sides, as a share of the size of the solids.
const OFF: f64 = 1e-6;

/// Points at which a result is checked.
const CHECKS: u32 = 200;

/// Places along each side of a face at which its sides are looked at.
const LOOKS: u32 = 7;

/// Parameters of curves nearer to each other than this share of the curve are one.
const SHORT: f64 = 1e-9;

/// What is made of two solids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// What is in one of them or in both.
    Union,
    /// What is in both.
    Intersection,
    /// What is in the first, but not in the second.
    Difference,
}

impl Operation {
    /// Whether the result holds what the solids hold or not.
    fn holds(self, [first, second]: [bool; 2]) -> bool {
        match self {
            Self::Union => first || second,
            Self::Intersection => first && second,
            Self::Difference => first && !second,
        }
    }
}

/// The faces of what an operation makes of two solids, each given by the faces around it; none if
/// nothing is left. Faces stay on their surfaces, with other loops and with normals that look out of the result;
/// those that nothing cuts keep their loops.
///
/// Where the faces of the solids are cut they meet within 1e-10 of the size of both. What is thinner than
/// about 1e-6 of it may get lost; the result is looked at in a few hundred points before it is given back.
///
/// `work` is how many steps may be taken, of some microseconds each, and then how many are left: solids may touch
/// each other everywhere.
///
/// # Errors
///
/// [`Error::Boolean`] if the faces of a solid do not close it, if it cannot be told where they meet, or if
/// there is no work left.
pub fn combine(
    first: &[Patch],
    second: &[Patch],
    operation: Operation,
    work: &mut usize,
) -> Result<Vec<Patch>, Error> {
    let bounds = [first, second].map(|faces| {
        faces
            .iter()
            .fold(Aabb::EMPTY, |all, face| all.union(face.hull_bounds()))
    });
    let whole = bounds[0].union(bounds[1]);
    if !nearly_meet(&bounds[0], &bounds[1], whole.diagonal()) {
        return Ok(match operation {
            Operation::Union => [first, second].concat(),
            Operation::Intersection => Vec::new(),
            Operation::Difference => first.to_vec(),
        });
    }
    let left = Work(Cell::new(*work));
    let made = made([first, second], operation, whole, &left);
    *work = left.0.get();
    made
}

/// The same of solids whose boxes meet, in a box around both.
fn made(
    patches: [&[Patch]; 2],
    operation: Operation,
    bounds: Aabb,
    work: &Work,
) -> Result<Vec<Patch>, Error> {
    let solids = Solids::new(patches, operation, bounds, work)?;
    let curves = solids.curves()?;
    let mut result = Vec::new();
    for (which, (patches, curves)) in patches.into_iter().zip(&curves).enumerate() {
        for (index, (patch, curves)) in patches.iter().zip(curves).enumerate() {
            result.extend(solids.remaining(which, index, patch, curves)?);
        }
    }
    solids.check(&result)?;
    Ok(result)
}

/// How many steps may still be taken.
struct Work(Cell<usize>);

impl Work {
    /// Takes steps, if they are left.
    fn take(&self, steps: usize) -> Result<(), Error> {
        let left = self.0.get().checked_sub(steps);
        let left = left.ok_or(Error::Boolean(
            "their faces touch each other in too many places",
        ))?;
        self.0.set(left);
        Ok(())
    }
}

/// Two solids and what is made of them.
struct Solids<'a> {
    work: &'a Work,
    faces: [Vec<Face>; 2],
    bodies: [Body; 2],
    operation: Operation,
    bounds: Aabb,
    size: f64,
}

/// For each face of each solid, the curves of its unit square along which faces of the other meet it.
type Curves = [Vec<Vec<Curve<DVec2>>>; 2];

impl<'a> Solids<'a> {
    fn new(
        patches: [&[Patch]; 2],
        operation: Operation,
        bounds: Aabb,
        work: &'a Work,
    ) -> Result<Self, Error> {
        let faces = |patches: &[Patch]| patches.iter().map(Face::new).collect::<Result<_, _>>();
        Ok(Self {
            work,
            faces: [faces(patches[0])?, faces(patches[1])?],
            bodies: patches.map(Body::new),
            operation,
            bounds,
            size: bounds.diagonal(),
        })
    }

    fn curves(&self) -> Result<Curves, Error> {
        let mut curves: Curves =
            [0, 1].map(|which: usize| vec![Vec::new(); self.faces[which].len()]);
        for (i, first) in self.faces[0].iter().enumerate() {
            for (j, second) in self.faces[1].iter().enumerate() {
                let [on_first, on_second] = self.meet(first, second)?;
                curves[0][i].extend(on_first);
                curves[1][j].extend(on_second);
            }
        }
        Ok(curves)
    }

    /// The curves on two faces along which they meet.
    fn meet(&self, first: &Face, second: &Face) -> Result<[Vec<Curve<DVec2>>; 2], Error> {
        let mut found = [Vec::new(), Vec::new()];
        if !nearly_meet(&first.bounds, &second.bounds, self.size) {
            return Ok(found);
        }
        let mut same = Vec::new();
        for (p, own) in first.pieces.iter().enumerate() {
            for (q, other) in second.pieces.iter().enumerate() {
                if !nearly_meet(&own.bounds, &other.bounds, self.size) {
                    continue;
                }
                match meeting(own, other, self.size, self.work)? {
                    Meeting::Same => same.push([p, q]),
                    Meeting::Along(traces) => {
                        for trace in traces {
                            let [a, b] = trace.curves()?;
                            let a = a.transformed(&own.face_from_piece());
                            let b = b.transformed(&other.face_from_piece());
                            for [a, b] in shared([first, second], [&a, &b], self.work)? {
                                found[0].push(a);
                                found[1].push(b);
                            }
                        }
                    }
                }
            }
        }
        if !same.is_empty() {
            found[0].extend(self.laid(second, first, |own, other| same.contains(&[own, other]))?);
            found[1].extend(self.laid(first, second, |own, other| same.contains(&[other, own]))?);
        }
        Ok(found)
    }

    /// The borders of a face laid on another one, over those pieces of which it is told that they are of one
    /// surface: first the piece they are laid on.
    fn laid(
        &self,
        face: &Face,
        on: &Face,
        are_same: impl Fn(usize, usize) -> bool,
    ) -> Result<Vec<Curve<DVec2>>, Error> {
        let mut laid = Vec::new();
        for (curve, pieces) in face.borders_over_pieces()? {
            let border = Border {
                surface: &face.patch.surface,
                curve: &curve,
            };
            for (index, piece) in on.pieces.iter().enumerate() {
                if pieces.iter().any(|&own| are_same(index, own)) {
                    let map = piece.face_from_piece();
                    let parts = border.on(piece, self.size)?;
                    laid.extend(parts.iter().map(|part| part.transformed(&map)));
                }
            }
        }
        Ok(laid)
    }

    /// What remains of a face.
    fn remaining(
        &self,
        which: usize,
        index: usize,
        patch: &Patch,
        curves: &[Curve<DVec2>],
    ) -> Result<Option<Patch>, Error> {
        let face = &self.faces[which][index];
        let is_kept = |uv: DVec2, is_apart: bool| self.is_kept(which, face, uv, is_apart);
        let uncut = if curves.is_empty() {
            self.whole(which, face)
        } else {
            None
        };
        let loops = match uncut {
            Some(false) => return Ok(None),
            Some(true) => None,
            None => Some(remains(&face.borders, curves, is_kept, self.work)?),
        };
        let patch = match loops {
            Some(loops) if loops.is_empty() => return Ok(None),
            Some(loops) => face::with_loops(patch, &loops)?,
            None => patch.clone(),
        };
        let patch = if self.looks_out(&patch) {
            patch
        } else {
            face::turned(patch)?
        };
        Ok(Some(patch))
    }

    /// Whether all of a face that nothing cuts remains, or nothing of it, if some points agree.
    fn whole(&self, which: usize, face: &Face) -> Option<bool> {
        let inside = looks().filter(|&uv| face.contains(uv));
        let mut told = inside.filter_map(|uv| self.is_kept(which, face, uv, false));
        let first = told.next()?;
        told.all(|kept| kept == first).then_some(first)
    }

    /// Whether the result holds a point, if that can be told.
    fn holds(&self, point: DVec3) -> Option<bool> {
        let [first, second] = &self.bodies;
        Some(
            self.operation
                .holds([first.contains(point)?, second.contains(point)?]),
        )
    }

    /// Whether a point of the unit square of a face is on the boundary of the result, if that can be told
    /// and it is not to be apart from the other solid's boundary but is on it.
    fn is_kept(&self, which: usize, face: &Face, uv: DVec2, is_apart: bool) -> Option<bool> {
        if !face.contains(uv) {
            return Some(false);
        }
        let (point, normal) = face.patch.surface.point_and_normal(uv);
        if let Some(is_inside) = self.bodies[1 - which].contains(point) {
            let sides = [false, true].map(|own| {
                let both = if which == 0 {
                    [own, is_inside]
                } else {
                    [is_inside, own]
                };
                self.operation.holds(both)
            });
            return Some(sides[0] != sides[1]);
        }
        if is_apart {
            return None;
        }
        // What is on the boundaries of both is that of the first one's.
        if which == 1 {
            return Some(false);
        }
        let off = normal? * (OFF * self.size);
        Some(self.holds(point + off)? != self.holds(point - off)?)
    }

    /// Whether the normals of a face of the result look out of it, by most points of it.
    fn looks_out(&self, patch: &Patch) -> bool {
        let [u, v] = [
            patch.surface.knots_u().domain(),
            patch.surface.knots_v().domain(),
        ];
        let region = patch.region();
        let mut votes = 0_i32;
        for share in looks() {
            let start = DVec2::new(u.start, v.start);
            let uv = start + DVec2::new(u.end - u.start, v.end - v.start) * share;
            if region.as_ref().is_some_and(|region| !region.contains(uv)) {
                continue;
            }
            let (point, normal) = patch.surface.point_and_normal(uv);
            let off = normal.unwrap_or(DVec3::ZERO) * (OFF * self.size);
            match [self.holds(point + off), self.holds(point - off)] {
                [Some(false), Some(true)] => votes += 1,
                [Some(true), Some(false)] => votes -= 1,
                _ => {}
            }
        }
        votes >= 0
    }

    /// Looks at a result at some points.
    fn check(&self, result: &[Patch]) -> Result<(), Error> {
        let body = Body::new(result);
        let size = self.bounds.size();
        let share = |i: u32, irrational: f64| (f64::from(i) * irrational).fract();
        let is_wrong = |i: &u32| {
            let at = DVec3::new(
                share(*i, 0.819_172_513_396_164_4),
                share(*i, 0.671_043_606_703_789_2),
                share(*i, 0.549_700_477_901_970_3),
            );
            let point = self.bounds.min + size * at;
            match (self.holds(point), body.contains(point)) {
                (Some(expected), Some(found)) => expected != found,
                _ => false,
            }
        };
        if (1..=CHECKS).any(|i| is_wrong(&i)) {
            return Err(Error::Boolean("the faces of the result do not bound it"));
        }
        Ok(())
    }
}

/// Points of the unit square at which faces are looked at.
fn looks() -> impl Iterator<Item = DVec2> {
    let share = |n: u32| (f64::from(n) + 0.5) / f64::from(LOOKS);
    (0..LOOKS * LOOKS).map(move |i| DVec2::new(share(i % LOOKS), share(i / LOOKS)))
}

/// Those parts of a curve over two faces that belong to both, by parameters it has in common.
fn shared(
    faces: [&Face; 2],
    curves: [&Curve<DVec2>; 2],
    work: &Work,
) -> Result<Vec<[Curve<DVec2>; 2]>, Error> {
    let domain = curves[0].domain();
    let mut ends = vec![domain.start, domain.end];
    for (face, curve) in faces.iter().zip(curves) {
        for border in &face.borders {
            ends.extend(
                cut::meetings(curve, border, SHORT, work)?
                    .iter()
                    .map(|&(t, _)| t),
            );
        }
    }
    ends.sort_by(f64::total_cmp);
    let short = SHORT * (domain.end - domain.start);
    ends.dedup_by(|a, b| *a - *b <= short);
    let mut parts: Vec<std::ops::Range<f64>> = Vec::new();
    for range in ends.windows(2) {
        let middle = range[0].midpoint(range[1]);
        let is_on = |which: usize| faces[which].reaches(curves[which].evaluate(middle));
        if !(is_on(0) && is_on(1)) {
            continue;
        }
        match parts.last_mut() {
            Some(last) if last.end >= range[0] => last.end = range[1],
            _ => parts.push(range[0]..range[1]),
        }
    }
    let both = |range: std::ops::Range<f64>| {
        Ok([
            curves[0].restricted(range.clone())?,
            curves[1].restricted(range)?,
        ])
    };
    parts.into_iter().map(both).collect()
}
