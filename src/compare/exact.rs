//! The exact side of a comparison: faces where they stand, and their nearest points.
//!
//! Our own triangles of the faces, with their parameters and the proof of how far they are from
//! the surface, tell where to look; the answer is found on the surface.

use glam::{DAffine3, DVec2, DVec3};
use kernel::nearest::{self, Nearby};
use kernel::{Aabb, Curve, Patch, Scene, Shape, TrimRegion};
use rayon::prelude::*;

use super::soup::Soup;
use super::triangles::{Found, TriangleTree, closest, quarters};
use crate::tessellate::pieces::Pieces;
use crate::tessellate::{Tessellation, stretch};
use kernel::BoxTree;

/// Points on each piece of a trim curve from which nearest points are looked for.
const RIM_SAMPLES: usize = 16;

/// From how many of the points that are nearer than their neighbours on a trim curve the nearest
/// is looked for.
const RIM_TRIED: usize = 6;

/// A trim curve no larger than this share of the domain is a point.
const POINT: f64 = 1e-12;

/// Steps along a trim curve.
const RIM_STEPS: usize = 20;

/// Parameters so near to the end of a closed surface, as a share of its domain, are there.
const SEAM: f64 = 1e-9;

/// What distances may differ by after rounding, as a share.
const ROUNDING: f64 = 1e-12;

/// What a file of triangles may round, as a share of the largest coordinate: half of the sixth digit.
const WRITTEN: f64 = 5e-6;

/// Faces on which the nearest point is looked for, at most.
const FACES_TRIED: usize = 6;

/// Parts of triangles that are looked into for one nearest point, at most.
const PARTS: usize = 10_000;

/// What is nearer by less than this share is no nearer.
const SURE: f64 = 1e-4;

/// A point of a face and how far it is from the point asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Foot {
    pub(crate) face: u32,
    pub(crate) uv: DVec2,
    pub(crate) point: DVec3,
    pub(crate) distance: f64,
    /// The nearest triangle of the exact side, as far as [`Exact::nearest`] has looked for it.
    pub(crate) triangle: u32,
}

/// Every patch as it is placed in the world, in the order of their numbers.
pub(crate) fn placed_patches(scene: &Scene) -> Vec<Patch> {
    let placements = scene.placements();
    let patches = placements.par_iter().filter_map(|at| match at.shape {
        Shape::Patch(id) => Some(scene.patch(id).transformed(&at.world_from_object)),
        Shape::Mesh(_) => None,
    });
    patches.collect()
}

/// A face and what is needed to find its points.
#[derive(Debug)]
pub(crate) struct Face<'a> {
    pub(crate) patch: &'a Patch,
    pub(crate) pieces: Pieces<'a>,
    pub(crate) region: Option<TrimRegion>,
    closed: [bool; 2],
    nearby: Nearby<'a>,
    rims: Vec<Curve<DVec2>>,
    rim: Vec<RimPoint>,
    /// Its triangles, and the number of the first of them among all.
    tree: TriangleTree,
    first: u32,
    /// Every point of the face is this near to one of its triangles.
    pub(crate) proven: f64,
    /// Whether its normal points into the closed body it bounds; `None` if there is none.
    pub(crate) inwards: Option<bool>,
}

/// A point on a trim curve.
#[derive(Clone, Copy, Debug)]
struct RimPoint {
    curve: u32,
    t: f64,
    point: DVec3,
}

/// A corner of the triangles: a point of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    pub(crate) face: u32,
    pub(crate) uv: DVec2,
    pub(crate) point: DVec3,
}

/// All faces.
#[derive(Debug)]
pub(crate) struct Exact<'a> {
    pub(crate) faces: Vec<Face<'a>>,
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// How far the surface is from each triangle at the parameters that belong to its points, at most.
    pub(crate) chords: Vec<f64>,
    /// The boxes around the triangles of each face.
    boxes: BoxTree,
    /// How much nearer than its triangles a face is looked for: what is proven of all faces, but
    /// not more than twice the tolerance for the sake of those of which little is.
    reach: f64,
    /// The polygons that are in the file beside the faces, and how far off they are where they
    /// have been written once more.
    polygons: TriangleTree,
    rounding: f64,
}

