//! How far surface and mesh are apart, both ways: what is found, where, and what is proven.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::exact::{Exact, Foot};
use super::soup::Soup;
use super::supremum::{Effort, Function, Known, largest};
use super::triangles::{Found, closest, quarters};
use kernel::Cover;

/// Distances below this share of the size of the scene do not matter.
const FLOOR: f64 = 1e-10;

/// A place where surface and mesh are far apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    /// The point from which the distance is measured.
    pub from: DVec3,
    /// The nearest point of the other side.
    pub to: DVec3,
    /// Their distance.
    pub distance: f64,
    /// Number of the patch, as hits have it.
    pub patch: u32,
    /// Parameters of the point on the patch.
    pub uv: DVec2,
    /// Number of the triangle in the mesh, in the order of the file.
    pub triangle: u32,
}

/// The largest distance from one side to the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reach {
    /// The largest distance that has been found.
    pub found: f64,
    /// No point is farther away, up to rounding; infinite if the other side is empty, or nothing is
    /// proven.
    pub bound: f64,
    /// Where it is large, the largest first, places apart from each other.
    pub worst: Vec<Worst>,
}

impl Reach {
    /// The other side is empty.
    pub(crate) const ENDLESS: Self = Self {
        found: f64::INFINITY,
        bound: f64::INFINITY,
        worst: Vec::new(),
    };
}

/// Steps that find where the nearest triangle changes, and how near to an end of a side that
/// is no place to divide it.
const CHANGE_STEPS: usize = 52;
const AT_END: f64 = 0.02;

/// Places apart by less than this share of the size are one.
const APART: f64 = 0.04;

/// Places that are told.
const PLACES: usize = 8;

/// Distances that are looked into, at most, to be sure of the largest.
const CHECKED: usize = 512;

/// The distance from the surfaces to the nearest triangles.
pub(crate) fn from_surface(exact: &Exact<'_>, soup: &Soup, size: f64, effort: Effort) -> Reach {
    if exact.triangles.is_empty() {
        return Reach::default();
    }
    let function = FromSurface {
        exact,
        soup,
        slack: slack(exact),
    };
    let spots: Vec<Option<Spot>> = exact
        .vertices
        .par_iter()
        .map(|vertex| {
            let found = soup.tree.nearest(vertex.point)?;
            Some(Spot::new(vertex.uv, vertex.point, found))
        })
        .collect();
    let cell = |number: usize| {
        let corners = exact.triangles[number].map(|k| spots[k as usize]);
        let [Some(a), Some(b), Some(c)] = corners else {
            return None;
        };
        Some(SurfaceCell {
            triangle: u32::try_from(number).ok()?,
            corners: [a, b, c],
            chord: exact.chords[number],
        })
    };
    let cells: Vec<_> = (0..exact.triangles.len()).filter_map(cell).collect();
    if cells.is_empty() {
        return Reach::ENDLESS;
    }
    reach(&function, cells, size, effort)
}

/// The distance from the triangles to the nearest points of the surfaces.
pub(crate) fn from_mesh(
    exact: &Exact<'_>,
    soup: &Soup,
    feet: &[Foot],
    size: f64,
    effort: Effort,
) -> Reach {
    let function = FromMesh {
        exact,
        slack: slack(exact),
    };
    let cell = |number: usize| {
        let corners = soup.triangles[number].map(|k| k as usize);
        MeshCell {
            triangle: u32::try_from(number).expect("triangles are numbered by 32 bits"),
            corners: corners.map(|k| soup.points[k]),
            feet: corners.map(|k| feet[k]),
        }
    };
    let cells: Vec<_> = (0..soup.triangles.len()).map(cell).collect();
    reach(&function, cells, size, effort)
}

/// The nearest point of the surfaces for every point of a mesh; empty if there is no surface.
pub(crate) fn feet(exact: &Exact<'_>, soup: &Soup) -> Vec<Foot> {
    let points = soup.points.par_iter();
    points.filter_map(|&p| exact.nearest(p)).collect()
}

/// Whether a corner of the triangles of the exact side, or a point of the mesh, is farther away than
/// `limit`.
pub(crate) fn exceeds(exact: &Exact<'_>, soup: &Soup, limit: f64) -> bool {
    let vertices = exact.vertices.par_iter().map(|vertex| vertex.point);
    let corner = |p: DVec3| soup.tree.nearest(p).is_none_or(|n| n.distance > limit);
    let point = |&p: &DVec3| {
        let is_far = |foot: Foot| foot.distance > limit && exact.surest(p, foot).distance > limit;
        exact.nearest(p).is_none_or(is_far)
    };
    vertices.any(corner) || soup.points.par_iter().any(point)
}

