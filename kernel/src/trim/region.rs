//! The part of a domain inside an odd number of loops, prepared for queries.
//!
//! A tree divides the domain until few segments are left in each cell. Along a ray from a
//! point of a cell towards larger u, the segments of the cell are counted one by one. Those
//! beyond its right border are never looked at: what they add changes only at heights where
//! a chain of them begins, and such a chain begins at the end of a segment of the cell. So
//! it is enough to let a crossing be added above every such end, and to store for each cell
//! what is left.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::TrimLoop;
use super::monotone::{Rect, Segments};
use crate::Patch;

/// Points of loops so near to a border of the domain, as a share of the domain, are on it.
const SNAP: f64 = 1e-9;

/// How far rounding may move a point where a ray meets a surface, as a share of the domain.
const CLOSE: f64 = 1e-11;

/// Segments stay out of cells that they miss by more than this share of the domain.
const MARGIN: f64 = 1e-12;

/// Cells with no more segments are not divided.
const FEW: usize = 4;

/// Levels of the tree.
const LEVELS: u32 = 40;

/// Dividing stops when segments stand in this many cells on average.
const COPIES: usize = 6;

/// The part of a surface's domain that belongs to a face.
///
/// A point belongs to it if a ray from there crosses the loops an odd number of times;
/// without loops every point does. Points on the border of the domain are treated as if
/// they were just inside it, so that a loop along the border does not lose them.
#[derive(Clone, Debug, PartialEq)]
pub struct TrimRegion {
    segments: Segments,
    nodes: Vec<Node>,
    /// Numbers of segments, in runs that belong to leaves.
    members: Vec<u32>,
    domain: Rect,
    /// The largest parameters just inside the domain.
    last: DVec2,
}

/// What is known about a rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cover {
    /// All of it belongs to the region.
    Inside,
    /// Nothing of it belongs to the region.
    Outside,
    /// A loop passes through it, or close by.
    Mixed,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Node {
    /// Cut across `axis`; the lower half is the next node.
    Split { axis: u8, at: f64, upper: u32 },
    /// A run of members, and what is added to their crossings.
    Leaf {
        first: u32,
        count: u32,
        inside: bool,
    },
}

impl TrimRegion {
    /// The region of a domain that is inside an odd number of loops. Loops may leave the
    /// domain; what lies outside is cut off.
    pub fn new(loops: &[TrimLoop], domain_u: Range<f64>, domain_v: Range<f64>) -> Self {
        Self::periodic(loops, [domain_u, domain_v], [false; 2])
    }

    /// The region of a face. Where the surface is closed, loops that leave its domain come
    /// in again on the other side.
    pub fn of(patch: &Patch) -> Self {
        let surface = &patch.surface;
        let domain = [surface.knots_u().domain(), surface.knots_v().domain()];
        Self::periodic(&patch.loops, domain, surface.closed())
    }

    /// As [`TrimRegion::new`], on a surface that may be closed.
    pub(super) fn periodic(loops: &[TrimLoop], [u, v]: [Range<f64>; 2], closed: [bool; 2]) -> Self {
        let domain = Rect {
            min: DVec2::new(u.start, v.start),
            max: DVec2::new(u.end, v.end),
        };
        let last = DVec2::new(u.end.next_down(), v.end.next_down());
        let mut region = Self {
            segments: segments(loops, &domain, closed),
            nodes: Vec::new(),
            members: Vec::new(),
            domain,
            last,
        };
        region.build(loops.is_empty());
        region
    }

    /// Whether a point belongs to the region; points outside the domain are moved to its
    /// border before.
    pub fn contains(&self, uv: DVec2) -> bool {
        let p = uv.max(self.domain.min).min(self.last);
        let mut right = self.domain.max.x;
        let mut at = 0;
        loop {
            match self.nodes[at] {
                Node::Split { axis: 0, at: u, .. } if p.x < u => {
                    right = u;
                    at += 1;
                }
                Node::Split { axis: 1, at: v, .. } if p.y < v => at += 1,
                Node::Split { upper, .. } => at = upper as usize,
                Node::Leaf { inside, .. } => {
                    return inside ^ self.is_odd(self.run(at), right, p);
                }
            }
        }
    }