impl<'a> Exact<'a> {
    /// Prepares the faces of a scene; `patches` are its [`placed_patches`].
    pub(crate) fn new(scene: &Scene, patches: &'a [Patch], triangles: &Tessellation) -> Self {
        let mut closed = vec![false; scene.patches().len()];
        for shell in triangles.shells.iter().filter(|shell| shell.is_closed()) {
            for patch in &shell.patches {
                closed[patch.index()] = true;
            }
        }
        let placements = scene.placements();
        let shown = placements.iter().filter_map(|at| match at.shape {
            Shape::Patch(id) => Some((at, id.index())),
            Shape::Mesh(_) => None,
        });
        let shown: Vec<_> = shown.zip(patches).collect();
        let parts: Vec<_> = shown
            .par_iter()
            .map(|((at, index), patch)| {
                let mut face = Face::new(patch);
                let mut part = Part::default();
                let Some(mesh) = &triangles.faces[*index] else {
                    return (face, part);
                };
                let map = &at.world_from_object;
                face.proven = mesh.proven * stretch(map);
                let mirrored = map.matrix3.determinant() < 0.0;
                face.inwards = closed[*index].then_some(mesh.flipped != mirrored);
                let point = |uv: &DVec2| (*uv, patch.surface.evaluate(*uv));
                part.vertices = mesh.parameters.iter().map(point).collect();
                part.triangles = mesh.mesh.triangles().to_vec();
                let chord = |t: &[u32; 3]| {
                    let uvs = t.map(|k| mesh.parameters[k as usize]);
                    face.chord(uvs)
                };
                part.chords = part.triangles.iter().map(chord).collect();
                let corners = part.triangles.iter();
                let corners = corners.map(|t| t.map(|k| part.vertices[k as usize].1));
                face.tree = TriangleTree::new(corners.collect());
                (face, part)
            })
            .collect();
        let mut all = Self {
            faces: Vec::new(),
            vertices: Vec::new(),
            triangles: Vec::new(),
            chords: Vec::new(),
            boxes: BoxTree::new(&[]),
            reach: 0.0,
            polygons: Soup::new(scene, &DAffine3::IDENTITY).tree,
            rounding: 0.0,
        };
        for (face, part) in parts {
            all.reach = all.reach.max(face.proven.min(2.0 * triangles.tolerance));
            all.add(face, part);
        }
        let boxes: Vec<_> = all.faces.iter().map(|face| face.tree.bounds()).collect();
        all.boxes = BoxTree::new(&boxes);
        let bounds = all.bounds().union(all.polygons.bounds());
        all.rounding = WRITTEN * bounds.min.abs().max(bounds.max.abs()).max_element();
        all
    }

    fn add(&mut self, mut face: Face<'a>, part: Part) {
        let small = |k: usize| u32::try_from(k).expect("memory ends before 2^32 vertices");
        let (number, first) = (small(self.faces.len()), small(self.vertices.len()));
        let vertices = part.vertices.into_iter();
        self.vertices.extend(vertices.map(|(uv, point)| Vertex {
            face: number,
            uv,
            point,
        }));
        face.first = small(self.triangles.len());
        let triangles = part.triangles.into_iter();
        self.triangles
            .extend(triangles.map(|t| t.map(|k| first + k)));
        self.chords.extend(part.chords);
        self.faces.push(face);
    }

    /// The face of a triangle.
    pub(crate) fn face_of(&self, triangle: usize) -> u32 {
        self.vertices[self.triangles[triangle][0] as usize].face
    }

