//! Which faces of a group hang together, and whether they leave a border open.
//!
//! Borders are compared as chords: a place on one border meets another one if it is as near to the arc over a
//! chord there, a parabola, as the curve itself may be. Thin walls keep faces apart that are no farther from each
//! other than curves are from their chords.

use glam::{DVec2, DVec3};
use kernel::{Aabb, Curve, Surface};
use smallvec::SmallVec;

use super::Face;
use crate::segment;
use crate::sets::Sets;

/// Fewest and most chords of each piece of a trim; there are as many as the surface has pieces along
/// a side. Sides have the fewest together, but one for each piece.
const CHORDS: [usize; 2] = [16, 64];

/// How far a border may be from another one that it meets: as a share of how far the curve is from its chord
/// there, of that chord, and of the size of the face.
const NEAR: [f64; 3] = [0.01, 3e-4, 1e-5];

/// Steps towards the nearest point of an arc.
const STEPS: usize = 3;

/// A border is not open if it is no farther from another one than this share of the chord there.
const GAP: f64 = 0.05;

/// Share of the length of all borders that may meet no other one in a closed body.
const OPEN: f64 = 0.01;

/// Faces that hang together.
pub(super) struct Connected<'a> {
    /// The faces, in their order.
    pub(super) faces: Vec<&'a Face>,
    /// Whether every border meets another one.
    pub(super) is_closed: bool,
}

/// The faces in sets that hang together, in the order of their first faces.
pub(super) fn connected<'a>(faces: &[&'a Face]) -> Vec<Connected<'a>> {
    let borders: Vec<_> = faces.iter().map(|face| Border::of(face)).collect();
    let mut order: Vec<_> = (0..faces.len()).collect();
    let least = |k: usize| borders[k].bounds.min.x;
    order.sort_by(|&a, &b| least(a).total_cmp(&least(b)));
    let mut sets = Sets::new(faces.len());
    let mut near: Vec<Vec<usize>> = (0..faces.len()).map(|k| vec![k]).collect();
    for (position, &a) in order.iter().enumerate() {
        let after = order[position + 1..].iter();
        for &b in after.take_while(|&&b| least(b) <= borders[a].bounds.max.x) {
            if !borders[a].bounds.meets(&borders[b].bounds) {
                continue;
            }
            near[a].push(b);
            near[b].push(a);
            // What is closed on its own needs no other, also where it touches one.
            let is_whole = borders[a].is_whole || borders[b].is_whole;
            if !is_whole && sets.root(a) != sets.root(b) && borders[a].touches(&borders[b]) {
                sets.join(a, b);
            }
        }
    }
    let set = |members: Vec<usize>| {
        let (mut open, mut all) = (0.0, 0.0);
        for &k in &members {
            let around: Vec<_> = near[k].iter().map(|&other| &borders[other]).collect();
            open += borders[k].open_length(&around);
            all += borders[k].length();
        }
        Connected {
            faces: members.iter().map(|&k| faces[k]).collect(),
            is_closed: open <= all * OPEN,
        }
    };
    sets.members().into_iter().map(set).collect()
}

/// A straight part of a border.
#[derive(Clone, Copy)]
struct Chord {
    ends: [DVec3; 2],
    /// The point of the curve between them.
    middle: DVec3,
}

impl Chord {
    fn length(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }

    /// Whether a point leaves no gap to the curve, which passes both ends and the middle.
    fn is_near(&self, point: DVec3, slack: f64) -> bool {
        let distance = |from: DVec3, to: DVec3| segment::distance(point, from, to);
        let [from, to] = self.ends;
        let near = distance(from, self.middle).min(distance(self.middle, to));
        near <= self.length() * GAP + slack
    }

