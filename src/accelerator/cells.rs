//! Bézier pieces in their own units, and the cells they are divided into.

use std::hint::black_box;
use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use kernel::{Aabb, BezierSurface, Cover, Surface, TrimRegion};

use super::expansion::{DIVISION, Expansion, HIERARCHY, ORDER};
use super::tree::WIDTH;
use crate::intersect::PieceNet;
use crate::intersect::Rect;
use crate::intersect::net::Degrees;
use crate::memory::reserve;
use crate::simd::{Instructions, Simd, Task};

/// How often pieces are halved at most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Halvings {
    /// When the hierarchy is built.
    first: u8,
    /// The same further, of pieces of which not all powers are kept, where each of the halves is sure to be
    /// more even: not at poles.
    further: u8,
    /// What is then still uneven, when rays come to it; the rest is divided ray by ray.
    later: u8,
}

impl Halvings {
    /// Where there are many patches: not all of them are seen, and memory counts. Rays come to
    /// as many parts as a block has room for.
    const MANY: Self = Self {
        first: 0,
        further: 0,
        later: 3,
    };

    /// In a scene that stores and shows so many patches, in a cluster of patches with so many pieces each.
    pub(crate) fn of((stored, shown): (usize, usize), pieces: impl Iterator<Item = usize>) -> Self {
        if stored > MANY {
            return Self::MANY;
        }
        // What pieces of high degree want, unless cells could become too many.
        let room = CELLS >> FIRST;
        let room = room.checked_div(pieces.sum()).unwrap_or(0);
        let doubled = room.checked_ilog2().unwrap_or(0);
        Self {
            // Few rays come to each of many.
            first: if shown > MANY { FIRST - 2 } else { FIRST },
            further: u8::try_from(doubled).map_or(FIRST, |most| most.min(FIRST)),
            later: 0,
        }
    }
}

/// More patches than this are many.
const MANY: usize = 2048;

/// Halvings of pieces where patches are few.
const FIRST: u8 = 6;

/// Pieces are not halved further if there could be more cells than this.
const CELLS: usize = 1 << 18;

/// Further halvings of cells through which a trim loop passes: two along each direction.
const TRIM_HALVINGS: u8 = 4;

/// Points that processors fetch from memory together.
const POINTS_OF_A_LINE: usize = 2;

/// A Bézier piece: the place of its net, and where it belongs.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// First point of its net.
    first: usize,
    pub(crate) degrees: Degrees,
    /// Whether weights differ.
    pub(crate) is_rational: bool,
    /// The item of the cluster that it is part of.
    pub(crate) item: u32,
    /// Middle of its unit ball in the cluster.
    pub(crate) center: DVec3,
    /// Radius of its unit ball in the cluster.
    pub(crate) radius: f64,
    /// The part of the patch's domain: start and length along u and v.
    pub(crate) u: (f64, f64),
    pub(crate) v: (f64, f64),
}

impl Piece {
    /// The parameters of the patch for those of the piece, from 0 to 1.
    #[inline(always)]
    pub(crate) fn parameters(&self, local: DVec2) -> DVec2 {
        DVec2::new(self.u.0 + self.u.1 * local.x, self.v.0 + self.v.1 * local.y)
    }
}

/// A dyadic part of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cell {
    pub(crate) piece: u32,
    /// Along u and v: the number of the part, behind a leading one for each halving.
    place: [u16; 2],
    /// Whether a trim loop passes through it, so that points have to be tested.
    pub(crate) is_trimmed: bool,
    /// Where it is too uneven: how often it is halved along u and v for rays that come to it.
    grid: [u8; 2],
}

impl Cell {
    /// That of no piece.
    pub(crate) const NONE: Self = Self {
        piece: 0,
        place: [1; 2],
        is_trimmed: false,
        grid: [0; 2],
    };

    /// Whether rays meet parts of it instead.
    pub(crate) fn is_coarse(&self) -> bool {
        self.grid != [0; 2]
    }

    /// All of a piece.
    pub(crate) fn whole(piece: u32) -> Self {
        Self {
            piece,
            ..Self::NONE
        }
    }

    /// The cell in local parameters of its piece.
    pub(crate) fn rect(&self) -> Rect {
        let side = |axis: usize| {
            let place = self.place[axis];
            let parts = 1_u32 << place.ilog2();
            let size = f64::from(parts).recip();
            let start = f64::from(u32::from(place) - parts) * size;
            (start, start + size)
        };
        Rect {
            u: side(0),
            v: side(1),
        }
    }

