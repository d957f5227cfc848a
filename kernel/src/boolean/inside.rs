//! What is inside a solid: along rays from a point, faces are counted.
//!
//! Faces of a solid meet up to a small distance only, so a ray that passes a border that near tells nothing, and
//! neither does one that is nearly tangent to a face. Then another one is asked, in one of some directions that
//! no model prefers.

mod cell;
mod parts;

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use glam::{DVec2, DVec3};

use self::cell::{Cell, Meeting, Place};
use crate::nearest::{self, Nearby};
use crate::{Aabb, BoxTree, Cover, Patch, Ray, Surface, TrimRegion};

/// Points no farther from a face than this share of the diagonal of the solid are on the boundary.
pub(super) const NEAR: f64 = 1e-9;

/// Faces are apart where they meet by less than this share of the diagonal: several times what files leave.
const GAP: f64 = 5e-7;

/// A ray that is no farther from a joint between cells, as a share of a cell, may meet both or none.
const JOINT: f64 = 1e-8;

/// Rounding errors of points, as a share of their largest coordinate.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Directions of rays.
const DIRECTIONS: usize = 24;

/// Where no ray is clear, those that can be counted need to be so many, and all but one in so many agree.
const FEWEST: usize = 6;
const DISAGREE: usize = 6;

/// A solid, ready to be asked what is inside it.
#[derive(Debug)]
pub(super) struct Body {
    faces: Vec<Face>,
    cells: Vec<Cell>,
    tree: BoxTree,
    /// A box around all.
    bounds: Aabb,
    /// Distances that count as [`NEAR`] and [`GAP`].
    near: f64,
    gap: f64,
    /// Rounding errors of points, as a share of gaps.
    blur: f64,
    ways: Vec<Way>,
}

/// A face, as far as it is asked for after cells are made of it.
#[derive(Debug)]
struct Face {
    surface: Surface,
    region: Option<TrimRegion>,
}

/// A direction.
#[derive(Clone, Copy, Debug)]
struct Way {
    direction: DVec3,
    inverse: DVec3,
}

/// What a ray and a cell have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Crossing {
    /// Nothing.
    None,
    /// One crossing.
    Once,
    /// Something at a border: a crossing or not, if nothing is as exact as it should be.
    Border { crosses: bool },
    /// It cannot be counted.
    Vague,
}

impl Body {
    /// The solid whose boundary these faces are. Which way they are turned is not asked.
    pub(super) fn new(faces: &[Patch]) -> Self {
        let hulls = faces.iter().map(Patch::hull_bounds);
        let bounds = hulls.fold(Aabb::EMPTY, Aabb::union);
        let diagonal = bounds.diagonal();
        let rounding = ROUNDING * bounds.min.abs().max(bounds.max.abs()).max_element();
        let (near, gap) = ((NEAR * diagonal).max(rounding), GAP * diagonal);
        let mut cells = Vec::new();
        let mut kept = Vec::new();
        for (number, patch) in faces.iter().enumerate() {
            let face = Face::new(patch);
            cells.extend(parts::cells(number, &face, gap));
            kept.push(face);
        }
        let grown = |bounds: Aabb| Aabb {
            min: bounds.min - gap,
            max: bounds.max + gap,
        };
        let boxes: Vec<Aabb> = cells.iter().map(|cell| grown(cell.bounds())).collect();
        Self {
            faces: kept,
            cells,
            tree: BoxTree::new(&boxes),
            bounds: boxes.iter().copied().fold(Aabb::EMPTY, Aabb::union),
            near,
            gap,
            blur: rounding / gap,
            ways: ways(),
        }
    }

    /// Whether a point is inside; `None` if it is on the boundary, up to [`NEAR`] of the diagonal, or if it cannot
    /// be told.
    pub(super) fn contains(&self, point: DVec3) -> Option<bool> {
        let Aabb { min, max } = self.bounds;
        if !(min.cmple(point).all() && point.cmple(max).all()) {
            return point.is_finite().then_some(false);
        }
        if self.is_boundary(point) {
            return None;
        }
        let first = self.first(point);
        let others = (0..self.ways.len()).filter(|&k| k != first);
        let mut answers = std::iter::once(first).chain(others);
        answers
            .find_map(|k| self.counted(point, &self.ways[k]))
            .or_else(|| self.voted(point))
    }

    /// The direction that is likely to leave the body soon.
    fn first(&self, point: DVec3) -> usize {
        let size = self.bounds.size().max(DVec3::splat(self.gap));
        let away = (point - self.bounds.center()) / (size * size);
        let towards = |k: &usize| self.ways[*k].direction.dot(away);
        let all = 0..self.ways.len();
        all.max_by(|a, b| towards(a).total_cmp(&towards(b)))
            .unwrap_or(0)
    }

    /// Whether a ray crosses faces an odd number of times; `None` if one crossing is not clear.
    fn counted(&self, point: DVec3, way: &Way) -> Option<bool> {
        let ray = ray(point, way);
        let mut odd = false;
        let stopped = self.tree.along(&ray, way.inverse, |k| {
            match self.crossing(&self.cells[k as usize], &ray) {
                Crossing::None => ControlFlow::Continue(()),
                Crossing::Once => {
                    odd = !odd;
                    ControlFlow::Continue(())
                }
                Crossing::Border { .. } | Crossing::Vague => ControlFlow::Break(()),
            }
        });
        (!stopped).then_some(odd)
    }

