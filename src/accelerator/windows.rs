//! Parts of a cell that wait to be looked into, each for one ray.
//!
//! Where it is not clear how many roots a ray has in a cell, the part in which they must be is
//! narrowed and halved, in the coordinates of the cell; the parts of all rays of a packet are
//! looked into sixteen at a time.

use super::approach::Approach;
use super::beam::RAYS;
use super::distance::Cells;
use super::leaf::{self, Bits, Seen, Verdict};
use super::leaving::Starts;
use super::room::{Blurred, Met};
use crate::simd::{LANES, PerLane, Simd, Singles, WIDE_LANES};

/// Parts that wait at most.
const CAPACITY: usize = 1024;

/// Halvings and narrowings of a part at most.
const DEPTH: u8 = 8;

/// Parts of a cell that are looked into for each ray that asks for it, on the average; what is
/// then still not clear is left to subdivision in double precision.
const PARTS: usize = 48;

/// How rays come to a cell, and where in it their roots may be.
#[derive(Debug)]
pub(super) struct Waiting {
    count: usize,
    /// Parts that may still be looked into.
    left: usize,
    /// Of each part, with room to take sixteen at once.
    lane: [u8; CAPACITY + LANES],
    depth: [u8; CAPACITY + LANES],
    low: [[f32; CAPACITY + LANES]; 2],
    high: [[f32; CAPACITY + LANES]; 2],
    /// Of each ray: see [`Seen`].
    place: [[f32; RAYS]; 2],
    tilt: [[f32; RAYS]; 2],
    error: [[f32; RAYS]; 2],
}

/// Sixteen parts at most, and the rays that they belong to.
#[repr(align(64))]
pub(super) struct Batch {
    pub(super) count: usize,
    pub(super) lane: [u8; LANES],
    depth: [u8; LANES],
    low: [[f32; LANES]; 2],
    high: [[f32; LANES]; 2],
    place: [[f32; LANES]; 2],
    tilt: [[f32; LANES]; 2],
    error: [[f32; LANES]; 2],
}

/// The lanes of a group.
#[inline(always)]
fn lanes_of(values: &mut [f32; RAYS], group: usize) -> &mut [f32; LANES] {
    &mut values.as_chunks_mut::<LANES>().0[group]
}

impl Waiting {
    pub(super) const NONE: Self = Self {
        count: 0,
        left: 0,
        lane: [0; CAPACITY + LANES],
        depth: [0; CAPACITY + LANES],
        low: [[0.0; CAPACITY + LANES]; 2],
        high: [[0.0; CAPACITY + LANES]; 2],
        place: [[0.0; RAYS]; 2],
        tilt: [[0.0; RAYS]; 2],
        error: [[0.0; RAYS]; 2],
    };

