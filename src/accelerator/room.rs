//! What packets of rays remember.

use glam::DVec2;

use super::beam::{Beam, RAYS, Rays};
use super::cells::Cell;
use super::expansion::TERMS;
use super::fans::Fans;
use super::few::Few;
use super::leaf::Rest;
use super::leaving::Starts;
use super::meetings::Meetings;
use super::model::Models;
use super::places::Places;
use super::trace::{Candidate, CandidateKind};
use super::walk::Walker;
use super::windows::Waiting;
use crate::intersect::Rect;
use crate::simd::WIDE_LANES;

/// The nets of eight pieces side by side.
pub(super) type Nets = [[[f64; WIDE_LANES]; 4]; TERMS];

/// What packets reuse from call to call.
#[derive(Debug)]
pub(super) struct PacketRoom {
    pub(super) models: Models,
    pub(super) fans: Fans,
    pub(super) few: Box<Few>,
    pub(super) starts: Box<Starts>,
    pub(super) waiting: Box<Waiting>,
    pub(super) roots: Box<Met>,
    pub(super) ready: Ready,
    pub(super) blurred: Box<Blurred>,
    pub(super) beam: Box<Beam>,
    pub(super) rays: Box<Rays>,
    pub(super) local: Box<Rays>,
    pub(super) from: [f64; RAYS],
    /// The end of what is of interest: the nearest root so far, where a bit of `met` is set.
    pub(super) until: [f64; RAYS],
    pub(super) found: Box<Found>,
    pub(super) places: Box<Places>,
    pub(super) met: u64,
    pub(super) stack: Vec<(u32, f32)>,
    pub(super) top_stack: Vec<(u32, f32)>,
    pub(super) triangle_stack: Vec<(u32, f32)>,
    pub(super) walkers: Vec<Walker>,
    pub(super) meetings: Box<Meetings>,
    pub(super) nets: Box<Nets>,
}

impl Default for PacketRoom {
    fn default() -> Self {
        Self {
            models: Models::default(),
            fans: Fans::default(),
            few: Box::new(Few::NONE),
            starts: Box::new(Starts::NONE),
            waiting: Box::new(Waiting::NONE),
            roots: Box::new(Met::NONE),
            ready: Ready::NONE,
            blurred: Box::new(Blurred::NONE),
            beam: Box::new(Beam::NONE),
            rays: Box::new(Rays::NONE),
            local: Box::new(Rays::NONE),
            from: [0.0; RAYS],
            until: [0.0; RAYS],
            found: Box::new(Found::NONE),
            places: Box::new(Places::NONE),
            met: 0,
            stack: Vec::new(),
            top_stack: Vec::new(),
            triangle_stack: Vec::new(),
            walkers: Vec::new(),
            meetings: Box::new(Meetings::NONE),
            nets: Box::new([[[0.0; WIDE_LANES]; 4]; TERMS]),
        }
    }
}

/// What the rays of a packet have met: of use where a bit of `met` is set.
#[derive(Debug)]
pub(super) struct Found {
    /// A bit for each that met a surface and not a triangle, and for each that only touches it.
    pub(super) on_surface: u64,
    pub(super) tangential: u64,
    pub(super) instance: [u32; RAYS],
    /// The piece or the triangle.
    pub(super) number: [u32; RAYS],
    /// Parameters of the piece, or barycentric.
    pub(super) u: [f64; RAYS],
    pub(super) v: [f64; RAYS],
}

impl Found {
    const NONE: Self = Self {
        on_surface: 0,
        tangential: 0,
        instance: [0; RAYS],
        number: [0; RAYS],
        u: [0.0; RAYS],
        v: [0.0; RAYS],
    };