    /// The two halves along u or v, or along the other where that is as fine as it gets.
    pub(crate) fn halves(&self, axis: usize) -> [Self; 2] {
        let axis = if self.place[axis] >> 15 == 0 {
            axis
        } else {
            1 - axis
        };
        [0, 1].map(|half| {
            let mut child = *self;
            child.place[axis] = child.place[axis] << 1 | half;
            child
        })
    }

    /// How often it is halved along u and v for rays that come to it.
    pub(crate) fn grid(&self) -> [u8; 2] {
        self.grid
    }

    /// The parts of a coarse cell, as many as a block has room for: along v first.
    pub(crate) fn parts(&self) -> impl Iterator<Item = Self> {
        let [u, v] = self.grid;
        let whole = Self {
            grid: [0; 2],
            ..*self
        };
        (0_u16..1 << (u + v)).map(move |k| Self {
            place: [
                whole.place[0] << u | k >> v,
                whole.place[1] << v | k & ((1 << v) - 1),
            ],
            ..whole
        })
    }

    /// A number that only this cell has within its cluster.
    pub(crate) fn key(&self) -> u64 {
        let [u, v] = self.place.map(u64::from);
        u64::from(self.piece) << 32 | u << 16 | v
    }
}

/// The surface of a cell seen from its middle: `S(s, t) = center + a s + b t + rest` with `s`
/// and `t` from -1 to 1, in the coordinates of the cluster.
///
/// `rows` invert the matrix of `a`, `b` and a normal; along these `half` bounds the rest and
/// `stray` the sums of its derivatives, and of those of the weight ([`Expansion`]).
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellFrame {
    pub(crate) center: DVec3,
    pub(crate) rows: [DVec3; 3],
    pub(crate) half: [f64; 3],
    pub(crate) stray: [f64; 4],
}

impl CellFrame {
    /// Of a part of a piece in its ball.
    #[inline(always)]
    pub(super) fn of(local: &Expansion, center: DVec3, radius: f64) -> Self {
        Self {
            center: local.center * radius + center,
            rows: local.rows.map(|row| row / radius),
            half: local.half,
            stray: local.stray,
        }
    }
}

/// Cells that are kept together at most: those of a block.
pub(crate) const GROUP: usize = WIDTH;

/// All pieces and cells of a cluster.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pieces {
    pub(crate) pieces: Vec<Piece>,
    nets: Vec<[f64; 4]>,
}

/// A Bézier piece of a surface as the scene has it.
pub(crate) struct Source<'a> {
    degrees: Degrees,
    net: &'a [DVec4],
    /// The part of the domain.
    u: Range<f64>,
    v: Range<f64>,
}

impl<'a> Source<'a> {
    /// A surface that is one piece, if it is.
    pub(crate) fn whole(surface: &'a Surface) -> Option<Self> {
        let (u, v) = (surface.knots_u(), surface.knots_v());
        (u.is_bezier() && v.is_bezier()).then(|| Self {
            degrees: Degrees {
                p: u.degree(),
                q: v.degree(),
            },
            net: surface.homogeneous(),
            u: u.domain(),
            v: v.domain(),
        })
    }

    /// A box around the control points.
    fn hull_bounds(&self) -> Aabb {
        if self.net.iter().all(|h| (h.w - 1.0).abs() <= 0.0) {
            return Aabb::around(self.net.iter().map(|h| h.truncate()));
        }
        Aabb::around(self.net.iter().map(|h| h.truncate() / h.w))
    }
}

impl<'a> From<&'a BezierSurface> for Source<'a> {
    fn from(piece: &'a BezierSurface) -> Self {
        Self {
            degrees: Degrees {
                p: piece.degree_u(),
                q: piece.degree_v(),
            },
            net: piece.homogeneous(),
            u: piece.u(),
            v: piece.v(),
        }
    }
}

/// A cell while the hierarchy is built.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NewCell {
    pub(crate) cell: Cell,
    pub(crate) frame: CellFrame,
    pub(crate) bounds: Aabb,
}

/// Pieces and cells of a part of a cluster, while the hierarchy is built.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    pub(crate) pieces: Pieces,
    pub(crate) cells: Vec<NewCell>,
    /// Places among `cells` of neighbours in one piece, all of which are in one group.
    pub(crate) groups: Vec<Range<usize>>,
}

