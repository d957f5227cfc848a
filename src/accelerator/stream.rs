//! Rays that do not run side by side: each goes its own way from cell to cell, and what up to
//! 64 of them have come to is looked into at once.

use glam::DVec3;

use super::Cluster;
use super::beam::RAYS;
use super::cells::Piece;
use super::expansion::ORDER;
use super::finish::{self, Finish, Lines, Roots};
use super::leaf::Bits;
use super::packet::Tracer;
use super::polygons::Alone;
use super::room::PacketRoom;
use super::tree::Course;
use super::walk::{Stop, Walker};
use super::windows::look;
use crate::simd::{Part, Simd, WIDE_LANES};

/// Follows the rays that are left to their ends.
pub(super) struct Stream<'t, 'a, 'b, S>(pub(super) &'t mut Tracer<'a, 'b, S>);

impl<S: Simd> Part<S> for Stream<'_, '_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, _: S) {
        self.0.stream();
    }
}

impl<'a, S: Simd> Tracer<'a, '_, S> {
    #[inline(always)]
    fn stream(&mut self) {
        self.packet.walkers.resize_with(RAYS, Walker::default);
        for lane in Bits(self.alive) {
            self.packet.walkers[lane].begin(self.accelerator, &self.rays[lane]);
        }
        loop {
            self.gather();
            if self.packet.meetings.count == 0 {
                return;
            }
            self.look_around();
        }
    }

    /// Lets each ray go on to the next cell that it may meet.
    #[inline(always)]
    fn gather(&mut self) {
        self.packet.meetings.clear();
        for lane in Bits(self.alive) {
            while self.alive >> lane & 1 == 1 {
                let PacketRoom {
                    walkers,
                    meetings,
                    models,
                    fans,
                    from,
                    until,
                    ..
                } = &mut *self.packet;
                let walker = &mut walkers[lane];
                let range = from[lane]..until[lane];
                let stop = walker.go_on(self.s, self.accelerator, &self.rays[lane], &range);
                let number = walker.instance;
                let instance = &self.accelerator.instances[number as usize];
                let cluster = &self.accelerator.clusters[instance.cluster as usize];
                match stop {
                    Stop::Cell(cell, slot) => {
                        let cell = &cell;
                        let (at, instructions) =
                            ((instance.cluster, cluster), self.accelerator.instructions);
                        if cell.is_coarse() {
                            let parts = &fans.of(instructions, at, cell).block;
                            walker.divide(self.s, (cell, parts), &range);
                            continue;
                        }
                        let coarse = &walker.coarse;
                        let model = models.of(self.s, at.0, cluster, cell, move || {
                            slot.map(|slot| (fans.of(instructions, at, coarse), slot))
                        });
                        let piece = cluster.piece(cell.piece);
                        let lengths = [range.start, range.end].map(|t| walker.ray.length(t));
                        let ray = (lane, &walker.course, lengths);
                        if let Some(start) = self.starts.get(lane) {
                            let place = (number, instance.is_mirrored);
                            meetings
                                .starts
                                .put((meetings.count, start), place, piece, model);
                        }
                        meetings.put(ray, (number, cell, piece.is_rational), model);
                        break;
                    }
                    Stop::Instance => {
                        self.instance = number;
                        if !cluster.triangles.is_empty() {
                            self.s.apart(Alone {
                                tracer: self,
                                cluster,
                                lane,
                            });
                        }
                    }
                    Stop::End => self.alive &= !(1 << lane),
                }
            }
        }
    }

    /// Looks for roots in all the cells that rays have come to.
    #[inline(always)]
    fn look_around(&mut self) {
        let PacketRoom {
            meetings,
            waiting,
            roots,
            blurred,
            ..
        } = &mut *self.packet;
        self.scratch.cells += meetings.count as u64;
        waiting.clear();
        (roots.count, blurred.lanes) = (0, 0);
        for k in Bits(meetings.frameless) {
            blurred.add(k, [-1.0; 2], [1.0; 2]);
        }
        let all = u64::MAX >> (RAYS - meetings.count);
        let framed = all & !meetings.frameless;
        let rooms = (&mut **waiting, &mut **roots, &mut **blurred);
        if meetings.is_rational {
            look::<S, _, true>(self.s, &mut **meetings, framed, rooms);
        } else {
            look::<S, _, false>(self.s, &mut **meetings, framed, rooms);
        }
        let mut start = 0;
        while start < self.packet.roots.count {
            start += self.finish_some(start);
        }
        for k in Bits(self.packet.blurred.lanes) {
            let cell = self.packet.meetings.cell[k];
            let part = self.packet.blurred.part(k, &cell.rect());
            let lane = usize::from(self.packet.meetings.lane[k]);
            let cluster = self.enter(k);
            self.subdivide(cluster, &cell, part, lane);
        }
    }

    /// The cluster of meeting `k`, of which the instance is then the one at hand.
    #[inline(always)]
    fn enter(&mut self, k: usize) -> &'a Cluster<'a> {
        self.instance = self.packet.meetings.instance[k];
        let instance = &self.accelerator.instances[self.instance as usize];
        &self.accelerator.clusters[instance.cluster as usize]
    }

    /// The piece in which root `k` lies.
    #[inline(always)]
    fn piece(&self, k: usize) -> &'a Piece {
        let meetings = &self.packet.meetings;
        let k = usize::from(self.packet.roots.lanes[k]);
        let instance = &self.accelerator.instances[meetings.instance[k] as usize];
        let cluster = &self.accelerator.clusters[instance.cluster as usize];
        cluster.piece(meetings.cell[k].piece)
    }

    /// Finishes roots from `first` on in double precision and takes those that count; the
    /// result says how many: up to eight in pieces of one kind and low degrees, or one.
    #[inline(always)]
    fn finish_some(&mut self, first: usize) -> usize {
        let &Piece {
            degrees,
            is_rational,
            ..
        } = self.piece(first);
        let is_low = degrees.p.max(degrees.q) < ORDER;
        let most = if is_low { WIDE_LANES } else { 1 };
        let end = self.packet.roots.count.min(first + most);
        let mut used = 1;
        while first + used < end {
            let next = self.piece(first + used);
            if next.degrees != degrees || next.is_rational != is_rational {
                break;
            }
            used += 1;
        }
        let mut batch = Batch {
            lines: Lines {
                slope: [[0.0; WIDE_LANES]; 2],
                constant: [[0.0; WIDE_LANES]; 2],
            },
            axes: [[0; 3]; WIDE_LANES],
            way: [0.0; WIDE_LANES],
            start: [[0.0; WIDE_LANES]; 2],
            half: [[0.0; WIDE_LANES]; 2],
        };
        for k in 0..used {
            self.prepare(first + k, k, &mut batch);
        }
        let wanted = (1 << used) - 1;
        let (lines, start) = (&batch.lines, batch.start);
        let roots = if is_low {
            let finish = Finish {
                net: (degrees, &self.packet.nets[..degrees.len()]),
                axes: [0, 1, 2],
                lines,
                start,
                half: batch.half,
                wanted,
            };
            finish.roots(self.s, is_rational)
        } else {
            let cluster = self.enter(usize::from(self.packet.roots.lanes[first]));
            let finish = Finish {
                net: (degrees, cluster.net(self.piece(first)).points),
                axes: batch.axes[0],
                lines,
                start,
                half: batch.half,
                wanted,
            };
            finish.roots(self.s, true)
        };
        for k in 0..used {
            self.finished(first + k, (&roots, k), &batch, is_low);
        }
        used
    }

    /// Makes root `number` ready for slot `k`.
    #[inline(always)]
    fn prepare(&mut self, number: usize, k: usize, batch: &mut Batch) {
        let met = &self.packet.roots;
        let meeting = usize::from(met.lanes[number]);
        let (x, y) = (f64::from(met.x[number]), f64::from(met.y[number]));
        let cluster = self.enter(meeting);
        let PacketRoom {
            meetings,
            walkers,
            nets,
            ..
        } = &mut *self.packet;
        let (middle, half) = meetings.part[meeting];
        batch.start[0][k] = middle[0] + half[0] * x;
        batch.start[1][k] = middle[1] + half[1] * y;
        (batch.half[0][k], batch.half[1][k]) = (half[0], half[1]);
        let piece = cluster.piece(meetings.cell[meeting].piece);
        let (center, radius) = finish::ball(piece, &cluster.tree);
        let Course {
            origin, direction, ..
        } = walkers[usize::from(meetings.lane[meeting])].course;
        let towards = DVec3::from_array(center) - origin;
        let way = towards.dot(direction);
        let place = (direction * way - towards) * radius.recip();
        let main = direction.abs().max_position();
        let [i, j] = [[1, 2], [0, 2], [0, 1]][main];
        let pace = direction[main].recip();
        for (axis, side) in [(0, i), (1, j)] {
            let slope = direction[side] * pace;
            batch.lines.slope[axis][k] = slope;
            batch.lines.constant[axis][k] = place[side] - slope * place[main];
        }
        (batch.axes[k], batch.way[k]) = ([i, j, main], way);
        for (to, from) in nets.iter_mut().zip(cluster.net(piece).points) {
            (to[0][k], to[1][k], to[2][k]) = (from[i], from[j], from[main]);
            if piece.is_rational {
                to[3][k] = from[3];
            }
        }
    }

    /// Takes root `number`, which is in slot `k`, if it counts.
    #[inline(always)]
    fn finished(
        &mut self,
        number: usize,
        (roots, k): (&Roots, usize),
        batch: &Batch,
        is_turned: bool,
    ) {
        let meeting = usize::from(self.packet.roots.lanes[number]);
        let cluster = self.enter(meeting);
        let meetings = &self.packet.meetings;
        let (cell, lane) = (meetings.cell[meeting], usize::from(meetings.lane[meeting]));
        if roots.found >> k & 1 == 0 {
            return self.subdivide(cluster, &cell, cell.rect(), lane);
        }
        let course = &self.packet.walkers[lane].course;
        let turn = |v: DVec3| {
            let mut own = v;
            if is_turned {
                for (r, axis) in batch.axes[k].into_iter().enumerate() {
                    own[axis] = v[r];
                }
            }
            own
        };
        let (_, radius) = finish::ball(cluster.piece(cell.piece), &cluster.tree);
        let point = turn(DVec3::from_array(roots.point.map(|x| x[k])));
        let t = course.time(batch.way[k] + radius * point.dot(course.direction));
        self.offer(lane, (cluster, &cell), (t, roots, k), turn);
    }
}

