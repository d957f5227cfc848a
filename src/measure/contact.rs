//! Which faces of a group hang together, and whether they leave a border open.
//!
//! Borders are compared as chords: a place on one border meets another one if it is as near to a
//! chord there as the curve itself may be.

use glam::{DVec2, DVec3};
use kernel::{Aabb, Curve, Surface, TrimLoop};

use super::Face;

/// Fewest and most chords of each piece of a border; there are as many as the surface has
/// pieces along a side.
const CHORDS: [usize; 2] = [16, 64];

/// How far a border may be from another one that it meets: as a share of the chord there, for
/// what the curve is away from it, and of the size of the face.
const NEAR: [f64; 2] = [0.05, 1e-5];

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
    let mut roots: Vec<usize> = (0..faces.len()).collect();
    let mut near: Vec<Vec<usize>> = (0..faces.len()).map(|k| vec![k]).collect();
    for (position, &a) in order.iter().enumerate() {
        let after = order[position + 1..].iter();
        for &b in after.take_while(|&&b| least(b) <= borders[a].bounds.max.x) {
            if !borders[a].bounds.meets(&borders[b].bounds) {
                continue;
            }
            near[a].push(b);
            near[b].push(a);
            let (first, second) = (root(&mut roots, a), root(&mut roots, b));
            if first != second && borders[a].touches(&borders[b]) {
                roots[first.max(second)] = first.min(second);
            }
        }
    }
    let mut sets: Vec<(usize, Vec<usize>)> = Vec::new();
    for k in 0..faces.len() {
        let root = root(&mut roots, k);
        match sets.binary_search_by_key(&root, |set| set.0) {
            Ok(found) => sets[found].1.push(k),
            Err(place) => sets.insert(place, (root, vec![k])),
        }
    }
    let set = |(_, members): (usize, Vec<usize>)| {
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
    sets.into_iter().map(set).collect()
}

/// The set that a face belongs to, by its first face.
fn root(roots: &mut [usize], mut k: usize) -> usize {
    while roots[k] != k {
        roots[k] = roots[roots[k]];
        k = roots[k];
    }
    k
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

    /// Whether a point is as near as the curve may be: it passes both ends and the middle.
    fn is_near(&self, point: DVec3, slack: f64) -> bool {
        let [from, to] = self.ends;
        let distance = |from: DVec3, to: DVec3| {
            let along = to - from;
            let share = (point - from).dot(along) / along.length_squared();
            let share = if share.is_finite() {
                share.clamp(0.0, 1.0)
            } else {
                0.0
            };
            point.distance(from + along * share)
        };
        let near = distance(from, self.middle).min(distance(self.middle, to));
        near <= self.length() * NEAR[0] + slack
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
        let around = Aabb::around(chords.iter().flat_map(|chord| chord.ends));
        Self {
            chords,
            curve,
            bounds: grown(around, longest * NEAR[0]),
        }
    }

    /// Whether a point is as near to a chord as the curve may be.
    fn is_near(&self, point: DVec3, slack: f64) -> bool {
        let bounds = grown(self.bounds, slack);
        let is_inside = point.cmpge(bounds.min).all() && point.cmple(bounds.max).all();
        is_inside && self.chords.iter().any(|chord| chord.is_near(point, slack))
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
}

impl Border {
    fn of(face: &Face) -> Self {
        let surface = &face.patch.surface;
        let mut stretches = Vec::new();
        let mut whole = Vec::new();
        if face.patch.loops.is_empty() {
            whole = sides(surface);
        }
        let trims = face.patch.loops.iter().flat_map(|trim| trim.segments());
        for (number, curve) in whole.iter().chain(trims).enumerate() {
            let chords = along(curve, surface).into_iter();
            stretches.extend(chords.map(|chords| Stretch::new(chords, number)));
        }
        let slack = face.bounds.diagonal() * NEAR[1];
        let chords = stretches.iter().flat_map(|stretch| &stretch.chords);
        let longest = chords.map(Chord::length).fold(0.0, f64::max);
        Self {
            stretches,
            bounds: grown(face.bounds, longest * NEAR[0] + slack),
            slack,
            number: face.number,
        }
    }

    /// Chords that have a length, each with its curve.
    fn long(&self) -> impl Iterator<Item = (&Chord, usize)> {
        let stretches = self.stretches.iter();
        let chords = stretches.flat_map(|s| s.chords.iter().map(|chord| (chord, s.curve)));
        chords.filter(|(chord, _)| chord.length() > self.slack)
    }

    fn length(&self) -> f64 {
        self.long().map(|(chord, _)| chord.length()).sum()
    }

    /// Whether an end of a chord of one border is near a chord of the other.
    fn touches(&self, other: &Self) -> bool {
        let slack = self.slack.min(other.slack);
        let meets = |a: &Self, b: &Self| {
            let chords = a.stretches.iter().flat_map(|stretch| &stretch.chords);
            let mut ends = chords.map(|chord| chord.ends[0]);
            ends.any(|end| b.stretches.iter().any(|other| other.is_near(end, slack)))
        };
        meets(self, other) || meets(other, self)
    }

    /// The length of chords that meet no other curve of the borders around, itself among them.
    fn open_length(&self, around: &[&Self]) -> f64 {
        let meets = |chord: &Chord, curve: usize| {
            let own = chord.length() * NEAR[0];
            around.iter().any(|border| {
                let is_same = border.number == self.number;
                let mut others = border.stretches.iter();
                let slack = own + self.slack.max(border.slack);
                others.any(|other| {
                    !(is_same && other.curve == curve) && other.is_near(chord.middle, slack)
                })
            })
        };
        self.long()
            .filter(|(chord, curve)| !meets(chord, *curve))
            .map(|(chord, _)| chord.length())
            .sum()
    }
}

/// The four sides of a domain, each a curve.
fn sides(surface: &Surface) -> Vec<Curve<DVec2>> {
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let border = TrimLoop::border(&u, &v);
    let segments = border.iter().flat_map(|border| border.segments());
    segments.flat_map(Curve::bezier_pieces).collect()
}

/// The chords of a curve of the parameter domain, between each two knots.
fn along(curve: &Curve<DVec2>, surface: &Surface) -> Vec<Vec<Chord>> {
    let spans = [surface.knots_u(), surface.knots_v()].map(|knots| knots.breaks().len());
    let chords = spans[0].max(spans[1]).clamp(CHORDS[0], CHORDS[1]);
    let mut found = Vec::new();
    for pair in curve.knots().breaks().windows(2) {
        let step = (pair[1] - pair[0]) / chords as f64;
        let at = |k: f64| surface.evaluate(curve.evaluate(pair[0] + step * k));
        let chord = |k: usize| {
            let k = k as f64;
            Chord {
                ends: [at(k), at(k + 1.0)],
                middle: at(k + 0.5),
            }
        };
        found.push((0..chords).map(chord).collect());
    }
    found
}