    /// Begins with a cell.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        (self.count, self.left) = (0, 0);
    }

    /// Remembers the rays of a group, and what is left to look into for those of them that a
    /// verdict leaves open.
    #[inline(always)]
    pub(super) fn begin<S: Singles>(
        &mut self,
        s: S,
        group: usize,
        seen: &Seen<S::F>,
        verdict: &Verdict,
    ) {
        for k in 0..2 {
            s.store(seen.place[k], lanes_of(&mut self.place[k], group));
            s.store(seen.tilt[k], lanes_of(&mut self.tilt[k], group));
            s.store(seen.error[k], lanes_of(&mut self.error[k], group));
        }
        self.left += verdict.open.count_ones() as usize * PARTS;
        for k in Bits(u64::from(verdict.open)) {
            self.put(group * LANES + k, 0, verdict, k);
        }
    }

    /// Keeps what a verdict leaves open of a batch; what was divided often enough is left to
    /// `blurred`.
    #[inline(always)]
    pub(super) fn go_on(&mut self, batch: &Batch, verdict: &Verdict, blurred: &mut Blurred) {
        for k in Bits(u64::from(verdict.open)) {
            let lane = usize::from(batch.lane[k]);
            if batch.depth[k] == DEPTH || self.count + 2 > CAPACITY {
                blurred.add_rest(lane, &verdict.rest, k);
            } else {
                self.put(lane, batch.depth[k] + 1, verdict, k);
            }
        }
    }

    /// Keeps the part that slot `k` of a verdict is about, or what it is divided into.
    #[inline(always)]
    fn put(&mut self, lane: usize, depth: u8, verdict: &Verdict, k: usize) {
        if verdict.is_folded >> k & 1 == 1 {
            for part in 0..2 {
                if let Some(part) = verdict.folded.part(part, k) {
                    self.keep(lane, depth, part);
                }
            }
            return;
        }
        let rest = &verdict.rest;
        let low = [rest.low[0][k], rest.low[1][k]];
        let high = [rest.high[0][k], rest.high[1][k]];
        let axis = (rest.along_y >> k & 1) as usize;
        if rest.halve >> k & 1 == 0 {
            return self.keep(lane, depth, (low, high));
        }
        let (mut end, mut start) = (high, low);
        let middle = 0.5 * (low[axis] + high[axis]);
        (end[axis], start[axis]) = (middle, middle);
        self.keep(lane, depth, (low, end));
        self.keep(lane, depth, (start, high));
    }

    /// Keeps a part of a cell for a ray.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a lane is below 64")]
    fn keep(&mut self, lane: usize, depth: u8, (low, high): ([f32; 2], [f32; 2])) {
        let place = self.count;
        self.lane[place] = lane as u8;
        self.depth[place] = depth;
        for side in 0..2 {
            self.low[side][place] = low[side];
            self.high[side][place] = high[side];
        }
        self.count += 1;
    }

    /// Leaves all that waits to `blurred` once no more may be looked into.
    #[inline(always)]
    pub(super) fn give_up(&mut self, blurred: &mut Blurred) {
        if self.left > 0 {
            return;
        }
        for k in 0..self.count {
            let low = [self.low[0][k], self.low[1][k]];
            let high = [self.high[0][k], self.high[1][k]];
            blurred.add(usize::from(self.lane[k]), low, high);
        }
        self.count = 0;
    }

    /// Takes the parts that came last, sixteen at most.
    #[inline(always)]
    pub(super) fn take(&mut self) -> Option<Batch> {
        let count = self.count.min(LANES);
        if count == 0 {
            return None;
        }
        self.count -= count;
        self.left = self.left.saturating_sub(count);
        let mut batch = Batch {
            count,
            lane: [0; LANES],
            depth: [0; LANES],
            low: [[0.0; LANES]; 2],
            high: [[0.0; LANES]; 2],
            place: [[0.0; LANES]; 2],
            tilt: [[0.0; LANES]; 2],
            error: [[0.0; LANES]; 2],
        };
        // What is beyond the last is of no account.
        let parts = self.count..self.count + LANES;
        batch.lane.copy_from_slice(&self.lane[parts.clone()]);
        batch.depth.copy_from_slice(&self.depth[parts.clone()]);
        for side in 0..2 {
            batch.low[side].copy_from_slice(&self.low[side][parts.clone()]);
            batch.high[side].copy_from_slice(&self.high[side][parts.clone()]);
        }
        for (k, &lane) in batch.lane[..count].iter().enumerate() {
            let lane = usize::from(lane) % RAYS;
            for side in 0..2 {
                batch.place[side][k] = self.place[side][lane];
                batch.tilt[side][k] = self.tilt[side][lane];
                batch.error[side][k] = self.error[side][lane];
            }
        }
        Some(batch)
    }
}

impl Batch {
    /// The rays of the parts.
    #[inline(always)]
    pub(super) fn seen<S: Singles>(&self, s: S) -> Seen<S::F> {
        Seen {
            place: [s.load(&self.place[0]), s.load(&self.place[1])],
            tilt: [s.load(&self.tilt[0]), s.load(&self.tilt[1])],
            error: [s.load(&self.error[0]), s.load(&self.error[1])],
        }
    }

    /// The part in slot `k`: least and greatest coordinates.
    #[inline(always)]
    pub(super) fn part(&self, k: usize) -> ([f32; 2], [f32; 2]) {
        (self.low.map(|x| x[k]), self.high.map(|x| x[k]))
    }

    /// The parts: least and greatest coordinates.
    #[inline(always)]
    pub(super) fn range<S: Singles>(&self, s: S) -> ([S::F; 2], [S::F; 2]) {
        (
            [s.load(&self.low[0]), s.load(&self.low[1])],
            [s.load(&self.high[0]), s.load(&self.high[1])],
        )
    }
}

/// Up to 64 rays, and the cell or the cells that they come to.
pub(super) trait Company {
    /// What a cell is described with.
    type Number;

    /// How the rays of a group come to their cells; those count whose bits are set in `lanes`.
    fn approach<S: Singles, const RATIONAL: bool>(&self, s: S, at: (usize, u32)) -> Approach<S::F>;

    /// Where rays start, of those that do so at their cells.
    fn starts(&self) -> &Starts;

    /// The cells of a group.
    fn cells(&self, group: usize) -> &Cells<Self::Number>;

    /// The cells of the rays of a batch.
    fn cells_of(&mut self, batch: &Batch) -> &Cells<Self::Number>;
}