/// Looks for the largest distance over these cells; the worst places are chosen among them and
/// those with the largest values at the end.
fn reach<F: Distances>(function: &F, cells: Vec<F::Cell>, size: f64, effort: Effort) -> Reach {
    let worst = |cell: &F::Cell| function.worst(cell);
    let farthest = |a: &Worst, b: &Worst| b.distance.total_cmp(&a.distance);
    let mut all: Vec<Worst> = cells.iter().map(worst).collect();
    // What is added at the end may not exceed the limit, either.
    let effort = Effort {
        limit: effort.limit.map(|limit| limit - FLOOR * size),
        ..effort
    };
    let top = largest(function, cells, FLOOR * size, effort);
    all.extend(top.cells.iter().map(|(_, cell)| worst(cell)));
    all.sort_by(farthest);
    // What was taken for the nearest point may not be it: a distance counts once all have been looked at.
    let mut found = 0.0;
    for place in all.iter_mut().take(CHECKED) {
        if place.distance <= found {
            break;
        }
        *place = function.surest(*place);
        found = place.distance.max(found);
    }
    all.sort_by(farthest);
    let mut places: Vec<Worst> = Vec::new();
    for place in all {
        if places.len() == PLACES {
            break;
        }
        let apart = |other: &Worst| other.from.distance(place.from) > APART * size;
        if place.distance > FLOOR * size && places.iter().all(apart) {
            places.push(function.surest(place));
        }
    }
    places.sort_by(farthest);
    Reach {
        found,
        bound: top.bound + FLOOR * size,
        worst: places,
    }
}

/// Distances that can be told as places.
trait Distances: Function {
    /// The corner of a cell that is farthest away.
    fn worst(&self, cell: &Self::Cell) -> Worst;

    /// The same place with what is nearest to it, looked for everywhere.
    fn surest(&self, place: Worst) -> Worst;
}

/// For every triangle of the exact side how far the face may reach beyond it, at sides that
/// follow a curved border of the face.
fn slack(exact: &Exact<'_>) -> Vec<f64> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::new();
    for (&[a, b, c], number) in exact.triangles.iter().zip(0..) {
        let own = [[a, b], [b, c], [c, a]];
        sides.extend(own.map(|[p, q]| ([p.min(q), p.max(q)], number)));
    }
    sides.sort_unstable();
    // What is proven of nothing may be anywhere.
    let endless = |number: usize| {
        exact.faces[exact.face_of(number) as usize]
            .proven
            .is_infinite()
    };
    let slack = (0..exact.triangles.len()).map(|k| if endless(k) { f64::INFINITY } else { 0.0 });
    let mut slack: Vec<f64> = slack.collect();
    for same in sides.chunk_by(|a, b| a.0 == b.0) {
        let [([p, q], triangle)] = same else { continue };
        let [p, q] = [p, q].map(|k| exact.vertices[*k as usize]);
        let face = &exact.faces[p.face as usize];
        let domain = face.pieces.domain();
        let along = |axis: usize| {
            let borders = [domain.min[axis], domain.max[axis]];
            let on = |border: f64| {
                (p.uv[axis] - border).abs() <= 0.0 && (q.uv[axis] - border).abs() <= 0.0
            };
            borders.into_iter().any(on)
        };
        if !along(0) && !along(1) {
            slack[*triangle as usize] = face.proven;
        }
    }
    slack
}