    /// Takes what ray `lane` has met.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, candidate: &Candidate) {
        let (on_surface, touches, number, u, v) = match candidate.kind {
            CandidateKind::Surface {
                piece,
                u,
                v,
                tangential,
            } => (true, tangential, piece, u, v),
            CandidateKind::Triangle { index, barycentric } => {
                (false, false, index, barycentric.x, barycentric.y)
            }
        };
        let bit = 1 << lane;
        self.on_surface = self.on_surface & !bit | u64::from(on_surface) << lane;
        self.tangential = self.tangential & !bit | u64::from(touches) << lane;
        self.instance[lane] = candidate.instance;
        self.number[lane] = number;
        (self.u[lane], self.v[lane]) = (u, v);
    }

    /// What ray `lane` has met, at the ray parameter `t`.
    #[inline(always)]
    pub(super) fn candidate(&self, lane: usize, t: f64) -> Candidate {
        let (u, v) = (self.u[lane], self.v[lane]);
        let kind = if self.on_surface >> lane & 1 == 1 {
            CandidateKind::Surface {
                piece: self.number[lane],
                u,
                v,
                tangential: self.tangential >> lane & 1 == 1,
            }
        } else {
            CandidateKind::Triangle {
                index: self.number[lane],
                barycentric: DVec2::new(u, v),
            }
        };
        Candidate {
            t,
            instance: self.instance[lane],
            kind,
        }
    }
}

/// Roots in a cell that are kept at most: some have several.
const ROOTS: usize = 4 * RAYS;

/// Rays that met a cell, and where in its coordinates.
#[derive(Debug)]
pub(super) struct Met {
    pub(super) count: usize,
    pub(super) lanes: [u8; ROOTS],
    pub(super) x: [f32; ROOTS],
    pub(super) y: [f32; ROOTS],
}

impl Met {
    const NONE: Self = Self {
        count: 0,
        lanes: [0; ROOTS],
        x: [0.0; ROOTS],
        y: [0.0; ROOTS],
    };

    /// Adds the roots of eight rays side by side, when there are none but such yet.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a lane is below 64")]
    pub(super) fn push_eight(&mut self, eight: usize, x: &[f32; RAYS], y: &[f32; RAYS]) {
        let place = self.count / WIDE_LANES;
        for (k, lane) in self.lanes.as_chunks_mut::<WIDE_LANES>().0[place]
            .iter_mut()
            .enumerate()
        {
            *lane = (eight * WIDE_LANES + k) as u8;
        }
        self.x.as_chunks_mut::<WIDE_LANES>().0[place] = x.as_chunks().0[eight];
        self.y.as_chunks_mut::<WIDE_LANES>().0[place] = y.as_chunks().0[eight];
        self.count += WIDE_LANES;
    }

    /// Adds a root; says whether there was room for it.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a lane is below 64")]
    pub(super) fn push(&mut self, lane: usize, x: f32, y: f32) -> bool {
        let has_room = self.count < ROOTS;
        if has_room {
            self.lanes[self.count] = lane as u8;
            self.x[self.count] = x;
            self.y[self.count] = y;
            self.count += 1;
        }
        has_room
    }
}

/// Up to eight roots in cells of one piece, ready to be finished.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ready {
    pub(super) count: usize,
    pub(super) lanes: [u8; WIDE_LANES],
    pub(super) cells: [Cell; WIDE_LANES],
    /// Where they are about, and half the size of the cell, along u and v of the piece.
    pub(super) start: [[f64; WIDE_LANES]; 2],
    pub(super) half: [[f64; WIDE_LANES]; 2],
}

impl Ready {
    pub(super) const NONE: Self = Self {
        count: 0,
        lanes: [0; WIDE_LANES],
        cells: [Cell::NONE; WIDE_LANES],
        start: [[0.0; WIDE_LANES]; 2],
        half: [[0.0; WIDE_LANES]; 2],
    };

    /// Eight roots at once, of those met in a cell, from `first` on.
    #[inline(always)]
    pub(super) fn eight(
        (met, first): (&Met, usize),
        cell: &Cell,
        (middle, half): ([f64; 2], [f64; 2]),
    ) -> Self {
        let place = first / WIDE_LANES;
        let mut start = [[0.0; WIDE_LANES]; 2];
        for (axis, from) in [&met.x, &met.y].into_iter().enumerate() {
            let from: &[f32; WIDE_LANES] = &from.as_chunks().0[place];
            for (to, from) in start[axis].iter_mut().zip(from) {
                *to = middle[axis] + half[axis] * f64::from(*from);
            }
        }
        Self {
            count: WIDE_LANES,
            lanes: met.lanes.as_chunks().0[place],
            cells: [*cell; WIDE_LANES],
            start,
            half: half.map(|half| [half; WIDE_LANES]),
        }
    }