    /// The corners of a triangle.
    pub(crate) fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|k| self.vertices[k as usize].point)
    }

    /// A box around all faces.
    pub(crate) fn bounds(&self) -> Aabb {
        Aabb::around(self.vertices.iter().map(|vertex| vertex.point))
    }

    /// Whether a triangle of a mesh is of the polygons of the file, and not of a face.
    pub(crate) fn is_polygon(&self, [a, b, c]: [DVec3; 3]) -> bool {
        let places = [(a + b + c) / 3.0, a, b, c];
        let of_polygons = |p: &DVec3| self.polygons.nearest_within(*p, self.rounding).is_some();
        let of_faces = |p: &DVec3| {
            let foot = self.nearest(*p);
            foot.is_some_and(|foot| foot.distance <= self.rounding)
        };
        places.iter().all(of_polygons) && !places.iter().all(of_faces)
    }

    /// The nearest triangle of each face that may be the nearest if faces are nearer than their
    /// triangles by `slack`: distance, face, and what was found; a few more may be among them.
    fn nearest_triangles(&self, p: DVec3, slack: f64) -> Vec<(u32, Found)> {
        let mut found: Vec<(u32, Found)> = Vec::new();
        let mut reach = f64::INFINITY;
        self.boxes.visit(p, reach, |number| {
            let face = &self.faces[number as usize];
            if let Some(mut own) = face.tree.nearest_within(p, reach) {
                reach = reach.min(own.distance * (1.0 + ROUNDING) + slack);
                own.triangle += face.first;
                found.push((number, own));
            }
            reach * reach
        });
        found.sort_by(|a, b| a.1.distance.total_cmp(&b.1.distance).then(a.0.cmp(&b.0)));
        found
    }

    /// The number of the triangle nearest to `p`; `None` if there is none.
    pub(crate) fn nearest_triangle(&self, p: DVec3) -> Option<usize> {
        let found = self.nearest_triangles(p, 0.0);
        Some(found.first()?.1.triangle as usize)
    }

    /// The point of all faces nearest to `p`, `None` if there is no face.
    ///
    /// It is one where the distance has a minimum on its face or on the rim of its face, and
    /// the least of those of all faces whose triangles come near enough.
    pub(crate) fn nearest(&self, p: DVec3) -> Option<Foot> {
        let tried = self.nearest_triangles(p, 2.0 * self.reach);
        let first = tried.first()?.1;
        let mut best: Option<Foot> = None;
        for (face, found) in tried.into_iter().take(FACES_TRIED) {
            let known = best.map_or(f64::INFINITY, |best| best.distance);
            // The face may be nearer than its triangles by what is proven, not more.
            let proven = self.faces[face as usize].proven;
            let nearest = first.distance * (1.0 + ROUNDING) + proven + self.reach;
            if found.distance > nearest || found.distance - proven >= known {
                continue;
            }
            let corners = self.triangles[found.triangle as usize];
            let shares = corners.iter().zip(found.closest.shares);
            let guess = shares.map(|(k, share)| self.vertices[*k as usize].uv * share);
            let foot = self.foot(face, p, guess.sum());
            if foot.distance < known {
                let triangle = first.triangle;
                best = Some(Foot { triangle, ..foot });
            }
        }
        best
    }

    /// The point of all faces nearest to `p`, where `known` is one that may not be the nearest.
    ///
    /// Every part of a triangle that may come nearer than what is known is divided: the surface over it is
    /// not farther from the flat part than is proven.
    pub(crate) fn surest(&self, p: DVec3, known: Foot) -> Foot {
        let mut best = known;
        let mut open: Vec<(u32, [(DVec2, DVec3); 3])> = Vec::new();
        for (face, number) in self.faces.iter().zip(0..) {
            let reach = known.distance + face.proven.min(known.distance);
            face.tree.within(p, reach, |found| {
                let triangle = (face.first + found.triangle) as usize;
                if found.distance - self.chords[triangle] < known.distance {
                    let corners = self.triangles[triangle].map(|k| &self.vertices[k as usize]);
                    open.push((number, corners.map(|vertex| (vertex.uv, vertex.point))));
                }
            });
        }
        let mut looked = 0;
        while !open.is_empty() && looked < PARTS {
            looked += open.len();
            let mut parts = Vec::new();
            for (number, corners) in open {
                let face = &self.faces[number as usize];
                let quarters = quarters(corners, |from, to| {
                    let uv = face.pieces.place([from.0, to.0], [0.5; 2]);
                    (uv, face.patch.surface.evaluate(uv))
                });
                for (uv, point) in quarters[3] {
                    let (distance, inside) = (point.distance(p), face.region.as_ref());
                    if distance < best.distance && inside.is_none_or(|r| r.contains(uv)) {
                        best = Foot {
                            face: number,
                            uv,
                            point,
                            distance,
                            ..known
                        };
                    }
                }
                for part in quarters {
                    let flat = closest(part.map(|corner| corner.1), p);
                    let chord = face.chord(part.map(|corner| corner.0));
                    parts.push((flat.point.distance(p) - chord, (number, part)));
                }
            }
            parts.retain(|(least, _)| *least < best.distance * (1.0 - SURE));
            open = parts.into_iter().map(|(_, part)| part).collect();
        }
        if best.distance < known.distance {
            let foot = self.foot(best.face, p, best.uv);
            if foot.distance < best.distance {
                return foot;
            }
        }
        best
    }

    /// The point of a face nearest to `p`, looked for from `guess` on.
    pub(crate) fn foot(&self, face: u32, p: DVec3, guess: DVec2) -> Foot {
        let own = &self.faces[face as usize];
        let found = own.nearby.near(p, guess);
        let foot = |uv: DVec2, point: DVec3| Foot {
            face,
            uv,
            point,
            distance: point.distance(p),
            triangle: u32::MAX,
        };
        if own.region.as_ref().is_none_or(|r| r.contains(found.uv)) {
            return foot(found.uv, found.point);
        }
        match own.nearest_on_rim(p) {
            Some((uv, point)) => foot(uv, point),
            // Loops without a curve in the domain bound nothing.
            None => foot(found.uv, found.point),
        }
    }
}

