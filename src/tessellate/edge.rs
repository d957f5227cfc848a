//! Points along an edge, the same for every face that it bounds.

mod parts;
mod steps;

use glam::{DVec2, DVec3};
use kernel::Curve;
use smallvec::SmallVec;

use self::parts::Parts;
use super::Limits;
use super::pieces::{Rect, Spread};
use super::rim::Face;
use super::sew::{Edge, Use};

/// The part of a tolerance that edges may use: triangles beside them need a little more.
const SHARE: f64 = 0.93;

/// Chords that stray less than this part of the tolerance do not cross others because of that.
const FUTILE: f64 = 1e-3;

/// A step this small, as a share of the edge, is not made smaller.
const LEAST: f64 = 1e-6;

/// What is nearer to a vertex than this share of the tolerance is there.
const SAME: f64 = 1e-3;

/// What is on one side of a crease, or beside a pole, is looked up this share of a step beside it.
const INSIDE: f64 = 1e-6;

/// A normal of less than this share of the length of others is what rounding leaves of it at a pole.
const POLE: f64 = 1e-9;

/// A point of an edge.
#[derive(Clone, Debug)]
pub(super) struct Station {
    pub(super) position: DVec3,
    /// The vertex that it is, where other boundaries cross the edge.
    pub(super) vertex: Option<usize>,
    /// Its parameters on the curve and on the surface of every use.
    pub(super) places: Places,
    /// How far the boundary of any face is from the step that ends here at most; infinite if unknown.
    off: f64,
}

/// A point of an edge as one of its faces sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    t: f64,
    pub(super) uv: DVec2,
    /// Distance between the surface there and the point of the edge.
    pub(super) gap: f64,
    /// Which way the curve runs in space.
    along: DVec3,
    /// The surface's normal, of any length.
    normal: DVec3,
}

impl Place {
    /// Where a boundary is at `uv`, and goes on by `way`, and the point of the surface there; no
    /// gap yet.
    fn new(face: &Face<'_>, t: f64, (uv, way): (DVec2, DVec2)) -> (Self, DVec3) {
        let (point, along, normal) = face.look(uv, way);
        let place = Self {
            t,
            uv,
            gap: 0.0,
            along,
            normal,
        };
        (place, point)
    }
}

/// The places of one point of an edge.
type Places = SmallVec<[Place; 2]>;

/// Points of a surface at a place of its boundary: its own, and that of the
/// [snapped](Face::snapped) parameters.
struct Points {
    own: DVec3,
    snapped: DVec3,
}

/// An edge as a chain of points.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) stations: Vec<Station>,
    /// How far the boundary of each face is from the chain, proven.
    pub(super) proven: f64,
}

/// An edge with what is needed to walk along it.
pub(super) struct Walker<'a> {
    faces: &'a [Face<'a>],
    uses: &'a [Use],
    parts: Vec<Parts>,
    ends: [DVec3; 2],
    limits: &'a Limits<'a>,
}

