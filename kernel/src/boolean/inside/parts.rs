//! Faces divided into cells.

use std::collections::VecDeque;

use super::Face;
use super::cell::Cell;
use crate::{BezierSurface, Cover, KnotVector, Surface, TrimRegion, nearest};

/// A Bézier piece is not divided into more cells than this.
const MOST: usize = 2048;

/// It is halved no more often along one parameter: next to a pole cells are never flat.
const HALVINGS: u32 = 24;

/// Halves are more even if derivatives stray less than this share of what they did.
const GAIN: f64 = 0.9;

/// Cells of fewer times the size of gaps are not divided.
const SMALL: f64 = 10.0;

/// Cells that are flat are halved so often to leave away what does not belong to the face.
const TRIMMED: u32 = 4;

/// A part of a Bézier piece.
struct Part {
    piece: BezierSurface,
    cell: Cell,
    halvings: [u32; 2],
}

/// The cells of a face.
pub(super) fn cells(number: usize, face: &Face, gap: f64) -> Vec<Cell> {
    let mut cells = Vec::new();
    for piece in face.surface.bezier_pieces() {
        divide(number, face, piece, gap, &mut cells);
    }
    let own = borders(&face.surface, gap);
    let domains = [face.surface.knots_u(), face.surface.knots_v()].map(KnotVector::domain);
    for cell in &mut cells {
        for (axis, domain) in domains.iter().enumerate() {
            // Halves of ranges end where others start, up to rounding.
            let near = (domain.end - domain.start) * 1e-12;
            let (start, end) = (cell.start[axis], cell.start[axis] + cell.size[axis]);
            let ends = [start <= domain.start + near, end >= domain.end - near];
            cell.borders[axis] = [0, 1].map(|side| ends[side] && own[axis][side]);
        }
    }
    cells
}

/// Which sides of a surface are borders: not those where it is closed, nor poles.
fn borders(surface: &Surface, gap: f64) -> [[bool; 2]; 2] {
    let closed = surface.closed();
    [0, 1].map(|axis| {
        [0, 1].map(|side| !closed[axis] && nearest::pole(surface, axis, side, gap * 0.01).is_none())
    })
}

/// Appends the cells of a Bézier piece, the large ones divided first.
fn divide(number: usize, face: &Face, piece: BezierSurface, gap: f64, cells: &mut Vec<Cell>) {
    let region = face.region.as_ref();
    let part = |piece: BezierSurface, halvings| Part {
        cell: Cell::new(number, &piece),
        piece,
        halvings,
    };
    let mut queue = VecDeque::from([part(piece, [0; 2])]);
    let mut made = 0;
    while let Some(mut next) = queue.pop_front() {
        next.cell.is_whole = match cover(region, &next.piece) {
            Cover::Outside => continue,
            Cover::Inside => true,
            Cover::Mixed => false,
        };
        let is_done = next.cell.is_flat()
            || made + queue.len() >= MOST
            || next.cell.bounds().diagonal() < SMALL * gap;
        let halves = if is_done { None } else { halved(&next, &part) };
        if let Some(halves) = halves {
            queue.extend(halves);
            continue;
        }
        made += 1;
        match region {
            Some(region) if !next.cell.is_whole => {
                cells.extend(trimmed(number, region, &next.piece, TRIMMED));
            }
            _ => cells.push(next.cell),
        }
    }
}

/// Both halves along that parameter along which halves are more even, or else along the one that was halved less.
fn halved(whole: &Part, part: &impl Fn(BezierSurface, [u32; 2]) -> Part) -> Option<[Part; 2]> {
    // Without a plane in the middle nothing is known of a cell.
    let unevenness = |part: &Part| part.cell.unevenness().min(1e3);
    let along = |axis: usize| {
        let mut halvings = whole.halvings;
        halvings[axis] += 1;
        let halves = if axis == 0 {
            whole.piece.split_u(0.5)
        } else {
            whole.piece.split_v(0.5)
        };
        halves.map(|piece| part(piece, halvings))
    };
    let mean = |halves: &[Part; 2]| unevenness(&halves[0]).midpoint(unevenness(&halves[1]));
    let [along_u, along_v] = [along(0), along(1)];
    let (u, v) = (mean(&along_u), mean(&along_v));
    let is_u = if u.min(v) < GAIN * unevenness(whole) {
        u < v
    } else {
        whole.halvings[0] < whole.halvings[1]
    };
    let halves = if is_u { along_u } else { along_v };
    let is_enough = halves[0].halvings.iter().all(|&times| times <= HALVINGS);
    is_enough.then_some(halves)
}

/// The cells of a flat part that is partly in a region: one, unless halving it leaves something away.
fn trimmed(number: usize, region: &TrimRegion, piece: &BezierSurface, levels: u32) -> Vec<Cell> {
    let cover = cover(Some(region), piece);
    if cover == Cover::Outside {
        return Vec::new();
    }
    let mut cell = Cell::new(number, piece);
    cell.is_whole = cover == Cover::Inside;
    if cell.is_whole || levels == 0 {
        return vec![cell];
    }
    let halves = if levels.is_multiple_of(2) {
        piece.split_u(0.5)
    } else {
        piece.split_v(0.5)
    };
    let parts = halves.map(|half| trimmed(number, region, &half, levels - 1));
    let parts: Vec<Cell> = parts.into_iter().flatten().collect();
    let left: f64 = parts.iter().map(|part| part.size.element_product()).sum();
    if left > 0.999 * cell.size.element_product() {
        return vec![cell];
    }
    parts
}

/// What of a part belongs to a region.
fn cover(region: Option<&TrimRegion>, piece: &BezierSurface) -> Cover {
    region.map_or(Cover::Inside, |region| {
        region.classify(piece.u(), piece.v())
    })
}