impl Parts {
    /// Adds a piece of item number `item`, and its cells.
    ///
    /// A piece that is no more than a point or a curve has nothing to hit and is left out, and so
    /// are cells outside of `trims`.
    pub(crate) fn add(
        &mut self,
        piece: &Source<'_>,
        (item, halvings): (u32, Halvings),
        trims: Option<&TrimRegion>,
    ) {
        let hull = piece.hull_bounds();
        let (center, radius) = (hull.center(), hull.diagonal() * 0.5);
        if radius <= 0.0 || radius.is_nan() {
            return;
        }
        let degrees = piece.degrees;
        let heaviest = piece.net.iter().fold(0.0, |max: f64, h| max.max(h.w));
        // Into the units of the piece.
        let (scale, weight) = ((radius * heaviest).recip(), heaviest.recip());
        let own = |h: &DVec4| {
            let place = if (h.w - 1.0).abs() <= 0.0 {
                h.truncate() - center
            } else {
                // Rounded once: neighbours have other centers, and their common border must not differ.
                (-center).mul_add(DVec3::splat(h.w), h.truncate())
            };
            (place * scale).extend(h.w * weight).to_array()
        };
        let first = self.pieces.nets.len();
        self.pieces.nets.extend(piece.net.iter().map(own));
        let number = u32::try_from(self.pieces.pieces.len()).expect("fewer pieces than fit");
        let (u, v) = (&piece.u, &piece.v);
        self.pieces.pieces.push(Piece {
            first,
            degrees,
            is_rational: piece.net.iter().any(|h| h.w < heaviest),
            item,
            center,
            radius,
            u: (u.start, u.end - u.start),
            v: (v.start, v.end - v.start),
        });
        let cell = Cell::whole(number);
        let further = if degrees.p.max(degrees.q) < ORDER {
            0
        } else {
            halvings.further
        };
        let divider = Divider {
            instructions: Instructions::best(),
            further,
            later: halvings.later,
            net: PieceNet {
                degrees,
                points: &self.pieces.nets[first..],
            },
            center,
            radius,
            hull,
            u: piece.u.clone(),
            v: piece.v.clone(),
        };
        let trims = trims.map(|t| (t, TRIM_HALVINGS));
        let (cells, groups) = (&mut self.cells, &mut self.groups);
        let before = (cells.len(), groups.len());
        let most = halvings.first + further;
        let open = divider.divide(cell, most, trims, (cells, groups));
        let is_even = |new: &NewCell| new.frame.stray[0] < 1.0;
        if !cells[before.0..].first().is_some_and(is_even) && divider.net.is_curve() {
            cells.truncate(before.0);
            groups.truncate(before.1);
            self.pieces.nets.truncate(first);
            self.pieces.pieces.pop();
            return;
        }
        groups.push(cells.len() - open..cells.len());
    }

    /// Appends what belongs to other patches.
    pub(crate) fn append(&mut self, other: Self) {
        let (first, before) = (self.pieces.nets.len(), self.cells.len());
        let number = u32::try_from(self.pieces.pieces.len()).expect("fewer pieces than fit");
        self.pieces.nets.extend(other.pieces.nets);
        let pieces = other.pieces.pieces.into_iter();
        self.pieces.pieces.extend(pieces.map(|piece| Piece {
            first: piece.first + first,
            ..piece
        }));
        self.cells.extend(other.cells.into_iter().map(|mut new| {
            new.cell.piece += number;
            new
        }));
        let groups = other.groups.into_iter();
        let moved = groups.map(|group| group.start + before..group.end + before);
        self.groups.extend(moved.filter(|group| !group.is_empty()));
    }

    /// Makes room for so many times as much as `some`.
    pub(crate) fn reserve(&mut self, some: &[Self], times: usize) {
        let room = |count: fn(&Self) -> usize| some.iter().map(count).sum::<usize>() * times;
        reserve(&mut self.pieces.pieces, room(|s| s.pieces.pieces.len()));
        reserve(&mut self.pieces.nets, room(|s| s.pieces.nets.len()));
        reserve(&mut self.cells, room(|s| s.cells.len()));
        reserve(&mut self.groups, room(|s| s.groups.len()));
    }

    /// The item of a group.
    pub(crate) fn item(&self, group: usize) -> usize {
        let cell = &self.cells[self.groups[group].start].cell;
        self.pieces.pieces[cell.piece as usize].item as usize
    }

    /// The box around each group.
    pub(crate) fn boxes(&self) -> Vec<Aabb> {
        let around = |group: &Range<usize>| {
            let boxes = self.cells[group.clone()].iter().map(|cell| cell.bounds);
            boxes.fold(Aabb::EMPTY, Aabb::union)
        };
        self.groups.iter().map(around).collect()
    }
}