    /// What nearly all rays say, if borders are taken as exact.
    fn voted(&self, point: DVec3) -> Option<bool> {
        let mut votes = [0_usize; 2];
        for way in &self.ways {
            let ray = ray(point, way);
            let mut odd = false;
            let stopped = self.tree.along(&ray, way.inverse, |k| {
                let crosses = match self.crossing(&self.cells[k as usize], &ray) {
                    Crossing::None => false,
                    Crossing::Once => true,
                    Crossing::Border { crosses } => crosses,
                    Crossing::Vague => return ControlFlow::Break(()),
                };
                odd ^= crosses;
                ControlFlow::Continue(())
            });
            if !stopped {
                votes[usize::from(odd)] += 1;
            }
        }
        let [outside, inside] = votes;
        let is_clear =
            outside + inside >= FEWEST && outside.min(inside) * DISAGREE <= outside + inside;
        is_clear.then_some(inside > outside)
    }

    /// What a ray and a cell have in common.
    fn crossing(&self, cell: &Cell, ray: &Ray) -> Crossing {
        let place = match cell.meet(ray, self.gap) {
            Meeting::Apart => return Crossing::None,
            Meeting::Vague => return Crossing::Vague,
            Meeting::Once(place) => place,
        };
        let Place { at, margin, t } = place;
        // A face that is only just behind the point is no nearer than what is on the boundary.
        if t < 0.0 {
            return Crossing::None;
        }
        let crosses = is_within(at);
        let is_middle = at.cmpgt(margin).all() && (at + margin).cmplt(DVec2::ONE).all();
        if cell.is_whole && is_middle {
            return Crossing::Once;
        }
        let face = &self.faces[cell.face];
        match face.cover(cell, &place) {
            Cover::Outside => return Crossing::None,
            Cover::Mixed => {
                let crosses = crosses && face.holds(cell.parameters(at));
                return Crossing::Border { crosses };
            }
            Cover::Inside => {}
        }
        for axis in 0..2 {
            let gaps = [at[axis].abs(), (1.0 - at[axis]).abs()];
            for (gap, is_border) in gaps.into_iter().zip(cell.borders[axis]) {
                let joint = JOINT.max(self.blur * margin[axis]);
                if gap < if is_border { margin[axis] } else { joint } {
                    return Crossing::Border { crosses };
                }
            }
        }
        if crosses {
            Crossing::Once
        } else {
            Crossing::None
        }
    }

    /// Whether a point is on a face, or nearly so.
    fn is_boundary(&self, point: DVec3) -> bool {
        self.tree.around(point, |k| {
            if self.is_on(&self.cells[k as usize], point) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
    }

    /// The same of the part of a face in a cell.
    fn is_on(&self, cell: &Cell, point: DVec3) -> bool {
        if !cell.is_around(point, self.near) {
            return false;
        }
        let face = &self.faces[cell.face];
        let line = cell.normal().map(|direction| Ray {
            origin: point,
            direction,
        });
        match line.map(|line| cell.meet(&line, self.near)) {
            Some(Meeting::Apart) => false,
            Some(Meeting::Once(place)) => {
                place.t.abs() <= self.near && face.cover(cell, &place) != Cover::Outside
            }
            Some(Meeting::Vague) | None => {
                // Next to a pole, or where a surface is folded.
                let surface = &face.surface;
                let nearby = Nearby::new(surface, nearest::closed(surface));
                let found = nearby.near(point, cell.parameters(DVec2::splat(0.5)));
                found.distance <= self.near && face.holds(found.uv)
            }
        }
    }
}

impl Face {
    fn new(patch: &Patch) -> Self {
        let surface = patch.where_loops_are().into_owned();
        // What is known of a region is the less exact the more of its domain is far away.
        let region = if patch.loops.is_empty() || patch.surface.closed() != [false; 2] {
            patch.region()
        } else {
            let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
            Some(TrimRegion::new(&patch.loops, u, v)).filter(|region| !region.is_whole())
        };
        Self { surface, region }
    }

    /// Whether what is around a place of a cell belongs to the face.
    fn cover(&self, cell: &Cell, place: &Place) -> Cover {
        let Some(region) = &self.region else {
            return Cover::Inside;
        };
        let (uv, margin) = (cell.parameters(place.at), cell.size * place.margin);
        let (low, high) = (uv - margin, uv + margin);
        region.classify(low.x..high.x, low.y..high.y)
    }

    fn holds(&self, uv: DVec2) -> bool {
        self.region.as_ref().is_none_or(|region| region.holds(uv))
    }
}

/// Whether parameters of a cell are inside it.
fn is_within(at: DVec2) -> bool {
    at.cmpge(DVec2::ZERO).all() && at.cmple(DVec2::ONE).all()
}

fn ray(origin: DVec3, way: &Way) -> Ray {
    let direction = way.direction;
    Ray { origin, direction }
}

/// Directions all around, along a spiral that is turned so that none is along an axis or in a plane of two.
fn ways() -> Vec<Way> {
    let golden = TAU * 0.618_033_988_749_894_9;
    let turn = glam::DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 0.731);
    let way = |k: usize| {
        let z = 1.0 - 2.0 * (k as f64 + 0.5) / DIRECTIONS as f64;
        let around = DVec2::from_angle(golden * k as f64 + 0.3) * (1.0 - z * z).sqrt();
        let direction = (turn * around.extend(z)).normalize();
        Way {
            direction,
            inverse: direction.recip(),
        }
    };
    // Neighbours on the spiral are not neighbours in the list.
    (0..DIRECTIONS).map(|k| way(k * 7 % DIRECTIONS)).collect()
}

#[cfg(test)]
mod tests;