    /// As [`Self::contains`], and for points that are no farther from a loop than rounding may move them: what
    /// neighbours have in common belongs to both of them.
    pub fn holds(&self, uv: DVec2) -> bool {
        if self.contains(uv) {
            return true;
        }
        let near = (self.domain.max - self.domain.min) * CLOSE;
        self.is_passed(0, &Rect { min: uv, max: uv }.grown(near))
    }

    /// What is known about a rectangle. Nearby loops count as passing through it, so that an
    /// answer other than [`Cover::Mixed`] also holds for points a little outside.
    pub fn classify(&self, u: Range<f64>, v: Range<f64>) -> Cover {
        let rect = Rect {
            min: DVec2::new(u.start, v.start),
            max: DVec2::new(u.end, v.end),
        };
        let margin = (self.domain.max - self.domain.min) * SNAP;
        let wide = rect.grown(margin).clipped(&self.domain);
        if self.is_passed(0, &wide) {
            Cover::Mixed
        } else if self.contains(rect.center()) {
            Cover::Inside
        } else {
            Cover::Outside
        }
    }

    /// Whether the whole domain belongs to the region.
    pub fn is_whole(&self) -> bool {
        let whole = Node::Leaf {
            first: 0,
            count: 0,
            inside: true,
        };
        self.nodes[0] == whole
    }

    /// Whether no loop leaves anything of the domain, or passes through it.
    pub(super) fn is_empty(&self) -> bool {
        let nothing = Node::Leaf {
            first: 0,
            count: 0,
            inside: false,
        };
        self.nodes[0] == nothing
    }