    /// Whether there is room for a root in a cell.
    #[inline(always)]
    pub(super) fn takes(&self, cell: &Cell) -> bool {
        self.count == 0 || self.count < WIDE_LANES && self.cells[0].piece == cell.piece
    }

    /// Adds root `k` of those met in a cell, which is the part `middle`, `half` of its piece.
    #[inline(always)]
    pub(super) fn push(
        &mut self,
        (met, k): (&Met, usize),
        cell: &Cell,
        (middle, half): ([f64; 2], [f64; 2]),
    ) {
        let slot = self.count % WIDE_LANES;
        self.lanes[slot] = met.lanes[k];
        self.cells[slot] = *cell;
        self.start[0][slot] = middle[0] + half[0] * f64::from(met.x[k]);
        self.start[1][slot] = middle[1] + half[1] * f64::from(met.y[k]);
        (self.half[0][slot], self.half[1][slot]) = (half[0], half[1]);
        self.count = slot + 1;
    }
}

/// A part of a cell is looked into this much beyond its borders, in its own size and in that of
/// half the cell, so that parts side by side overlap.
const OVERLAP: [f32; 2] = [1.0 / 16.0, 1e-5];

/// Rays for which single precision does not do in a cell, and the part of it, in its
/// coordinates from -1 to 1, in which their roots are.
#[derive(Debug)]
pub(super) struct Blurred {
    /// A bit for each.
    pub(super) lanes: u64,
    low: [[f32; RAYS]; 2],
    high: [[f32; RAYS]; 2],
}

impl Blurred {
    const NONE: Self = Self {
        lanes: 0,
        low: [[0.0; RAYS]; 2],
        high: [[0.0; RAYS]; 2],
    };

    /// Adds a part for a ray: what is between all of them belongs to it, too.
    #[inline(always)]
    pub(super) fn add(&mut self, lane: usize, low: [f32; 2], high: [f32; 2]) {
        let is_new = self.lanes >> lane & 1 == 0;
        self.lanes |= 1 << lane;
        for k in 0..2 {
            if is_new || low[k] < self.low[k][lane] {
                self.low[k][lane] = low[k];
            }
            if is_new || high[k] > self.high[k][lane] {
                self.high[k][lane] = high[k];
            }
        }
    }

    /// Adds what is left in slot `k`.
    #[inline(always)]
    pub(super) fn add_rest(&mut self, lane: usize, rest: &Rest, k: usize) {
        self.add(lane, rest.low.map(|x| x[k]), rest.high.map(|x| x[k]));
    }

    /// The part for a ray in the parameters of the piece that `cell` is a part of.
    pub(super) fn part(&self, lane: usize, cell: &Rect) -> Rect {
        part_of(
            cell,
            self.low.each_ref().map(|x| x[lane]),
            self.high.each_ref().map(|x| x[lane]),
        )
    }
}

/// What lies between `low` and `high` in the coordinates of a cell, in the parameters of its
/// piece and a little widened; what is not a number bounds nothing.
pub(super) fn part_of(cell: &Rect, low: [f32; 2], high: [f32; 2]) -> Rect {
    let side = |k: usize, (start, end): (f64, f64)| {
        let room = OVERLAP[0] * (high[k] - low[k]) + OVERLAP[1];
        let place = |x: f32| start + (end - start) * 0.5 * (f64::from(x) + 1.0);
        let (low, high) = (low[k] - room, high[k] + room);
        (
            place(if low > -1.0 { low.min(1.0) } else { -1.0 }),
            place(if high < 1.0 { high.max(-1.0) } else { 1.0 }),
        )
    };
    Rect {
        u: side(0, cell.u),
        v: side(1, cell.v),
    }
}
