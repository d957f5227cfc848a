//! A boundary, and how far it strays from a straight way.

use std::ops::Range;

use glam::{DVec2, DVec4};
use kernel::{Curve, MAX_DEGREE};
use smallvec::SmallVec;

use super::super::net::{cut, share};

/// A boundary in Bézier pieces: where each is on the curve, and its points `(w u, w v, 0, w)`.
pub(super) struct Parts {
    ranges: Vec<Range<f64>>,
    /// The points of one piece after the other, each of as many.
    points: Vec<DVec4>,
}

impl Parts {
    pub(super) fn of(curve: &Curve<DVec2>) -> Self {
        let (mut ranges, mut points) = (Vec::new(), Vec::new());
        curve.each_bezier(|range, piece| {
            ranges.push(range);
            points.extend(piece.iter().map(|h| DVec4::new(h.x, h.y, 0.0, h.z)));
        });
        Self { ranges, points }
    }

    /// Ways from the straight one between two points to what lies between two parameters: to the control
    /// points of its halves, as those of the whole are twice as far away.
    pub(super) fn strays(&self, [from, to]: [f64; 2], a: DVec2, b: DVec2) -> Strays {
        let ts = [from.min(to), from.max(to)];
        // What has few points takes little room.
        match self.points.len() / self.ranges.len() {
            2 => self.ways::<2>(ts, a, b),
            3 => self.ways::<3>(ts, a, b),
            4 => self.ways::<4>(ts, a, b),
            _ => self.ways::<{ MAX_DEGREE + 1 }>(ts, a, b),
        }
    }

    /// [`Self::strays`] of pieces with at most `ROOM` points, between parameters in order.
    fn ways<const ROOM: usize>(&self, [from, to]: [f64; 2], a: DVec2, b: DVec2) -> Strays {
        let way = b - a;
        let length = way.length_squared();
        let mut strays = Strays::new();
        let mut room = [DVec4::ZERO; ROOM];
        let count = if ROOM <= MAX_DEGREE {
            ROOM
        } else {
            self.points.len() / self.ranges.len()
        };
        let first = self.ranges.partition_point(|range| range.end < from);
        let pieces = self.ranges.iter().zip(self.points.chunks_exact(count));
        for (range, points) in pieces
            .skip(first)
            .take_while(|(range, _)| range.start <= to)
        {
            let (start, end) = (share(from, range), share(to, range));
            let middle = if count > 2 {
                f64::midpoint(start, end)
            } else {
                end
            };
            let halves = [[start, middle], [middle, end]];
            for [start, end] in halves.into_iter().take((count - 1).min(2)) {
                let own = &mut room[..count];
                own.copy_from_slice(points);
                cut(own, count - 1, 1, start, end);
                for h in own {
                    let p = h.truncate().truncate() / h.w;
                    let share = if length > 0.0 {
                        ((p - a).dot(way) / length).clamp(0.0, 1.0)
                    } else {
                        0.0
                    };
                    strays.push(p - (a + way * share));
                }
            }
        }
        strays
    }
}

/// Ways from a straight stretch to control points.
pub(super) type Strays = SmallVec<[DVec2; 16]>;