/// The triangles of a face.
#[derive(Default)]
struct Part {
    vertices: Vec<(DVec2, DVec3)>,
    triangles: Vec<[u32; 3]>,
    chords: Vec<f64>,
}

impl<'a> Face<'a> {
    fn new(patch: &'a Patch) -> Self {
        let surface = &patch.surface;
        let region = patch.region();
        // Curves that are points add nothing to the ends of those beside them, but crowd these out.
        let pieces = Pieces::new(surface);
        let least = pieces.domain().size() * POINT;
        let is_point = |curve: &Curve<DVec2>| {
            let start = curve.start();
            curve.points().all(|p| (p - start).abs().cmple(least).all())
        };
        let mut rims = match region {
            Some(_) => patch.trim_curves(),
            None => Vec::new(),
        };
        rims.retain(|curve| !is_point(curve));
        let closed = nearest::closed(surface);
        let nearby = Nearby::new(surface, closed);
        let mut rim = Vec::new();
        for (curve, number) in rims.iter().zip(0..) {
            for piece in curve.knots().breaks().windows(2) {
                let step = (piece[1] - piece[0]) / RIM_SAMPLES as f64;
                for k in 0..=RIM_SAMPLES {
                    let t = piece[0] + step * k as f64;
                    let point = surface.evaluate(nearby.wrapped(curve.evaluate(t)));
                    let curve = number;
                    rim.push(RimPoint { curve, t, point });
                }
            }
        }
        Self {
            patch,
            pieces,
            region,
            closed,
            nearby,
            rims,
            rim,
            tree: TriangleTree::new(Vec::new()),
            first: 0,
            proven: 0.0,
            inwards: None,
        }
    }