/// The longest side.
fn diameter([a, b, c]: [DVec3; 3]) -> f64 {
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

/// No point of a triangle is farther away than the best of its corners and the way there.
fn from_corners(corners: [DVec3; 3], distances: [f64; 3]) -> f64 {
    let far = |k: usize| {
        let own = corners[k];
        distances[k] + corners.iter().map(|c| c.distance(own)).fold(0.0, f64::max)
    };
    far(0).min(far(1)).min(far(2))
}

fn most(values: [f64; 3]) -> f64 {
    values[0].max(values[1]).max(values[2])
}

/// Where on the way from `a` to `b` the triangle that is nearest to `b` becomes nearer than that
/// of `a`; the middle if that is nearly at an end, or both are one.
///
/// Cells that are divided there have one nearest triangle each, however long the side that
/// two flat neighbours share.
fn change([a, b]: [DVec3; 2], near: [u32; 2], corners: impl Fn(usize) -> [DVec3; 3]) -> f64 {
    if near[0] == near[1] {
        return 0.5;
    }
    let [one, other] = near.map(|triangle| corners(triangle as usize));
    let is_first = |t: f64| {
        let p = a.lerp(b, t);
        let away = |triangle| closest(triangle, p).point.distance_squared(p);
        away(one) <= away(other)
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..CHANGE_STEPS {
        let middle = 0.5 * (low + high);
        if is_first(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    if (AT_END..=1.0 - AT_END).contains(&low) {
        low
    } else {
        0.5
    }
}

/// A point of the surface and its nearest triangle.
#[derive(Clone, Copy, Debug)]
struct Spot {
    uv: DVec2,
    point: DVec3,
    triangle: u32,
    near: DVec3,
    distance: f64,
    /// Whether it belongs to the face.
    inside: bool,
}

impl Spot {
    fn new(uv: DVec2, point: DVec3, found: Found) -> Self {
        Self {
            uv,
            point,
            triangle: found.triangle,
            near: found.closest.point,
            distance: found.distance,
            inside: true,
        }
    }
}

/// A triangle of parameters.
#[derive(Clone, Debug)]
struct SurfaceCell {
    /// The triangle of the exact side that it is a part of.
    triangle: u32,
    corners: [Spot; 3],
    chord: f64,
}

impl SurfaceCell {
    fn found(&self) -> f64 {
        most(
            self.corners
                .map(|s| if s.inside { s.distance } else { 0.0 }),
        )
    }
}

struct FromSurface<'a> {
    exact: &'a Exact<'a>,
    soup: &'a Soup,
    slack: Vec<f64>,
}

impl Distances for FromSurface<'_> {
    fn worst(&self, cell: &SurfaceCell) -> Worst {
        let inside = cell.corners.iter().filter(|spot| spot.inside);
        let spot = inside.max_by(|a, b| a.distance.total_cmp(&b.distance));
        let spot = spot.unwrap_or(&cell.corners[0]);
        Worst {
            from: spot.point,
            to: spot.near,
            distance: if spot.inside { spot.distance } else { 0.0 },
            patch: self.exact.face_of(cell.triangle as usize),
            uv: spot.uv,
            triangle: spot.triangle,
        }
    }

    /// The nearest of flat triangles is sure.
    fn surest(&self, place: Worst) -> Worst {
        place
    }
}

impl Function for FromSurface<'_> {
    type Cell = SurfaceCell;

    /// The distance from a triangle of the mesh is a convex function: over the flat triangle
    /// with the corners of the cell it is largest at a corner.
    fn examine(&self, cell: &SurfaceCell) -> Known {
        let points = cell.corners.map(|spot| spot.point);
        let distances = cell.corners.map(|spot| spot.distance);
        let over = |triangle: u32| {
            let one = self.soup.corners(triangle as usize);
            most(points.map(|p| closest(one, p).point.distance(p)))
        };
        let mut bound = from_corners(points, distances);
        for (k, spot) in cell.corners.iter().enumerate() {
            let known = |j: usize| cell.corners[j].triangle == spot.triangle;
            if !(0..k).any(known) {
                bound = bound.min(over(spot.triangle));
            }
        }
        let slack = self.slack[cell.triangle as usize];
        let bound = bound + cell.chord;
        let coarse = diameter(points) > slack;
        Known {
            found: cell.found(),
            bound: if coarse { bound + slack } else { bound },
            slack: if coarse { 0.0 } else { slack },
        }
    }

    fn divide(&self, cell: &SurfaceCell) -> Vec<SurfaceCell> {
        let face = &self.exact.faces[self.exact.face_of(cell.triangle as usize) as usize];
        let middle = |from: &Spot, to: &Spot| {
            let (ends, near) = ([from.point, to.point], [from.triangle, to.triangle]);
            let share = change(ends, near, |number| self.soup.corners(number));
            let uv = face.pieces.place([from.uv, to.uv], [1.0 - share, share]);
            let point = face.patch.surface.evaluate(uv);
            let found = self.soup.tree.nearest_from(point, from.triangle);
            let mut spot = Spot::new(uv, point, found);
            spot.inside = face.region.as_ref().is_none_or(|r| r.contains(uv));
            spot
        };
        let part = |corners: [Spot; 3]| SurfaceCell {
            triangle: cell.triangle,
            corners,
            chord: face.chord(corners.map(|spot| spot.uv)),
        };
        quarters(cell.corners, middle).map(part).into()
    }
}

/// A part of a triangle of the mesh.
#[derive(Clone, Debug)]
struct MeshCell {
    triangle: u32,
    corners: [DVec3; 3],
    feet: [Foot; 3],
}

impl MeshCell {
    fn found(&self) -> f64 {
        most(self.feet.map(|foot| foot.distance))
    }
}

struct FromMesh<'a> {
    exact: &'a Exact<'a>,
    slack: Vec<f64>,
}

