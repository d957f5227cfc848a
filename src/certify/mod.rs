//! A proof per ray: certified hits and misses, and an honest answer where there is neither.
//!
//! What is proven holds for the surfaces of the scene in exact real arithmetic: the knots as
//! they are stored, the homogeneous control points as they are stored up to the one rounding
//! of their product with the weight, the maps of the nodes multiplied exactly, and the ray
//! as it is given. All numbers in between are intervals with outward rounding. Only the
//! correct rounding of the four operations is assumed of the machine.
//!
//! The distances of a piece from two planes through the ray form a planar net of intervals.
//! A cell whose hull, or preconditioned hull, does not contain zero is empty; where
//! Krawczyk's test succeeds there is exactly one root \[Krawczyk 69\]; otherwise the cell is
//! split. Cells are taken in the order of the least ray parameter that they can have, so
//! that what is behind a certain hit is never looked at. Nothing is shared with the
//! production path, neither hierarchy nor nets: each is a check of the other.

mod cell;
mod line;
mod picture;
mod surface;
mod tree;
mod triangle;

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use kernel::{Interval, Patch, Ray, Scene, Shape};

use crate::intersect::Hit;
use cell::{Cell, Verdict};
use line::{Line, Map};
use surface::Piece;
use tree::{Bounds, Content, Tree};

pub use picture::{CertifyStats, certify_film};

/// Cells of one ray after which it is given up.
const PATIENCE: u32 = 1 << 14;

/// What is known about a ray, from its origin on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Certificate {
    /// Proven: the first thing that the ray meets is this.
    Hit {
        /// Number of the shape, as in [`Hit::shape`].
        shape: u32,
        /// Where along the ray.
        t: Interval,
    },
    /// Proven: the ray meets nothing.
    Miss,
    /// Not proven.
    Ambiguous {
        /// Why.
        reason: Ambiguity,
        /// Proven: up to here the ray meets nothing.
        free: f64,
    },
}

/// Why a ray has no certain first hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ambiguity {
    /// It comes too close to touching a surface, or to a singular point.
    Tangent,
    /// It passes the border of a patch, of one of its pieces or of a triangle too closely,
    /// or starts on a surface.
    Edge,
    /// Two shapes are met at places that cannot be told apart.
    Overlap,
}

impl Certificate {
    /// A number for pictures: 0 miss, 1 hit, 2 tangent, 3 edge, 4 overlap.
    pub fn code(&self) -> u8 {
        match self {
            Self::Miss => 0,
            Self::Hit { .. } => 1,
            Self::Ambiguous { reason, .. } => match reason {
                Ambiguity::Tangent => 2,
                Ambiguity::Edge => 3,
                Ambiguity::Overlap => 4,
            },
        }
    }

    /// The name of the status.
    pub fn name(&self) -> &'static str {
        ["miss", "hit", "tangent", "edge", "overlap"][usize::from(self.code())]
    }

    /// Whether an answer to the same ray cannot be right, even if its `t` is wrong by
    /// `accuracy`.
    pub fn contradicts(&self, answer: Option<&Hit>, accuracy: f64) -> bool {
        match (self, answer) {
            (Self::Hit { shape, t }, Some(hit)) => {
                hit.shape != *shape || !t.widened(accuracy).contains(hit.t)
            }
            (Self::Hit { .. }, None) | (Self::Miss, Some(_)) => true,
            (Self::Miss | Self::Ambiguous { .. }, None) => false,
            (Self::Ambiguous { free, .. }, Some(hit)) => hit.t < free - accuracy,
        }
    }
}

/// All shapes of a scene, placed in the world one by one and prepared for proofs.
#[derive(Debug)]
pub struct Certifier<'a> {
    scene: &'a Scene,
    places: Vec<Place>,
    /// The pieces of the patches, each patch once.
    pieces: Vec<Piece>,
    leaves: Vec<Leaf>,
    tree: Tree,
}

/// A shape at its place.
#[derive(Debug)]
struct Place {
    shape: Shape,
    number: u32,
    world_from_object: Map,
}

/// A piece or triangle of a place.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    place: u32,
    part: u32,
}

/// On which side of its trim loops a part of a patch lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// In the face as a whole.
    Inside,
    /// Out of the face as a whole.
    Outside,
    /// On both sides, or not known.
    #[expect(dead_code, reason = "loops are not looked at yet")]
    Undecided,
}

/// Where a box in the parameters of a patch lies with regard to the loops that trim it.
///
/// As in the production path, loops are not applied yet: the whole surface counts.
fn trim_side(_patch: &Patch, _u: Interval, _v: Interval) -> Side {
    Side::Inside
}

/// Something on the way of the ray that comes no nearer than `near`.
struct Entry {
    near: f64,
    task: Task,
}

enum Task {
    Node(u32),
    Cell(Box<Cell>),
    Root(Root),
}

/// A root that the ray meets certainly, or perhaps.
#[derive(Clone, Copy)]
struct Root {
    shape: u32,
    t: Interval,
    certain: bool,
}