    /// How far the surface over a triangle of parameters is from the flat triangle with the
    /// same corners, at the parameters that belong to its points, at most.
    pub(crate) fn chord(&self, uvs: [DVec2; 3]) -> f64 {
        self.pieces.off_flat(uvs, (0.0, 0.0), || false)
    }

    /// Whether two places are closer than a quarter of the domain.
    pub(crate) fn are_close(&self, a: DVec2, b: DVec2) -> bool {
        let near = self.pieces.domain().size() * 0.25;
        (a - b).abs().cmple(near).all()
    }

    /// The parameters of the same point that are nearest to `base`, where there is a choice
    /// at the ends of a closed surface.
    pub(crate) fn beside(&self, uv: DVec2, base: DVec2) -> DVec2 {
        let domain = self.pieces.domain();
        let mut moved = uv;
        for axis in 0..2 {
            let period = domain.max[axis] - domain.min[axis];
            let slack = SEAM * period;
            for shifted in [uv[axis] - period, uv[axis] + period] {
                let inside =
                    shifted >= domain.min[axis] - slack && shifted <= domain.max[axis] + slack;
                let nearer = (shifted - base[axis]).abs() < (moved[axis] - base[axis]).abs();
                if self.closed[axis] && inside && nearer {
                    moved[axis] = shifted.max(domain.min[axis]).min(domain.max[axis]);
                }
            }
        }
        moved
    }

    /// The point of the trim curves nearest to `p`.
    fn nearest_on_rim(&self, p: DVec3) -> Option<(DVec2, DVec3)> {
        let mut nearest: Vec<(f64, &RimPoint)> = Vec::new();
        let mut before = (u32::MAX, f64::INFINITY);
        for (k, rim) in self.rim.iter().enumerate() {
            let here = (rim.curve, rim.point.distance_squared(p));
            let nears = before.0 != here.0 || here.1 < before.1;
            before = here;
            if !nears
                || nearest
                    .get(RIM_TRIED - 1)
                    .is_some_and(|last| last.0 <= here.1)
            {
                continue;
            }
            let next = self.rim.get(k + 1).filter(|next| next.curve == rim.curve);
            // At a corner several curves begin and end, and only one may come nearer.
            if next.is_none_or(|next| here.1 <= next.point.distance_squared(p)) {
                let place = nearest.partition_point(|known| known.0 <= here.1);
                nearest.insert(place, (here.1, rim));
                nearest.truncate(RIM_TRIED);
            }
        }
        let found = nearest.iter().map(|(_, rim)| self.along_rim(rim, p));
        found.min_by(|a, b| a.1.distance(p).total_cmp(&b.1.distance(p)))
    }

    /// Steps along a trim curve towards the point nearest to `p`.
    fn along_rim(&self, start: &RimPoint, p: DVec3) -> (DVec2, DVec3) {
        let curve = &self.rims[start.curve as usize];
        let domain = curve.domain();
        let at = |t: f64| {
            let (uv, way) = curve.tangent(t);
            let uv = self.nearby.wrapped(uv);
            let (point, [du, dv]) = self.patch.surface.tangents(uv);
            (uv, point, du * way.x + dv * way.y)
        };
        let (mut t, mut here) = (start.t, at(start.t));
        let mut damping = 1.0;
        for _ in 0..RIM_STEPS {
            let step = (p - here.1).dot(here.2) / here.2.length_squared() * damping;
            let next = (t + step).max(domain.start).min(domain.end);
            let there = at(next);
            // What is not a number ends the search, too.
            if there.1.distance_squared(p) < here.1.distance_squared(p) {
                (t, here) = (next, there);
            } else if damping > 1e-3 && step.is_finite() {
                damping *= 0.25;
            } else {
                break;
            }
        }
        (here.0, here.1)
    }
}