    /// Memory in use.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
            + size_of_val(&self.members[..])
            + size_of_val(&self.segments.list[..])
            + size_of_val(self.segments.coefficients())
    }

    /// Whether a segment meets the part of a box below a node.
    fn is_passed(&self, node: usize, rect: &Rect) -> bool {
        match self.nodes[node] {
            Node::Split { axis, at, upper } => {
                let axis = usize::from(axis);
                rect.min[axis] <= at && self.is_passed(node + 1, rect)
                    || rect.max[axis] >= at && self.is_passed(upper as usize, rect)
            }
            Node::Leaf { .. } => {
                let coefficients = self.segments.coefficients();
                let touches = |&k: &u32| self.segments.list[k as usize].touches(coefficients, rect);
                self.run(node).iter().any(touches)
            }
        }
    }

    /// The members of a leaf.
    fn run(&self, node: usize) -> &[u32] {
        match self.nodes[node] {
            Node::Leaf { first, count, .. } => {
                &self.members[first as usize..first as usize + count as usize]
            }
            Node::Split { .. } => &[],
        }
    }

    /// The parity of what the members of a cell, whose right border is `right`, add at `p`.
    #[inline]
    fn is_odd(&self, members: &[u32], right: f64, p: DVec2) -> bool {
        let coefficients = self.segments.coefficients();
        let mut odd = false;
        for &k in members {
            let segment = &self.segments.list[k as usize];
            odd ^= segment.is_crossed(coefficients, p);
            // Beyond the cell a chain of other segments goes on.
            odd ^= segment.low.x >= right && segment.low.y <= p.y;
            odd ^= segment.high.x >= right && segment.high.y <= p.y;
        }
        odd
    }

    /// Far more than the rounding errors of points.
    fn margin(&self) -> DVec2 {
        let Rect { min, max } = self.domain;
        (max - min) * MARGIN + min.abs().max(max.abs()) * (64.0 * f64::EPSILON)
    }

    fn build(&mut self, everything: bool) {
        let (domain, middle) = (self.domain, self.domain.center());
        let coefficients: &[DVec3] = self.segments.coefficients();
        let all = self.segments.list.iter();
        let crossed = all.clone().filter(|s| s.is_crossed(coefficients, middle));
        let inside = everything ^ (crossed.count() % 2 == 1);
        let margin = self.margin();
        // Nothing of the domain is on the far side of a segment along its border.
        let is_border = |r: &Rect| {
            (0..2).any(|k| {
                let (min, max) = (r.min[k], r.max[k]);
                max <= domain.min[k] || min >= domain.max[k]
            })
        };
        let wide = domain.grown(margin);
        let members: Vec<u32> = (0_u32..)
            .zip(all)
            .filter(|(_, s)| !is_border(&s.bounds()) && s.touches(coefficients, &wide))
            .map(|(k, _)| k)
            .collect();
        let inside = inside ^ self.is_odd(&members, domain.max.x, middle);
        let mut room = COPIES * members.len();
        self.divide(domain, members, inside, LEVELS, &mut room);
    }

    /// Appends the nodes of a cell; `room` is how many copies of members may still be made.
    fn divide(
        &mut self,
        cell: Rect,
        members: Vec<u32>,
        inside: bool,
        levels: u32,
        room: &mut usize,
    ) {
        let best = if members.len() > FEW && levels > 0 {
            let mut places = [0, 1].map(|axis| self.place(&cell, &members, axis));
            places.sort_by_key(|place| place.size);
            let cuts = places.iter().map(|place| self.cut(&cell, &members, place));
            cuts.flatten().next()
        } else {
            None
        };
        let copies =
            |c: &Cut| (c.halves[0].len() + c.halves[1].len()).saturating_sub(members.len());
        let best = best.filter(|c| copies(c) <= *room);
        let Some(cut) = best else {
            let number = |k: usize| u32::try_from(k).expect("no more members than room");
            self.nodes.push(Node::Leaf {
                first: number(self.members.len()),
                count: number(members.len()),
                inside,
            });
            self.members.extend(members);
            return;
        };
        *room -= copies(&cut);
        // The first half leaves room for the second.
        let sizes = cut.halves.each_ref().map(Vec::len);
        let mut rest = *room * sizes[1] / (sizes[0] + sizes[1]).max(1);
        *room -= rest;
        let node = self.nodes.len();
        let axis = usize::from(cut.axis);
        let mut parts = [cell; 2];
        parts[0].max[axis] = cut.at;
        parts[1].min[axis] = cut.at;
        self.nodes.push(Node::Split {
            axis: cut.axis,
            at: cut.at,
            upper: 0,
        });
        for (k, (part, half)) in parts.into_iter().zip(cut.halves).enumerate() {
            if k == 1 {
                let next = u32::try_from(self.nodes.len()).expect("fewer nodes than members");
                if let Node::Split { upper, .. } = &mut self.nodes[node] {
                    *upper = next;
                }
            }
            let middle = part.center();
            let state = inside
                ^ self.is_odd(&members, cell.max.x, middle)
                ^ self.is_odd(&half, part.max.x, middle);
            self.divide(part, half, state, levels - 1, room);
            *room += std::mem::take(&mut rest);
        }
    }

    /// Where to cut a cell across `axis` between its members.
    fn place(&self, cell: &Rect, members: &[u32], axis: usize) -> Place {
        let bounds = |&k: &u32| self.segments.list[k as usize].bounds().clipped(cell);
        let mut middles: Vec<f64> = members.iter().map(|k| bounds(k).center()[axis]).collect();
        let (_, &mut at, _) = middles.select_nth_unstable_by(members.len() / 2, f64::total_cmp);
        let sides = members.iter().map(|k| {
            let Rect { min, max } = bounds(k);
            usize::from(min[axis] <= at) + usize::from(max[axis] >= at)
        });
        Place {
            axis,
            at,
            size: sides.sum(),
        }
    }

    /// The cut of a cell there, if it helps.
    fn cut(&self, cell: &Rect, members: &[u32], place: &Place) -> Option<Cut> {
        let Place { axis, at, .. } = *place;
        let margin = self.margin();
        let is_inside = cell.min[axis] + margin[axis] < at && at < cell.max[axis] - margin[axis];
        if !is_inside {
            return None;
        }
        let mut parts = [*cell; 2];
        parts[0].max[axis] = at;
        parts[1].min[axis] = at;
        let coefficients = self.segments.coefficients();
        let halves = parts.map(|part| {
            let wide = part.grown(margin);
            let touches = |&k: &u32| self.segments.list[k as usize].touches(coefficients, &wide);
            let mut half = members.to_vec();
            half.retain(touches);
            half
        });
        let helps = halves.iter().all(|h| h.len() < members.len());
        let axis = u8::from(axis == 1);
        helps.then_some(Cut { axis, at, halves })
    }
}