    /// Whether a point is on the curve as far as its ends and its middle tell.
    fn is_on(&self, point: DVec3, slack: f64) -> bool {
        if !self.is_near(point, slack) {
            return false;
        }
        // The arc is `from + 2 a t + b t^2`; its nearest point is looked for by steps along its tangents.
        let [from, to] = self.ends;
        let b = (from - self.middle * 2.0 + to) * 2.0;
        let a = (to - from - b) * 0.5;
        let at = |t: f64| from + (a * 2.0 + b * t) * t;
        let mut t = segment::share(point, from, to);
        for _ in 0..STEPS {
            let tangent = (a + b * t) * 2.0;
            let step = (point - at(t)).dot(tangent) / tangent.length_squared();
            if step.is_finite() {
                t = (t + step).clamp(0.0, 1.0);
            }
        }
        let bend = b.length() * 0.25;
        point.distance(at(t)) <= bend * NEAR[0] + self.length() * NEAR[1] + slack
    }
}

/// A piece of a border between two knots.
struct Stretch {
    chords: Vec<Chord>,
    /// Which curve of the border it is of.
    curve: usize,
    /// A box around all that is near, but for the slack.
    bounds: Aabb,
}

impl Stretch {
    fn new(chords: Vec<Chord>, curve: usize) -> Self {
        let longest = chords.iter().map(Chord::length).fold(0.0, f64::max);
        let points = |chord: &Chord| [chord.ends[0], chord.middle, chord.ends[1]];
        let around = Aabb::around(chords.iter().flat_map(points));
        Self {
            chords,
            curve,
            bounds: grown(around, longest * GAP),
        }
    }

    /// Whether a chord is, of those whose points may be near.
    fn has(&self, point: DVec3, slack: f64, is: impl Fn(&Chord, DVec3, f64) -> bool) -> bool {
        let bounds = grown(self.bounds, slack);
        let is_inside = point.cmpge(bounds.min).all() && point.cmple(bounds.max).all();
        is_inside && self.chords.iter().any(|chord| is(chord, point, slack))
    }

    /// Whether anything of another stretch may be near.
    fn may_meet(&self, other: &Self, slack: f64) -> bool {
        grown(self.bounds, slack).meets(&other.bounds)
    }
}

fn grown(bounds: Aabb, reach: f64) -> Aabb {
    Aabb {
        min: bounds.min - reach,
        max: bounds.max + reach,
    }
}

/// The border of a face.
struct Border {
    stretches: Vec<Stretch>,
    /// A box around all that it may meet.
    bounds: Aabb,
    slack: f64,
    number: u32,
    /// Whether the face is a closed surface as a whole, such as a sphere or a torus.
    is_whole: bool,
}

impl Border {
    fn of(face: &Face) -> Self {
        let surface = &face.patch.surface;
        let trims = face.patch.loops.iter().flat_map(|trim| trim.segments());
        let mut curves: Vec<_> = trims.map(|curve| along(curve, surface)).collect();
        if curves.is_empty() {
            curves.extend(sides(surface));
        }
        let mut stretches = Vec::new();
        for (number, parts) in curves.into_iter().enumerate() {
            let own = parts.into_iter().map(|chords| Stretch::new(chords, number));
            stretches.extend(own);
        }
        let slack = face.bounds.diagonal() * NEAR[2];
        let chords = stretches.iter().flat_map(|stretch| &stretch.chords);
        let longest = chords.map(Chord::length).fold(0.0, f64::max);
        let mut border = Self {
            stretches,
            bounds: grown(face.bounds, longest * GAP + slack),
            slack,
            number: face.number,
            is_whole: false,
        };
        let closed = surface.closed();
        let ends_in_points = |axis: usize| {
            let mut stretches = border.stretches.iter().filter(|s| SIDES[s.curve].0 != axis);
            stretches.all(|s| s.chords.iter().all(|chord| !border.is_long(chord)))
        };
        border.is_whole =
            face.patch.loops.is_empty() && (0..2).all(|axis| closed[axis] || ends_in_points(axis));
        border
    }

    /// Whether a chord has a length.
    fn is_long(&self, chord: &Chord) -> bool {
        chord.length() > self.slack
    }

    fn length(&self) -> f64 {
        let chords = self.stretches.iter().flat_map(|stretch| &stretch.chords);
        let long = chords.filter(|chord| self.is_long(chord));
        long.map(Chord::length).sum()
    }