/// The bits of sixteen lanes.
#[inline(always)]
pub(super) fn group_of(lanes: u64, group: usize) -> u32 {
    let [a, b, ..] = (lanes >> (group * LANES)).to_le_bytes();
    u32::from(u16::from_le_bytes([a, b]))
}

/// Looks for the roots of the rays of a group whose bits are set in their cells, and says which of
/// them do not pass their cells by; of their parts none is looked into.
#[inline(always)]
fn first_look<S: Singles, C, const RATIONAL: bool>(
    s: S,
    company: &C,
    (group, lanes): (usize, u32),
    waiting: &mut Waiting,
    verdict: &mut Verdict,
) -> u32
where
    C: Company<Number: PerLane<S, Lanes = S::F>>,
{
    let approach = company.approach::<S, RATIONAL>(s, (group, lanes));
    let cells = company.cells(group);
    let mut lanes = lanes & !approach.beside;
    let tilt = approach.tilt;
    lanes &= !(company.starts()).leaving::<S, _, RATIONAL>(s, cells, (group, lanes), tilt);
    if lanes != 0 {
        leaf::meet::<S, _, RATIONAL>(s, cells, &approach, (group, lanes), waiting, verdict);
    }
    lanes
}

/// Whether half of the lanes are enough for those of which the bits are set.
#[inline(always)]
fn is_half<S: Simd>(lanes: u32) -> bool {
    lanes >> S::Half::COUNT == 0
}

/// In how many steps, as wide as the instructions are, rays are looked at.
#[inline(always)]
pub(super) fn steps<S: Simd>(lanes: u64) -> usize {
    let steps = |group| match group_of(lanes, group) {
        0 => 0,
        part if is_half::<S>(part) => 1,
        _ => LANES / S::Half::COUNT,
    };
    (0..RAYS / LANES).map(steps).sum()
}

/// Looks for the roots of rays in their cells, and into parts of these for rays for which it is
/// not clear; what single precision does not do for is left to the last of the rooms. The result
/// says how many rays do not pass their cells by.
///
/// Of the roots those of eight rays side by side come first, eight by eight.
#[inline(always)]
pub(super) fn look<S: Simd, C, const RATIONAL: bool>(
    s: S,
    company: &mut C,
    lanes: u64,
    (waiting, roots, blurred): (&mut Waiting, &mut Met, &mut Blurred),
) -> u32
where
    C: Company,
    C::Number: PerLane<S, Lanes = S::F> + PerLane<S::Half, Lanes = <S::Half as Singles>::F>,
{
    let mut verdict = Verdict::NONE;
    let (mut looked, mut single) = (0, 0_u64);
    let (mut x, mut y) = ([0.0; RAYS], [0.0; RAYS]);
    for group in 0..RAYS / LANES {
        let part = group_of(lanes, group);
        if part == 0 {
            continue;
        }
        let at = (group, part);
        let met = if is_half::<S>(part) {
            first_look::<_, _, RATIONAL>(s.half(), company, at, waiting, &mut verdict)
        } else {
            first_look::<_, _, RATIONAL>(s, company, at, waiting, &mut verdict)
        };
        if met == 0 {
            continue;
        }
        looked += met.count_ones();
        for k in Bits(u64::from(verdict.blurred)) {
            blurred.add_rest(group * LANES + k, &verdict.rest, k);
        }
        *lanes_of(&mut x, group) = verdict.x;
        *lanes_of(&mut y, group) = verdict.y;
        single |= u64::from(verdict.met) << (group * LANES);
    }
    // There is room for the first of every ray.
    for eight in 0..RAYS / WIDE_LANES {
        let bits = 0xff << (eight * WIDE_LANES);
        if single & bits == bits {
            single &= !bits;
            roots.push_eight(eight, &x, &y);
        }
    }
    for lane in Bits(single) {
        roots.push(lane, x[lane], y[lane]);
    }
    while let Some(batch) = waiting.take() {
        let cells = company.cells_of(&batch);
        if batch.count <= S::Half::COUNT {
            leaf::again::<_, _, RATIONAL>(s.half(), cells, &batch, &mut verdict);
        } else {
            leaf::again::<_, _, RATIONAL>(s, cells, &batch, &mut verdict);
        }
        waiting.go_on(&batch, &verdict, blurred);
        waiting.give_up(blurred);
        for k in Bits(u64::from(verdict.blurred)) {
            blurred.add_rest(usize::from(batch.lane[k]), &verdict.rest, k);
        }
        for k in Bits(u64::from(verdict.met)) {
            let lane = usize::from(batch.lane[k]);
            if !roots.push(lane, verdict.x[k], verdict.y[k]) {
                let (low, high) = batch.part(k);
                blurred.add(lane, low, high);
            }
        }
    }
    looked
}