impl<'a> Walker<'a> {
    pub(super) fn new(
        faces: &'a [Face<'a>],
        edge: &'a Edge,
        vertices: &[DVec3],
        limits: &'a Limits<'a>,
    ) -> Self {
        Self {
            faces,
            uses: &edge.uses,
            parts: edge.uses.iter().map(|u| Parts::of(&u.curve)).collect(),
            ends: edge.ends.map(|v| vertices[v]),
            limits,
        }
    }

    /// Walks with as few and as equal steps as the limits allow.
    ///
    /// `least` is how many steps there are at least.
    pub(super) fn chain(&self, least: usize) -> Chain {
        let mut stations = self.walk(&self.kinks());
        self.straighten(&mut stations);
        if stations.len() <= least {
            stations = self.divided(least);
        }
        self.proven(stations)
    }

    /// The chain of these points, and those where it passes creases.
    pub(super) fn linked(&self, mut stations: Vec<Station>) -> Chain {
        for station in &mut stations {
            station.off = f64::INFINITY;
        }
        self.proven(stations)
    }

    /// The same where what is known of steps is true.
    fn proven(&self, mut stations: Vec<Station>) -> Chain {
        self.cross_creases(&mut stations);
        let proven = stations.windows(2).fold(0.0, |most, w| {
            if w[1].off <= most {
                most
            } else {
                self.distance(&w[0], &w[1], most)
            }
        });
        Chain { stations, proven }
    }

    /// Whether the chord of a step strays from the curves that it stands for, so that halves would cross
    /// less.
    pub(super) fn is_coarse(&self, ends: &[Station]) -> bool {
        self.uses.iter().enumerate().any(|(k, used)| {
            let face = &self.faces[used.face];
            let (a, b) = (&ends[0].places[k], &ends[1].places[k]);
            let strays = self.parts[k].strays([a.t, b.t], a.uv, b.uv);
            let spread = face.pieces.spread(&Rect::around([a.uv, b.uv]));
            strays
                .iter()
                .any(|off| spread.step(*off) > FUTILE * face.tolerance)
        })
    }

    /// The station that halves a step.
    pub(super) fn middle(&self, ends: &[Station]) -> Station {
        self.station(f64::midpoint(ends[0].places[0].t, ends[1].places[0].t))
    }

    /// The station on the chord of a step at a share of its length, which is at `uv` in the parameters of
    /// one of the uses.
    pub(super) fn between(
        &self,
        ends: &[Station],
        share: f64,
        (used, uv): (usize, DVec2),
    ) -> Station {
        let place = |(k, own): (usize, &Use)| {
            let (a, b) = (&ends[0].places[k], &ends[1].places[k]);
            let t = a.t + (b.t - a.t) * share;
            let on = if k == used {
                uv
            } else {
                a.uv.lerp(b.uv, share)
            };
            Place::new(&self.faces[own.face], t, (on, own.curve.tangent(t).1)).0
        };
        Station {
            position: ends[0].position.lerp(ends[1].position, share),
            vertex: None,
            places: self.uses.iter().enumerate().map(place).collect(),
            off: f64::INFINITY,
        }
    }

    /// Makes a station the vertex of that number and position.
    pub(super) fn tie(&self, station: &mut Station, (vertex, position): (usize, DVec3)) {
        station.vertex = Some(vertex);
        station.position = position;
        for (place, used) in station.places.iter_mut().zip(self.uses) {
            place.gap = self.faces[used.face].point(place.uv).distance(position);
        }
    }

    fn divided(&self, steps: usize) -> Vec<Station> {
        let range = self.uses[0].curve.domain();
        let inner = (1..steps).map(|k| {
            let share = k as f64 / steps as f64;
            self.station(range.start + (range.end - range.start) * share)
        });
        let mut stations = vec![self.end_station(0)];
        stations.extend(inner);
        stations.push(self.end_station(1));
        stations
    }

    /// Where one of the boundaries passes a crease, as parameters of the first use, and the end.
    fn kinks(&self) -> Vec<f64> {
        let first = &self.uses[0];
        let home = &self.faces[first.face];
        let range = first.curve.domain();
        let near = (range.end - range.start) * LEAST;
        let mut kinks = home.kinks(&first.curve);
        for used in &self.uses[1..] {
            let face = &self.faces[used.face];
            let turned = used.reversed != first.reversed;
            for t in face.kinks(&used.curve) {
                let point = face.point(used.curve.evaluate(t));
                let place = (home, &first.curve);
                let from = (&used.trail, t, turned);
                kinks.push(first.trail.project_beside(place, point, from).0);
            }
        }
        let tolerances = self.uses.iter().map(|used| self.faces[used.face].tolerance);
        let reach = SAME * tolerances.fold(f64::INFINITY, f64::min);
        // Where faces are apart an end may be farther from their boundaries than those of it.
        let own = [range.start, range.end].map(|t| home.point(first.curve.evaluate(t)));
        kinks.retain(|&kink| {
            let point = home.point(first.curve.evaluate(kink));
            let is_far = |end: &DVec3| end.distance(point) > reach;
            self.ends.iter().chain(&own).all(is_far)
        });
        kinks.push(range.end);
        // One crossing may have been found twice; the last one is the end, which stays.
        kinks.sort_by(|a, b| b.total_cmp(a));
        kinks.dedup_by(|before, after| *after - *before <= near);
        kinks.reverse();
        kinks
    }

    /// A point inside the edge, at a parameter of the first use.
    fn station(&self, t: f64) -> Station {
        let first = &self.uses[0];
        let (place, points) = self.look(0, t);
        let master = points.own;
        let mut places = Places::new();
        places.push(place);
        let mut snapped: SmallVec<[DVec3; 2]> = SmallVec::new();
        snapped.push(points.snapped);
        let mut sum = master;
        for (k, used) in self.uses.iter().enumerate().skip(1) {
            let face = &self.faces[used.face];
            let turned = used.reversed != first.reversed;
            let (beside, from) = ((face, &used.curve), (&first.trail, t, turned));
            let (t, _) = used.trail.project_beside(beside, master, from);
            let (place, points) = self.look(k, t);
            sum += points.own;
            places.push(place);
            snapped.push(points.snapped);
        }
        let position = sum / self.uses.len() as f64;
        for (place, point) in places.iter_mut().zip(snapped) {
            place.gap = point.distance(position);
        }
        Station {
            position,
            vertex: None,
            places,
            off: f64::INFINITY,
        }
    }

    /// Where the boundary of a use is at a parameter.
    fn look(&self, k: usize, t: f64) -> (Place, Points) {
        let used = &self.uses[k];
        let face = &self.faces[used.face];
        let (uv, way) = used.curve.tangent(t);
        let on = face.snapped(uv);
        let (place, snapped) = Place::new(face, t, (on, way));
        let own = if on == uv { snapped } else { face.point(uv) };
        (place, Points { own, snapped })
    }

    fn end_station(&self, end: usize) -> Station {
        let ts: SmallVec<[f64; 2]> = self
            .uses
            .iter()
            .map(|used| {
                let range = used.curve.domain();
                if (end == 0) == used.reversed {
                    range.end
                } else {
                    range.start
                }
            })
            .collect();
        self.placed(self.ends[end], &ts)
    }

    /// The station amid the points at parameters of all uses.
    fn met(&self, ts: &[f64]) -> Station {
        let points = self.uses.iter().zip(ts);
        let sum: DVec3 = points
            .map(|(used, &t)| self.faces[used.face].point(used.curve.evaluate(t)))
            .sum();
        self.placed(sum / ts.len() as f64, ts)
    }

    fn placed(&self, position: DVec3, ts: &[f64]) -> Station {
        let place = |(k, &t): (usize, &f64)| {
            let (place, points) = self.look(k, t);
            let gap = points.snapped.distance(position);
            Place { gap, ..place }
        };
        Station {
            position,
            vertex: None,
            places: ts.iter().enumerate().map(place).collect(),
            off: f64::INFINITY,
        }
    }

    /// What a step uses of the limits, of which 1 is all, and how far the boundary of any face is from its
    /// chord at most, gaps included.
    fn judge(&self, from: &Station, to: &Station) -> (f64, f64) {
        let mut off = 0.0_f64;
        let length = from.position.distance(to.position);
        let mut most = (length / self.limits.max_edge).powi(2);
        for (k, used) in self.uses.iter().enumerate() {
            let face = &self.faces[used.face];
            let allowed = SHARE * face.tolerance;
            let gap = from.places[k].gap.max(to.places[k].gap);
            // Below the tolerance directions mean nothing: as long as that a step uses no more than all
            // for them.
            let short = (length / face.tolerance).powi(2);
            if short > most {
                let turn = self.turn(k, from, to) / self.limits.angle;
                most = most.max(turn.powi(2).min(short));
            }
            let left = (allowed - gap).max(0.1 * allowed);
            let bound = self.bound(k, from, to, most * left);
            off = off.max(bound + gap);
            most = most.max(bound / left);
        }
        (most, off)
    }

    /// The largest angle by which the curve or the normal of a use turns over a step.
    fn turn(&self, k: usize, from: &Station, to: &Station) -> f64 {
        let (a, b) = (&from.places[k], &to.places[k]);
        let (used, face) = (&self.uses[k], &self.faces[self.uses[k].face]);
        let is_pole = |one: DVec3, other: DVec3| one.length() < POLE * other.length();
        // On a crease the step has the directions of its own side, and at a pole those beside it.
        let look = |at: &Place, other: &Place| {
            if !face.pieces.is_creased(at.uv) && !is_pole(at.normal, other.normal) {
                return (at.along, at.normal);
            }
            let (uv, way) = used.curve.tangent(at.t + (other.t - at.t) * INSIDE);
            let (_, along, normal) = face.look(uv, way);
            (along, normal)
        };
        let (start, end) = (look(a, b), look(b, a));
        let angle = |a: DVec3, b: DVec3| {
            let angle = a.angle_between(b);
            if angle.is_finite() { angle } else { 0.0 }
        };
        let is_nothing = is_pole(start.1, end.1) || is_pole(end.1, start.1);
        // At a crease in between the normal jumps however short the step is.
        let normals = if is_nothing || face.pieces.is_creased_inside(&Rect::around([a.uv, b.uv])) {
            0.0
        } else {
            angle(start.1, end.1)
        };
        // A boundary may turn more: its chord is seen from the side only.
        normals.max(0.5 * angle(start.0, end.0))
    }

    /// How far the boundary of any face is from the chord, gaps included, if that is more than
    /// `most`, else that.
    fn distance(&self, from: &Station, to: &Station, most: f64) -> f64 {
        (0..self.uses.len()).fold(most, |most, k| {
            let gap = from.places[k].gap.max(to.places[k].gap);
            most.max(self.bound(k, from, to, most - gap) + gap)
        })
    }

    /// How far one face's boundary, and what lies between it and the straight way in
    /// parameters, is from the chord of the surface; no more than needed to tell that it is below
    /// `enough`.
    fn bound(&self, k: usize, from: &Station, to: &Station, enough: f64) -> f64 {
        let face = &self.faces[self.uses[k].face];
        let (a, b) = (from.places[k].uv, to.places[k].uv);
        let strays = self.parts[k].strays([from.places[k].t, to.places[k].t], a, b);
        let off = strays
            .iter()
            .fold(DVec2::ZERO, |most, off| most.max(off.abs()));
        let rect = Rect::around([a, b]);
        let (min, max) = (face.clamped(rect.min - off), face.clamped(rect.max + off));
        let rect = Rect { min, max };
        let size = rect.size();
        let [least, more] = face.pieces.beside_chord([a, b]);
        let bound = |spread: &Spread| {
            let aside = strays
                .iter()
                .map(|off| spread.step(*off))
                .fold(0.0, f64::max);
            more + aside + spread.chord(b - a, size).max(least) + spread.chord(off, size)
        };
        face.pieces
            .bound_until(&rect, bound, (enough, f64::INFINITY), || false)
    }

    /// Adds the points where a curve passes a line across which its surface has a crease.
    fn cross_creases(&self, stations: &mut Vec<Station>) {
        for (k, used) in self.uses.iter().enumerate() {
            let face = &self.faces[used.face];
            for axis in 0..2 {
                for &crease in &face.pieces.creases[axis] {
                    self.cross(stations, k, axis, crease);
                }
            }
        }
    }

    fn cross(&self, stations: &mut Vec<Station>, k: usize, axis: usize, crease: f64) {
        let mut at = 1;
        while at < stations.len() {
            let (a, b) = (&stations[at - 1].places[k], &stations[at].places[k]);
            let (x, y) = (a.uv[axis] - crease, b.uv[axis] - crease);
            if x * y < 0.0 {
                let curve = &self.uses[k].curve;
                let Some(t) = crossing(curve, [a.t, b.t], axis, crease) else {
                    at += 1;
                    continue;
                };
                let face = &self.faces[self.uses[k].face];
                let point = face.point(curve.evaluate(t));
                let first = &self.uses[0];
                let start = if k == 0 {
                    t
                } else {
                    let home = &self.faces[first.face];
                    first.trail.project(home, &first.curve, point).0
                };
                let (low, high) = (stations[at - 1].places[0].t, stations[at].places[0].t);
                let mut station = self.station(start.clamp(low.min(high), low.max(high)));
                // Where another face makes no difference between it and its neighbour, that one is
                // moved onto the crease.
                let is_same = |other: &Station| {
                    let mut places = other.places.iter().zip(&station.places).enumerate();
                    places.any(|(j, (own, new))| j != k && own.uv == new.uv)
                };
                let last = stations.len() - 1;
                let inner = |s: &usize| (1..last).contains(s);
                let mut beside = [at - 1, at].into_iter().filter(inner);
                let twin = beside.find(|&s| is_same(&stations[s]));
                let (mut uv, way) = curve.tangent(t);
                uv[axis] = crease;
                let (place, point) = Place::new(face, t, (uv, way));
                let moved = twin.map_or(&mut station, |s| &mut stations[s]);
                let gap = point.distance(moved.position);
                moved.places[k] = Place { gap, ..place };
                let changed = twin.unwrap_or(at);
                if twin.is_none() {
                    stations.insert(at, station);
                    at += 1;
                }
                // Nothing is known any more of the steps to it and from it.
                for station in &mut stations[changed..=changed + 1] {
                    station.off = f64::INFINITY;
                }
            }
            at += 1;
        }
    }
}

/// Where a curve passes a line between two parameters, by halving; `None` if they are on the same
/// side of it.
fn crossing(
    curve: &Curve<DVec2>,
    [mut low, mut high]: [f64; 2],
    axis: usize,
    value: f64,
) -> Option<f64> {
    let side = |t: f64| curve.evaluate(t)[axis] > value;
    let first = side(low);
    if side(high) == first {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if side(middle) == first {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(0.5 * (low + high))
}