    /// Whether an end of a chord of one border is near a chord of the other.
    fn touches(&self, other: &Self) -> bool {
        let slack = self.slack.min(other.slack);
        let meets = |a: &Stretch, b: &Stretch| {
            let mut ends = a.chords.iter().map(|chord| chord.ends[0]);
            ends.any(|end| b.has(end, slack, Chord::is_on))
        };
        self.stretches.iter().any(|a| {
            let mut near = other.stretches.iter().filter(|b| a.may_meet(b, slack));
            near.any(|b| meets(a, b) || meets(b, a))
        })
    }

    /// The length of chords that meet no other curve of the borders around, itself among them, and of stretches
    /// along which not all faces can be paired.
    fn open_length(&self, around: &[&Self]) -> f64 {
        let open = |stretch: &Stretch| {
            let near = around.iter().flat_map(|border| {
                let is_same = border.number == self.number;
                let slack = self.slack.max(border.slack);
                let others = border.stretches.iter();
                let others = others.filter(move |other| {
                    !(is_same && other.curve == stretch.curve) && stretch.may_meet(other, slack)
                });
                others.map(move |other| (other, slack, border.number))
            });
            let near: Vec<_> = near.collect();
            let meets = |chord: &Chord| {
                let own = chord.length() * GAP;
                let mut others = near.iter();
                others.any(|(other, slack, _)| other.has(chord.middle, own + slack, Chord::is_near))
            };
            let is_odd = |chord: &Chord| {
                let on = near
                    .iter()
                    .filter(|(other, slack, _)| other.has(chord.middle, *slack, Chord::is_on));
                let mut faces: SmallVec<[u32; 8]> = on.map(|(_, _, number)| *number).collect();
                faces.sort_unstable();
                faces.dedup();
                faces.len() >= 2 && faces.len().is_multiple_of(2)
            };
            let (mut all, mut alone, mut odd) = (0.0, 0.0, 0.0);
            for chord in stretch.chords.iter().filter(|chord| self.is_long(chord)) {
                let length = chord.length();
                all += length;
                alone += if meets(chord) { 0.0 } else { length };
                odd += if is_odd(chord) { length } else { 0.0 };
            }
            // Where others end, a chord meets both of them.
            if odd > 0.5 * all { all } else { alone }
        };
        self.stretches.iter().map(open).sum()
    }
}

/// The sides of a domain: the axis along each, and whether it is at the start or end of the other.
const SIDES: [(usize, usize); 4] = [(0, 0), (1, 1), (0, 1), (1, 0)];

/// The chords of the four sides of a domain, between each two knots along it.
fn sides(surface: &Surface) -> [Vec<Vec<Chord>>; 4] {
    let knots = [surface.knots_u(), surface.knots_v()];
    SIDES.map(|(along, end)| {
        let other = knots[1 - along].domain();
        let mut uv = DVec2::splat(if end == 0 { other.start } else { other.end });
        let breaks = knots[along].breaks();
        let count = CHORDS[0].div_ceil(breaks.len() - 1);
        let mut span = |pair: &[f64]| {
            chords([pair[0], pair[1]], count, |t| {
                uv[along] = t;
                surface.evaluate(uv)
            })
        };
        breaks.windows(2).map(&mut span).collect()
    })
}

/// The chords of a curve of the parameter domain, between each two knots.
fn along(curve: &Curve<DVec2>, surface: &Surface) -> Vec<Vec<Chord>> {
    let spans = [surface.knots_u(), surface.knots_v()].map(|knots| knots.breaks().len());
    let count = spans[0].max(spans[1]).clamp(CHORDS[0], CHORDS[1]);
    let at = |t: f64| surface.evaluate(curve.evaluate(t));
    let breaks = curve.knots().breaks();
    let pairs = breaks.windows(2);
    pairs
        .map(|pair| chords([pair[0], pair[1]], count, at))
        .collect()
}

/// Chords of equal steps in a parameter.
fn chords([from, to]: [f64; 2], count: usize, mut at: impl FnMut(f64) -> DVec3) -> Vec<Chord> {
    let step = (to - from) / count as f64;
    let mut place = |k: f64| at(from + step * k);
    let mut chord = |k: usize| {
        let k = k as f64;
        Chord {
            ends: [place(k), place(k + 1.0)],
            middle: place(k + 0.5),
        }
    };
    (0..count).map(&mut chord).collect()
}