/// The nearest comes first.
impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        other.near.total_cmp(&self.near)
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

impl<'a> Certifier<'a> {
    /// Prepares `scene`. Shapes shown many times are placed each on its own.
    pub fn build(scene: &'a Scene) -> Self {
        let mut certifier = Self {
            scene,
            places: Vec::new(),
            pieces: Vec::new(),
            leaves: Vec::new(),
            tree: Tree::default(),
        };
        let mut known = HashMap::new();
        let mut boxes = Vec::new();
        let (meshes, patches): (Vec<_>, Vec<_>) = scene
            .placements()
            .into_iter()
            .partition(|p| matches!(p.shape, Shape::Mesh(_)));
        for (number, placement) in patches.iter().chain(&meshes).enumerate() {
            let number = u32::try_from(number).expect("a scene has fewer than 2^32 shapes");
            let map = placement.path.iter().fold(Map::IDENTITY, |map, &id| {
                map.after(&scene.node(id).parent_from_node)
            });
            let parts = match placement.shape {
                Shape::Patch(id) => known
                    .entry(id)
                    .or_insert_with(|| {
                        let first = certifier.pieces.len();
                        let pieces = surface::pieces(&scene.patch(id).surface);
                        certifier.pieces.extend(pieces);
                        first..certifier.pieces.len()
                    })
                    .clone(),
                Shape::Mesh(id) => 0..scene.mesh(id).triangles().len(),
            };
            let place = Place {
                shape: placement.shape,
                number,
                world_from_object: map,
            };
            for part in parts {
                let part = u32::try_from(part).expect("fewer pieces than fit");
                boxes.push(certifier.bounds(&place, part));
                certifier.leaves.push(Leaf {
                    place: number,
                    part,
                });
            }
            certifier.places.push(place);
        }
        certifier.tree = Tree::build(&boxes);
        certifier
    }

    /// A box around a piece or triangle in the world.
    fn bounds(&self, place: &Place, part: u32) -> Bounds {
        let around = |points: &mut dyn Iterator<Item = [Interval; 3]>| {
            let first = points.next().unwrap_or([Interval::ENTIRE; 3]);
            points.fold(first, |all, p| std::array::from_fn(|k| all[k].hull(p[k])))
        };
        match place.shape {
            Shape::Patch(_) => {
                let net = &self.pieces[part as usize].net;
                around(&mut net.iter().map(|h| {
                    let [x, y, z, w] = place.world_from_object.apply(h);
                    [x / w, y / w, z / w]
                }))
            }
            Shape::Mesh(_) => around(&mut self.corners(place, part).into_iter()),
        }
    }

    fn corners(&self, place: &Place, part: u32) -> [[Interval; 3]; 3] {
        let Shape::Mesh(id) = place.shape else {
            return [[Interval::ENTIRE; 3]; 3];
        };
        let mesh = self.scene.mesh(id);
        mesh.triangles()[part as usize].map(|k| {
            let [x, y, z] = mesh.positions()[k as usize].to_array().map(Interval::point);
            let [x, y, z, _] = place
                .world_from_object
                .apply(&[x, y, z, Interval::point(1.0)]);
            [x, y, z]
        })
    }

    /// What can be proven about the first hit of the ray with `t >= 0`.
    ///
    /// A ray without direction, or with a number that is not finite, meets nothing.
    pub fn certify(&self, ray: &Ray) -> Certificate {
        let finite = ray.origin.is_finite() && ray.direction.is_finite();
        let Some(root) = self.tree.root().filter(|_| finite) else {
            return Certificate::Miss;
        };
        if ray.direction == glam::DVec3::ZERO {
            return Certificate::Miss;
        }
        let mut search = Search {
            certifier: self,
            ray,
            line: Line::new(ray),
            heap: BinaryHeap::new(),
            spare: Vec::new(),
        };
        search.add_node(root);
        search.run()
    }
}

/// The state of one ray.
struct Search<'a> {
    certifier: &'a Certifier<'a>,
    ray: &'a Ray,
    line: Line,
    heap: BinaryHeap<Entry>,
    spare: Vec<Interval>,
}