impl FromMesh<'_> {
    /// A bound by the surface over the triangle of the nearest points' parameters on the face
    /// of one of them.
    fn over_face(&self, cell: &MeshCell, base: &Foot) -> Option<f64> {
        let face = &self.exact.faces[base.face as usize];
        let own = |k: usize| {
            let foot = &cell.feet[k];
            if foot.face == base.face && face.are_close(foot.uv, base.uv) {
                return *foot;
            }
            let foot = self.exact.foot(base.face, cell.corners[k], base.uv);
            Foot {
                uv: face.beside(foot.uv, base.uv),
                ..foot
            }
        };
        let feet = [own(0), own(1), own(2)];
        let uvs = feet.map(|foot| foot.uv);
        let (low, high) = (
            uvs[0].min(uvs[1]).min(uvs[2]),
            uvs[0].max(uvs[1]).max(uvs[2]),
        );
        let covered = face
            .region
            .as_ref()
            .is_none_or(|region| region.classify(low.x..high.x, low.y..high.y) == Cover::Inside);
        covered.then(|| most(feet.map(|foot| foot.distance)) + face.chord(uvs))
    }

    /// A bound by one triangle of the exact side.
    fn over_triangle(&self, cell: &MeshCell, number: usize) -> f64 {
        let one = self.exact.corners(number);
        let distances = cell.corners.map(|p| closest(one, p).point.distance(p));
        most(distances) + self.exact.chords[number] + self.slack[number]
    }
}

impl Distances for FromMesh<'_> {
    fn worst(&self, cell: &MeshCell) -> Worst {
        let k = (0..3).max_by(|&i, &j| cell.feet[i].distance.total_cmp(&cell.feet[j].distance));
        let (from, foot) = k.map_or((cell.corners[0], cell.feet[0]), |k| {
            (cell.corners[k], cell.feet[k])
        });
        Worst {
            from,
            to: foot.point,
            distance: foot.distance,
            patch: foot.face,
            uv: foot.uv,
            triangle: cell.triangle,
        }
    }

    fn surest(&self, place: Worst) -> Worst {
        let known = Foot {
            face: place.patch,
            uv: place.uv,
            point: place.to,
            distance: place.distance,
            triangle: u32::MAX,
        };
        let foot = self.exact.surest(place.from, known);
        Worst {
            to: foot.point,
            distance: foot.distance,
            patch: foot.face,
            uv: foot.uv,
            ..place
        }
    }
}

impl Function for FromMesh<'_> {
    type Cell = MeshCell;

    fn examine(&self, cell: &MeshCell) -> Known {
        let mut bound = from_corners(cell.corners, cell.feet.map(|foot| foot.distance));
        for (k, foot) in cell.feet.iter().enumerate() {
            let known = cell.feet[..k].iter().any(|f| f.triangle == foot.triangle);
            if !known {
                bound = bound.min(self.over_triangle(cell, foot.triangle as usize));
            }
        }
        for (k, foot) in cell.feet.iter().enumerate() {
            let face = &self.exact.faces[foot.face as usize];
            let known = |other: &Foot| other.face == foot.face && face.are_close(other.uv, foot.uv);
            if cell.feet[..k].iter().any(known) {
                continue;
            }
            if let Some(other) = self.over_face(cell, foot) {
                bound = bound.min(other);
            }
        }
        Known {
            found: cell.found(),
            bound,
            slack: 0.0,
        }
    }

    fn divide(&self, cell: &MeshCell) -> Vec<MeshCell> {
        let corners = [0, 1, 2].map(|k| (cell.corners[k], cell.feet[k]));
        let middle = |(a, from): &(DVec3, Foot), (b, to): &(DVec3, Foot)| {
            let near = [from.triangle, to.triangle];
            let share = change([*a, *b], near, |number| self.exact.corners(number));
            let point = a.lerp(*b, share);
            (point, self.exact.nearest(point).unwrap_or(*from))
        };
        let part = |parts: [(DVec3, Foot); 3]| MeshCell {
            triangle: cell.triangle,
            corners: parts.map(|part| part.0),
            feet: parts.map(|part| part.1),
        };
        quarters(corners, middle).map(part).into()
    }
}