/// Where a cell may be cut.
struct Place {
    axis: usize,
    at: f64,
    /// How many members both halves have by their boxes.
    size: usize,
}

/// A cut through a cell, and the members of both parts.
struct Cut {
    axis: u8,
    at: f64,
    halves: [Vec<u32>; 2],
}

/// The shifts of a loop by whole periods that bring it into the domain from its lower to its
/// upper corner.
pub(crate) fn shifts(trim: &TrimLoop, [min, max]: [DVec2; 2], closed: [bool; 2]) -> Vec<DVec2> {
    let domain = Rect { min, max };
    if closed == [false; 2] {
        return vec![DVec2::ZERO];
    }
    let (min, max) = trim.hull();
    let hull = Rect { min, max };
    let along = |axis: usize| -> Vec<f64> {
        let period = domain.max[axis] - domain.min[axis];
        let near = SNAP * period;
        // A loop longer than a period would cover itself.
        if !closed[axis] || hull.max[axis] - hull.min[axis] > period + near {
            return vec![0.0];
        }
        let reaches = |shift: &f64| {
            hull.min[axis] + shift < domain.max[axis] - near
                && hull.max[axis] + shift > domain.min[axis] + near
        };
        let all = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|k| k * period);
        all.into_iter().filter(reaches).collect()
    };
    let (along_u, along_v) = (along(0), along(1));
    let pairs = along_u
        .iter()
        .flat_map(|&u| along_v.iter().map(move |&v| DVec2::new(u, v)));
    pairs.collect()
}

/// The segments of loops, wherever they come into a domain that may be closed.
pub(super) fn segments(loops: &[TrimLoop], domain: &Rect, closed: [bool; 2]) -> Segments {
    let mut segments = Segments::default();
    for trim in loops {
        for shift in shifts(trim, [domain.min, domain.max], closed) {
            add(&mut segments, trim, shift, domain);
        }
    }
    segments
}

/// Adds the segments of a loop, each from the end of the one before.
fn add(segments: &mut Segments, trim: &TrimLoop, shift: DVec2, domain: &Rect) {
    let near = (domain.max - domain.min) * SNAP;
    let snap = |mut p: DVec2| {
        for axis in 0..2 {
            for border in [domain.min[axis], domain.max[axis]] {
                if (p[axis] - border).abs() <= near[axis] {
                    p[axis] = border;
                }
            }
        }
        p
    };
    let point = |h: &DVec3| snap(h.truncate() / h.z);
    let moved = |h: &DVec3| *h + (shift * h.z).extend(0.0);
    // The piece that waits for the next one, and where it begins.
    let mut piece: Vec<DVec3> = Vec::new();
    let (mut first, mut before) = (None, DVec2::ZERO);
    for curve in &trim.segments {
        curve.each_bezier(|_, next| {
            if let Some(last) = piece.last() {
                let end = point(last);
                segments.add(&piece, [before, end], snap);
                before = end;
            }
            piece.clear();
            piece.extend(next.iter().map(moved));
            if first.is_none() {
                before = point(&piece[0]);
                first = Some(before);
            }
        });
    }
    if let Some(first) = first {
        segments.add(&piece, [before, first], snap);
    }
}