impl Search<'_> {
    fn run(&mut self) -> Certificate {
        let mut nearest: Option<Root> = None;
        let mut cells = 0;
        while let Some(Entry { near, task }) = self.heap.pop() {
            // What follows comes no nearer than this.
            if nearest.is_some_and(|root| near > root.t.high()) {
                break;
            }
            let free = nearest.map_or(near, |root| root.t.low().min(near));
            let ambiguous = |reason| Certificate::Ambiguous { reason, free };
            match task {
                Task::Node(node) => self.open(node),
                Task::Cell(cell) => {
                    cells += 1;
                    let shape = self.certifier.places[cell.place as usize].number;
                    let decided = cells < PATIENCE && self.examine(cell);
                    // A further root of the same shape could not change the answer.
                    if !decided && nearest.is_none_or(|root| root.shape != shape) {
                        return ambiguous(Ambiguity::Tangent);
                    }
                }
                Task::Root(root) => match &mut nearest {
                    Some(first) if first.shape == root.shape => {
                        if root.certain {
                            let high = first.t.high().min(root.t.high());
                            first.t = Interval::new(first.t.low(), high);
                        }
                    }
                    _ if !root.certain => return ambiguous(Ambiguity::Edge),
                    Some(_) => return ambiguous(Ambiguity::Overlap),
                    None => nearest = Some(root),
                },
            }
        }
        match nearest {
            Some(Root { shape, t, .. }) => Certificate::Hit { shape, t },
            None => Certificate::Miss,
        }
    }

    fn add_node(&mut self, node: u32) {
        if let Some(near) = self.certifier.tree.entry(node, self.ray) {
            let task = Task::Node(node);
            self.heap.push(Entry { near, task });
        }
    }

    fn add_cell(&mut self, cell: Box<Cell>) {
        if cell.t.high() >= 0.0 {
            let near = cell.t.low().max(0.0);
            let task = Task::Cell(cell);
            self.heap.push(Entry { near, task });
        }
    }

    fn add_root(&mut self, shape: u32, t: Interval, certain: bool) {
        if t.high() >= 0.0 {
            // Whether the ray starts before or behind a root that may be its origin is open.
            let certain = certain && t.low() > 0.0;
            let near = t.low().max(0.0);
            let task = Task::Root(Root { shape, t, certain });
            self.heap.push(Entry { near, task });
        }
    }

    fn open(&mut self, node: u32) {
        let certifier = self.certifier;
        let leaf = match certifier.tree.content(node) {
            Content::Children(children) => {
                children.into_iter().for_each(|child| self.add_node(child));
                return;
            }
            Content::Leaf(leaf) => certifier.leaves[leaf as usize],
        };
        let place = &certifier.places[leaf.place as usize];
        match place.shape {
            Shape::Mesh(_) => {
                let corners = certifier.corners(place, leaf.part);
                if let Some((t, certain)) = triangle::intersect(&self.line, corners) {
                    self.add_root(place.number, t, certain);
                }
            }
            Shape::Patch(_) => {
                let cell = self.whole(leaf, place);
                self.add_cell(cell);
            }
        }
    }

    /// A piece as one cell.
    fn whole(&self, leaf: Leaf, place: &Place) -> Box<Cell> {
        let piece = &self.certifier.pieces[leaf.part as usize];
        let n = piece.degrees.len();
        let count = if piece.polynomial { 3 } else { 4 };
        let mut nets = vec![Interval::ZERO; count * n];
        for (k, h) in piece.net.iter().enumerate() {
            let distances = self.line.distances(place.world_from_object.apply(h));
            for (net, distance) in distances.into_iter().take(count).enumerate() {
                nets[net * n + k] = distance;
            }
            if piece.polynomial {
                nets[2 * n + k] = distances[2] / distances[3];
            }
        }
        let t = Cell::reach(&nets, piece.degrees);
        Box::new(Cell {
            piece: leaf.part,
            place: leaf.place,
            start: [0.0; 2],
            size: [1.0; 2],
            nets,
            t,
        })
    }

    /// Examines a cell; the result says whether it could be decided or divided.
    fn examine(&mut self, cell: Box<Cell>) -> bool {
        let certifier = self.certifier;
        let place = &certifier.places[cell.place as usize];
        let piece = &certifier.pieces[cell.piece as usize];
        match cell.examine(piece.degrees, &mut self.spare) {
            Verdict::Empty => true,
            Verdict::One { u, v, t } => {
                let whole = Interval::new(0.0, 1.0);
                if u.overlaps(whole) && v.overlaps(whole) {
                    let within = whole.encloses(u) && whole.encloses(v);
                    match self.side(place, piece, [u, v]) {
                        Side::Outside => {}
                        side => {
                            let certain = within && side == Side::Inside;
                            self.add_root(place.number, t, certain);
                        }
                    }
                }
                true
            }
            Verdict::Split(axis) => {
                let [left, right] = cell.halve(piece.degrees, axis);
                for half in [left, right] {
                    let range = |k: usize| {
                        Interval::point(half.start[k])
                            .hull(Interval::point(half.start[k] + half.size[k]))
                    };
                    if self.side(place, piece, [range(0), range(1)]) != Side::Outside {
                        self.add_cell(half);
                    }
                }
                true
            }
            Verdict::Undecided => false,
        }
    }

    /// The side of the trim loops, for a box in the parameters of a piece.
    fn side(&self, place: &Place, piece: &Piece, [u, v]: [Interval; 2]) -> Side {
        let Shape::Patch(id) = place.shape else {
            return Side::Inside;
        };
        let global = |range: &std::ops::Range<f64>, x: Interval| {
            let [start, end] = [range.start, range.end].map(Interval::point);
            start + (end - start) * x
        };
        trim_side(
            self.certifier.scene.patch(id),
            global(&piece.u, u),
            global(&piece.v, v),
        )
    }
}
