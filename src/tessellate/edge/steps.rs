//! Steps along an edge, as few and as equal as the limits allow.

use smallvec::SmallVec;

use super::{LEAST, Place, Station, Walker};

/// Rounding errors of a number of steps, many roundings wide.
const ROUNDING: f64 = 1e-9;

/// Halvings of a step that jumps.
const BRIDGES: u32 = 6;

impl Walker<'_> {
    /// Steps of which none uses more than the limits; none passes one of the `kinks`.
    ///
    /// Each is one of as many up to the next kink, equal in length, as what is known of the one before
    /// asks for.
    pub(super) fn walk(&self, kinks: &[f64]) -> Vec<Station> {
        let range = self.uses[0].curve.domain();
        let trail = &self.uses[0].trail;
        let shortest = trail.length() * LEAST;
        let mut stations = vec![self.end_station(0)];
        let (mut t, mut longest) = (range.start, trail.length());
        while t < range.end && self.limits.room.is_left() {
            let before = stations.len();
            let last = &stations[stations.len() - 1];
            let limit = kinks[kinks.partition_point(|&kink| kink <= t)];
            let start = trail.along(t);
            let rest = trail.along(limit) - start;
            let count = |longest: f64| (rest / longest.max(shortest) - ROUNDING).ceil().max(1.0);
            let reached = |to: f64| {
                if to < range.end {
                    self.station(to)
                } else {
                    self.end_station(1)
                }
            };
            // The best step so far or else the last one, and numbers of steps that are too few.
            let mut best: Option<(f64, Station, f64)> = None;
            let (mut is_good, mut bad) = (false, 0.0);
            let mut steps = count(longest);
            for _ in 0..24 {
                let step = rest / steps;
                let to = match trail.at(start + step).1 {
                    to if steps > 1.0 && to > t => to.min(limit),
                    _ => limit,
                };
                let mut next = reached(to);
                let ratio;
                (ratio, next.off) = self.judge(last, &next);
                let wanted = step * growth(ratio).clamp(0.1, 4.0);
                if ratio <= 1.0 || step <= shortest {
                    (best, is_good) = (Some((to, next, ratio)), true);
                    let fewer = count(wanted);
                    if fewer >= steps || fewer <= bad {
                        break;
                    }
                    steps = fewer;
                } else if is_good {
                    break;
                } else {
                    best = Some((to, next, ratio));
                    // Where a little more does not do, a little more again will not.
                    let most = step * if bad > 0.0 { 0.8 } else { 0.98 };
                    (bad, steps) = (steps, count(wanted.min(most)));
                }
            }
            let Some((to, mut next, ratio)) = best else {
                break;
            };
            let step = trail.along(to) - start;
            longest = step * growth(ratio).clamp(0.2, 4.0);
            t = to;
            if ratio > 1.0 {
                next.off = f64::INFINITY;
                self.bridge(last.clone(), next, BRIDGES, &mut stations);
            } else {
                stations.push(next);
            }
            self.limits.room.take((stations.len() - before) as f64);
        }
        stations
    }

    /// Sees to it that all boundaries go on from station to station. Where one has a bend below the
    /// tolerance what is nearest on another goes back or stands still: it gets a place in between, or the
    /// station is left out, if the limits allow it.
    pub(super) fn straighten(&self, stations: &mut Vec<Station>) {
        let stays = |k: usize, from: &Station, to: &Station| {
            let (a, b) = (from.places[k].t, to.places[k].t);
            if self.uses[k].reversed {
                a <= b
            } else {
                b <= a
            }
        };
        let goes_on = |from: &Station, to: &Station| {
            let mut uses = 0..self.uses.len();
            uses.all(|k| !stays(k, from, to))
        };
        let fits =
            |from: &Station, to: &Station| goes_on(from, to) && self.judge(from, to).0 <= 1.0;
        let mut at = 1;
        while at + 1 < stations.len() {
            let [before, own, after] = [at - 1, at, at + 1].map(|k| &stations[k]);
            if goes_on(before, own) {
                at += 1;
                continue;
            }
            if fits(before, after) {
                stations.remove(at);
                stations[at].off = f64::INFINITY;
                continue;
            }
            let place = |k: usize| {
                if stays(k, before, own) {
                    f64::midpoint(before.places[k].t, after.places[k].t)
                } else {
                    own.places[k].t
                }
            };
            let ts: SmallVec<[f64; 2]> = (0..self.uses.len()).map(place).collect();
            let moved = self.met(&ts);
            if fits(before, &moved) && fits(&moved, after) {
                stations[at] = moved;
                stations[at + 1].off = f64::INFINITY;
            }
            at += 1;
        }
    }

    /// Appends the end of a step, and before it what is between where one of the boundaries goes on
    /// while the first stands still: what is nearest to that jumps, however short the step is.
    fn bridge(&self, from: Station, to: Station, depth: u32, stations: &mut Vec<Station>) {
        let tolerances = self.uses.iter().map(|used| self.faces[used.face].tolerance);
        let tolerance = tolerances.fold(f64::INFINITY, f64::min);
        if depth > 0 && self.distance(&from, &to, 0.0) > tolerance {
            let middle = |(a, b): (&Place, &Place)| f64::midpoint(a.t, b.t);
            let ts: SmallVec<[f64; 2]> = from.places.iter().zip(&to.places).map(middle).collect();
            let middle = self.met(&ts);
            self.bridge(from, middle.clone(), depth - 1, stations);
            self.bridge(middle, to, depth - 1, stations);
        } else {
            stations.push(to);
        }
    }
}

/// How many times as long a step may be that uses this much of the limits: they grow with the square.
fn growth(ratio: f64) -> f64 {
    ratio.max(1e-9).sqrt().recip()
}