impl Pieces {
    /// The net of a piece.
    pub(crate) fn net(&self, piece: &Piece) -> PieceNet<'_> {
        PieceNet {
            degrees: piece.degrees,
            points: &self.nets[piece.first..piece.first + piece.degrees.len()],
        }
    }

    /// Has the net of a cell's piece on its way from memory while other work goes on.
    #[inline(always)]
    pub(crate) fn call(&self, cell: &Cell) {
        let net = self.net(&self.pieces[cell.piece as usize]);
        for points in net.points.chunks(POINTS_OF_A_LINE) {
            black_box(points[0][0]);
        }
    }

    /// Memory in use.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.pieces[..]) + size_of_val(&self.nets[..])
    }
}

/// Divides a piece into cells.
struct Divider<'a> {
    instructions: Instructions,
    /// See [`Halvings`].
    further: u8,
    later: u8,
    net: PieceNet<'a>,
    /// From the units of the piece to the cluster.
    center: DVec3,
    radius: f64,
    /// The box of the piece.
    hull: Aabb,
    /// The part of the patch's domain.
    u: Range<f64>,
    v: Range<f64>,
}

impl Divider<'_> {
    /// Divides a cell until it is nearly flat and evenly parametrised or `halvings` are used
    /// up, and further, by the number beside `trims`, where a loop passes.
    ///
    /// Neighbours are grouped as long as a group has room. The result is the number of cells at
    /// the end that belong to no group yet.
    fn divide(
        &self,
        mut cell: Cell,
        halvings: u8,
        trims: Option<(&TrimRegion, u8)>,
        (cells, groups): (&mut Vec<NewCell>, &mut Vec<Range<usize>>),
    ) -> usize {
        let rect = cell.rect();
        let cover = trims.map_or(Cover::Inside, |(region, _)| {
            let part = |domain: &Range<f64>, (a, b): (f64, f64)| {
                let length = domain.end - domain.start;
                domain.start + length * a..domain.start + length * b
            };
            region.classify(part(&self.u, rect.u), part(&self.v, rect.v))
        });
        if cover == Cover::Outside {
            return 0;
        }
        let trims = trims.filter(|_| cover == Cover::Mixed);
        cell.is_trimmed = trims.is_some();
        let outline = self.instructions.run(Outlined {
            divider: self,
            rect: &rect,
            halvings,
        });
        let (axis, halvings, trims) = match (outline.cut, trims) {
            (Some(cut_v), _) => (usize::from(cut_v), halvings - 1, trims),
            (None, Some((region, left @ 1..))) => (
                usize::from(left % 2 == 1),
                halvings,
                Some((region, left - 1)),
            ),
            _ => {
                cell.grid = outline.grid;
                cells.push(NewCell {
                    cell,
                    frame: outline.frame,
                    bounds: outline.bounds,
                });
                return 1;
            }
        };
        let [left, right] = cell.halves(axis);
        let first = self.divide(left, halvings, trims, (cells, groups));
        let border = cells.len();
        let second = self.divide(right, halvings, trims, (cells, groups));
        let end = cells.len();
        if first == 0 || first + second <= GROUP && border + second == end {
            return first + second;
        }
        groups.push(border - first..border);
        second
    }
}

/// What is to know of a part of a piece before it is divided or kept.
struct Outline {
    frame: CellFrame,
    bounds: Aabb,
    /// Whether to cut along v, where it is to be cut.
    cut: Option<bool>,
    /// See [`Cell`].
    grid: [u8; 2],
}

/// Outlines the part `rect` of a piece that may still be halved so often.
struct Outlined<'a> {
    divider: &'a Divider<'a>,
    rect: &'a Rect,
    halvings: u8,
}

impl Task for Outlined<'_> {
    type Output = Outline;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Outline {
        let Divider {
            net,
            center,
            radius,
            hull,
            further,
            later,
            ..
        } = self.divider;
        let mut local = if self.halvings > 0 {
            Expansion::of::<S, DIVISION>(s, net, self.rect)
        } else {
            Expansion::of::<S, HIERARCHY>(s, net, self.rect)
        };
        let is_uneven = local.excess() > 1.0;
        let kept = if local.has_frame() { 0 } else { *further };
        let cut = (is_uneven && self.halvings > kept).then_some(local.cut_v);
        if cut.is_none() && is_uneven && self.halvings > 0 {
            local = Expansion::of::<S, HIERARCHY>(s, net, self.rect);
        }
        let (middle, half) = (local.middle * *radius + *center, local.half_size * *radius);
        let is_coarse = is_uneven && self.halvings == 0 && *later > 0;
        Outline {
            frame: CellFrame::of(&local, *center, *radius),
            bounds: Aabb {
                min: (middle - half).max(hull.min),
                max: (middle + half).min(hull.max),
            },
            cut,
            grid: if is_coarse {
                local.grid(*later)
            } else {
                [0; 2]
            },
        }
    }
}
