//! One ray on its way through the scene, always to what can be nearest next.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::Range;

use kernel::{Interval, Ray, Shape};

use super::cell::{Cell, Verdict};
use super::certificate::{Ambiguity, Certificate};
use super::line::Line;
use super::surface::Piece;
use super::tree::Content;
use super::{Certifier, Leaf, Place, Side, triangle};

/// Cells of one ray after which it is given up.
const PATIENCE: u32 = 1 << 14;

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

/// The state of one ray.
pub(super) struct Search<'a> {
    certifier: &'a Certifier<'a>,
    ray: &'a Ray,
    line: Line,
    heap: BinaryHeap<Entry>,
    spare: Vec<Interval>,
}

impl<'a> Search<'a> {
    pub(super) fn new(certifier: &'a Certifier<'a>, ray: &'a Ray) -> Self {
        Self {
            certifier,
            ray,
            line: Line::new(ray),
            heap: BinaryHeap::new(),
            spare: Vec::new(),
        }
    }

    /// Searches below the node `root`.
    pub(super) fn run(mut self, root: u32) -> Certificate {
        self.add_node(root);
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
        let global = |range: &Range<f64>, x: Interval| {
            let [start, end] = [range.start, range.end].map(Interval::point);
            start + (end - start) * x
        };
        self.certifier
            .side(id, global(&piece.u, u), global(&piece.v, v))
    }
}