/// What up to eight roots are finished with.
struct Batch {
    lines: Lines,
    /// The axes of the lines: both across and the main one.
    axes: [[usize; 3]; WIDE_LANES],
    /// From the origin of the ray to where it is nearest to the middle of the piece.
    way: [f64; WIDE_LANES],
    /// See [`Finish`].
    start: [[f64; WIDE_LANES]; 2],
    half: [[f64; WIDE_LANES]; 2],
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use kernel::Ray;

    use crate::accelerator::tests::{ball, scene_of};
    use crate::random::Random;
    use crate::simd::Instructions;
    use crate::{Accelerator, METHODS, Workspace};

    #[test]
    fn rays_that_are_scattered_in_a_crowd_go_their_own_ways() {
        let mut numbers = Random(3);
        let balls = (0..1000).map(|_| ball(0.02, numbers.vector() / 0.02));
        let scene = scene_of(balls.collect());
        for instructions in Instructions::ALL {
            let accelerator =
                Accelerator::build(&scene, &METHODS[0]).with_instructions(instructions);
            let mut met = 0;
            for (width, goes_alone) in [(0.01, false), (0.3, true)] {
                let (mut room, mut other) = (Workspace::default(), Workspace::default());
                let (mut hits, mut blocked) = (Vec::new(), Vec::new());
                for _ in 0..40 {
                    let middle = numbers.vector() * 0.5 - DVec3::Z;
                    let ray = |_| Ray {
                        origin: middle + numbers.vector() * 0.5 * width,
                        direction: DVec3::new(0.3, 0.2, 1.0),
                    };
                    let rays: Vec<_> = (0..64).map(ray).collect();
                    let ranges = vec![0.0..f64::INFINITY; rays.len()];
                    accelerator.nearest_many(&rays, &ranges, &mut room, &mut hits);
                    accelerator.any_many(&rays, &ranges, &mut room, &mut blocked);
                    for (k, ray) in rays.iter().enumerate() {
                        let alone = accelerator.nearest(ray, ranges[k].clone(), &mut other);
                        let [one, two] = [&hits[k], &alone].map(|hit| hit.map(|hit| hit.shape));
                        assert_eq!((one, blocked[k]), (two, one.is_some()), "{ray:?}");
                        met += u32::from(one.is_some());
                    }
                }
                assert_eq!(!room.packet.walkers.is_empty(), goes_alone, "{width}");
            }
            assert!(met > 500, "only {met} hits say nothing");
        }
    }
}
