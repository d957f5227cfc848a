//! Which faces of a group hang together, and whether they leave a border open.
//!
//! Borders are compared as chords: a place on one border meets another one if it is as near to the arc over a
//! chord there, a parabola, as the curve itself may be. Thin walls keep faces apart that are no farther from each
//! other than curves are from their chords.

use glam::{DVec2, DVec3};
use kernel::{Aabb, Curve, Sets, Surface};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::Face;
use crate::segment;
use kernel::BoxTree;

/// Fewest and most chords of each piece of a trim; there are as many as the surface has pieces along
/// a side. Sides have the fewest together, but one for each piece.
const CHORDS: [usize; 2] = [16, 64];

/// How far a border may be from another one that it meets: as a share of how far the curve is from its chord
/// there, of that chord, and of the size of the face.
const NEAR: [f64; 3] = [0.01, 3e-4, 1e-5];

/// Chords that are looked at together.
const RUN: usize = 4;

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
    /// Whether the file says so, and nothing else.
    pub(super) is_declared: bool,
}

/// The faces in sets that hang together, in the order of their first faces.
pub(super) fn connected<'a>(faces: &[&'a Face]) -> Vec<Connected<'a>> {
    let borders = Borders::of(faces);
    let mut sets = Sets::new(faces.len());
    borders.join_touching(&mut sets);
    let open = (0..faces.len()).into_par_iter();
    let open: Vec<_> = open.map(|k| borders.open_length(k)).collect();
    let set = |members: Vec<usize>| {
        let alone: f64 = members.iter().map(|&k| open[k]).sum();
        let all: f64 = members.iter().map(|&k| borders.all[k].length()).sum();
        Connected {
            faces: members.iter().map(|&k| faces[k]).collect(),
            is_closed: alone <= all * OPEN,
            is_declared: false,
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
    /// From end to end.
    length: f64,
    /// What leaves no gap is no farther than this from the middle.
    reach: f64,
}

impl Chord {
    fn new(ends: [DVec3; 2], middle: DVec3) -> Self {
        let length = ends[0].distance(ends[1]);
        let half = ends.map(|end| end.distance(middle));
        Self {
            ends,
            middle,
            length,
            reach: (half[0].max(half[1]) + length * GAP) * (1.0 + 1e-9),
        }
    }

    /// Whether a point leaves no gap to the curve, which passes both ends and the middle.
    fn is_near(&self, point: DVec3, slack: f64) -> bool {
        let reach = self.reach + slack;
        if point.distance_squared(self.middle) > reach * reach {
            return false;
        }
        let distance = |from: DVec3, to: DVec3| segment::distance(point, from, to);
        let [from, to] = self.ends;
        let near = distance(from, self.middle).min(distance(self.middle, to));
        near <= self.length * GAP + slack
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
        point.distance(at(t)) <= bend * NEAR[0] + self.length * NEAR[1] + slack
    }
}

/// A piece of a border between two knots.
struct Stretch {
    chords: Vec<Chord>,
    /// Which curve of the border it is of.
    curve: usize,
}

/// The border of a face.
struct Border {
    stretches: Vec<Stretch>,
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
        for (curve, parts) in curves.into_iter().enumerate() {
            let own = parts.into_iter().map(|chords| Stretch { chords, curve });
            stretches.extend(own);
        }
        let slack = face.bounds.diagonal() * NEAR[2];
        let mut border = Self {
            stretches,
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
        chord.length > self.slack
    }

    fn length(&self) -> f64 {
        let chords = self.stretches.iter().flat_map(|stretch| &stretch.chords);
        let long = chords.filter(|chord| self.is_long(chord));
        long.map(|chord| chord.length).sum()
    }
}

/// A few chords of a stretch.
struct Run {
    border: usize,
    stretch: usize,
    first: usize,
}

/// The borders of all faces, and a tree over runs of their chords.
struct Borders {
    all: Vec<Border>,
    runs: Vec<Run>,
    tree: BoxTree,
}

impl Borders {
    fn of(faces: &[&Face]) -> Self {
        let all: Vec<_> = faces.par_iter().map(|face| Border::of(face)).collect();
        let (mut runs, mut boxes) = (Vec::new(), Vec::new());
        for (border, own) in all.iter().enumerate() {
            for (stretch, Stretch { chords, .. }) in own.stretches.iter().enumerate() {
                for (k, chords) in chords.chunks(RUN).enumerate() {
                    let first = k * RUN;
                    runs.push(Run {
                        border,
                        stretch,
                        first,
                    });
                    boxes.push(around(chords, own.slack));
                }
            }
        }
        let tree = BoxTree::new(&boxes);
        Self { all, runs, tree }
    }

    /// Shows chords that may be near a point but for `reach` and the slack of their border, and the numbers
    /// of the border and of its curve.
    fn near(&self, point: DVec3, reach: f64, mut show: impl FnMut(usize, usize, &[Chord])) {
        let square = reach * reach;
        self.tree.visit(point, square, |found| {
            let run = &self.runs[found as usize];
            let stretch = &self.all[run.border].stretches[run.stretch];
            let end = stretch.chords.len().min(run.first + RUN);
            show(run.border, stretch.curve, &stretch.chords[run.first..end]);
            square
        });
    }

    /// Joins faces of which an end of a chord is on a chord of the other.
    fn join_touching(&self, sets: &mut Sets) {
        for (k, border) in self.all.iter().enumerate() {
            // What is closed on its own needs no other, also where it touches one.
            let chords = border.stretches.iter().flat_map(|stretch| &stretch.chords);
            for chord in chords.filter(|_| !border.is_whole) {
                let end = chord.ends[0];
                self.near(end, border.slack, |other, _, chords| {
                    let that = &self.all[other];
                    let slack = border.slack.min(that.slack);
                    if !that.is_whole
                        && sets.root(k) != sets.root(other)
                        && chords.iter().any(|chord| chord.is_on(end, slack))
                    {
                        sets.join(k, other);
                    }
                });
            }
        }
    }

    /// The length of chords of a border that meet no other curve, of its own or of another border, and of
    /// stretches along which not all faces can be paired.
    fn open_length(&self, k: usize) -> f64 {
        let border = &self.all[k];
        let open = |stretch: &Stretch| {
            let (mut all, mut alone, mut odd) = (0.0, 0.0, 0.0);
            for chord in stretch.chords.iter().filter(|chord| border.is_long(chord)) {
                let (point, own) = (chord.middle, chord.length * GAP);
                let (mut meets, mut on) = (false, SmallVec::<[u32; 8]>::new());
                self.near(point, own + border.slack, |other, curve, chords| {
                    let that = &self.all[other];
                    if that.number == border.number && curve == stretch.curve {
                        return;
                    }
                    let slack = border.slack.max(that.slack);
                    meets = meets || chords.iter().any(|chord| chord.is_near(point, own + slack));
                    if chords.iter().any(|chord| chord.is_on(point, slack)) {
                        on.push(that.number);
                    }
                });
                on.sort_unstable();
                on.dedup();
                let is_odd = on.len() >= 2 && on.len().is_multiple_of(2);
                all += chord.length;
                alone += if meets { 0.0 } else { chord.length };
                odd += if is_odd { chord.length } else { 0.0 };
            }
            // Where others end, a chord meets both of them.
            if odd > 0.5 * all { all } else { alone }
        };
        border.stretches.iter().map(open).sum()
    }
}

/// A box around all that leaves no gap to chords.
fn around(chords: &[Chord], slack: f64) -> Aabb {
    let longest = chords.iter().map(|chord| chord.length).fold(0.0, f64::max);
    let points = |chord: &Chord| [chord.ends[0], chord.middle, chord.ends[1]];
    let bounds = Aabb::around(chords.iter().flat_map(points));
    let reach = longest * GAP + slack;
    Aabb {
        min: bounds.min - reach,
        max: bounds.max + reach,
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
    let mut start = place(0.0);
    let mut chord = |k: usize| {
        let k = k as f64;
        let ends = [start, place(k + 1.0)];
        start = ends[1];
        Chord::new(ends, place(k + 0.5))
    };
    (0..count).map(&mut chord).collect()
}
