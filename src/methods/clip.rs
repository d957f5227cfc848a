//! Bézier clipping: parts of a piece in which the distance from a line cannot vanish are cut
//! off, along u and v by turns \[Nishita 1990\].

use glam::DVec2;
use kernel::{Aabb, MAX_DEGREE};

use super::boxes::{Boxes, Rule, Stack};
use super::world::{Piece, Planes, View, World};
use super::{Counts, Found, Shot};
use crate::intersect::net::{Degrees, restrict};

/// A clip that leaves more than this share is replaced by cutting in two.
const LEFT: f64 = 0.8;

/// Clips are this much wider than computed.
const SAFETY: f64 = 0.01;

/// Parts of a piece that are examined, at most, for each ray: a guard against surfaces that
/// touch the ray along a curve.
const MOST_PARTS: u32 = 4096;

/// How 1990 and 2005 differ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    /// Whether distances are divided by weights before they are compared with tolerances.
    pub(super) divides: bool,
    /// Whether the longer diagonal replaces a direction that nearly vanishes.
    pub(super) is_robust: bool,
    /// Whether roots found twice are merged.
    pub(super) merges: bool,
    /// Intervals shorter than this end the clipping.
    pub(super) shortest: f64,
}

impl Rules {
    pub(super) const NISHITA: Self = Self {
        divides: false,
        is_robust: false,
        merges: false,
        // The paper has no such bound, but rounding would let some intervals stand still.
        shortest: 1.0 / (1_u64 << 48) as f64,
    };

    pub(super) const EFREMOV: Self = Self {
        divides: true,
        is_robust: true,
        merges: true,
        shortest: 1.0 / (1_u64 << 40) as f64,
    };
}

/// Parameters of one root found twice differ by less, in local units.
const SAME: f64 = 1e-5;

/// Clipping on the pieces that a ray passes.
#[derive(Debug)]
pub(super) struct Clipper<'a> {
    pub(super) world: &'a World,
    pub(super) view: &'a View,
    boxes: Boxes,
    rules: Rules,
}

/// Memory that is used again from ray to ray.
#[derive(Debug, Default)]
pub(super) struct Room {
    stack: Stack,
    clip: ClipRoom,
}

#[derive(Debug, Default)]
struct ClipRoom {
    parts: Vec<Part>,
    nets: Vec<[f64; 2]>,
    net: Vec<[f64; 2]>,
    spare: Vec<[f64; 2]>,
    roots: Vec<DVec2>,
}

/// A rectangle of a piece in local parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Part {
    u: (f64, f64),
    v: (f64, f64),
    along_v: bool,
}

impl Part {
    const WHOLE: Self = Self {
        u: (0.0, 1.0),
        v: (0.0, 1.0),
        along_v: false,
    };

    fn middle(&self) -> DVec2 {
        DVec2::new(self.u.0 + self.u.1, self.v.0 + self.v.1) * 0.5
    }

    /// The part over a range of one of its own parameters.
    fn within(self, along_v: bool, (a, b): (f64, f64)) -> Self {
        let inner = |(low, high): (f64, f64)| (low + (high - low) * a, low + (high - low) * b);
        if along_v {
            Self {
                v: inner(self.v),
                ..self
            }
        } else {
            Self {
                u: inner(self.u),
                ..self
            }
        }
    }
}

impl<'a> Clipper<'a> {
    pub(super) fn new(world: &'a World, view: &'a View, rules: Rules) -> Self {
        let boxes: Vec<Aabb> = world.pieces.iter().map(|piece| piece.bounds).collect();
        Self {
            world,
            view,
            boxes: Boxes::build(&boxes, Rule::Area),
            rules,
        }
    }

    /// The first root of a ray with a parameter below `end`, with its piece; pieces that
    /// `passes` tells of are left out.
    pub(super) fn nearest(
        &self,
        shot: &Shot,
        end: f64,
        passes: impl Fn(u32) -> bool,
        room: &mut Room,
        counts: &mut Counts,
    ) -> Option<(Found, u32)> {
        let planes = Planes::of(&shot.ray);
        let (mut range, mut best) = (0.0..end, None);
        let Room { stack, clip } = room;
        self.boxes
            .visit(&shot.ray, &mut range, stack, |number, range| {
                if passes(number) {
                    return;
                }
                let piece = &self.world.pieces[number as usize];
                let accuracy = self.view.accuracy(self.depth(piece, &planes));
                self.roots(piece, &planes, accuracy, clip, counts);
                let sheet = self.world.sheet(piece.sheet);
                for &local in &clip.roots {
                    let uv = piece.global(local);
                    let t = planes.time(&self.world.value(sheet, uv, counts));
                    if range.contains(&t) && self.world.keeps(sheet, uv) {
                        range.end = t;
                        let shape = sheet.number;
                        best = Some((Found { t, uv, shape }, number));
                    }
                }
            });
        best
    }

    /// About where along the ray a piece lies.
    fn depth(&self, piece: &Piece, planes: &Planes) -> f64 {
        let [x, y, z] = piece.bounds.center().to_array();
        planes.time(&[x, y, z, 1.0])
    }

    /// Replaces `room.roots` by all roots in a piece, in its local parameters.
    fn roots(
        &self,
        piece: &Piece,
        planes: &Planes,
        accuracy: f64,
        room: &mut ClipRoom,
        counts: &mut Counts,
    ) {
        counts.starts += 1;
        let net = self.world.net(piece);
        room.roots.clear();
        room.parts.clear();
        room.nets.clear();
        for copy in [&mut room.net, &mut room.spare] {
            copy.clear();
            copy.extend(net.iter().map(|h| planes.weighted(h).to_array()));
        }
        // The tolerance in the units of the net.
        let least = net.iter().fold(f64::INFINITY, |least, h| least.min(h[3]));
        let accuracy = accuracy * if self.rules.divides { least } else { 1.0 };
        room.nets.extend_from_slice(&room.net);
        room.parts.push(Part::WHOLE);
        let mut examined = 0;
        while let Some(mut part) = room.parts.pop() {
            let below = room.nets.len() - net.len();
            room.net.copy_from_slice(&room.nets[below..]);
            room.nets.truncate(below);
            if examined > MOST_PARTS {
                counts.capped += 1;
                return;
            }
            match self.shrink(&mut part, piece.degrees, accuracy, room, &mut examined) {
                End::Empty => {}
                End::Root => {
                    counts.converged += 1;
                    self.keep(part.middle(), &mut room.roots);
                }
                End::Stuck => {
                    let along_v = part.v.1 - part.v.0 > part.u.1 - part.u.0;
                    for half in [(0.0, 0.5), (0.5, 1.0)] {
                        let first = room.nets.len();
                        room.nets.extend_from_slice(&room.net);
                        let ClipRoom { nets, spare, .. } = room;
                        cut(&mut nets[first..], spare, piece.degrees, along_v, half);
                        room.parts.push(part.within(along_v, half));
                    }
                }
            }
        }
        counts.cuts += u64::from(examined);
    }

    /// Clips the net in `room`, which is that of `part`, as long as that helps.
    fn shrink(
        &self,
        part: &mut Part,
        degrees: Degrees,
        accuracy: f64,
        room: &mut ClipRoom,
        examined: &mut u32,
    ) -> End {
        let mut idle = 0;
        while idle < 2 {
            *examined += 1;
            let (low, high) = extent(&room.net);
            if low.max_element() > 0.0 || high.min_element() < 0.0 {
                return End::Empty;
            }
            let longer = (part.u.1 - part.u.0).max(part.v.1 - part.v.0);
            if (high - low).max_element() <= accuracy || longer < self.rules.shortest {
                return End::Root;
            }
            let along_v = part.along_v;
            let line = direction(&room.net, degrees, along_v, self.rules.is_robust);
            let Some((a, b)) = clip(&room.net, degrees, along_v, line) else {
                return End::Empty;
            };
            let (a, b) = (a * (1.0 - SAFETY), b * (1.0 - SAFETY) + SAFETY);
            if b - a <= LEFT {
                cut(&mut room.net, &mut room.spare, degrees, along_v, (a, b));
                *part = part.within(along_v, (a, b));
                idle = 0;
            } else {
                idle += 1;
            }
            part.along_v = !along_v;
        }
        End::Stuck
    }

    fn keep(&self, root: DVec2, roots: &mut Vec<DVec2>) {
        let is_known = |other: &DVec2| (*other - root).abs().max_element() <= SAME;
        if !(self.rules.merges && roots.iter().any(is_known)) {
            roots.push(root);
        }
    }
}

/// How the clipping of a part ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Empty,
    Root,
    /// Clips remove too little.
    Stuck,
}

/// Restricts a net to a range of one of its parameters.
fn cut(
    net: &mut [[f64; 2]],
    spare: &mut [[f64; 2]],
    degrees: Degrees,
    along_v: bool,
    range: (f64, f64),
) {
    const ALL: (f64, f64) = (0.0, 1.0);
    let (u, v) = if along_v { (ALL, range) } else { (range, ALL) };
    restrict(net, spare, degrees, u, v);
}

/// The least and the greatest coordinates of a net.
fn extent(net: &[[f64; 2]]) -> (DVec2, DVec2) {
    let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    net.iter().fold(start, |(low, high), p| {
        let p = DVec2::from_array(*p);
        (low.min(p), high.max(p))
    })
}

/// The direction of the line from which distances are taken for a clip along u or v: the mean
/// of the two edges that run along the other parameter.
///
/// `is_robust` takes the longer diagonal where both edges together nearly vanish.
pub(super) fn direction(
    net: &[[f64; 2]],
    degrees: Degrees,
    along_v: bool,
    is_robust: bool,
) -> DVec2 {
    let row = degrees.q + 1;
    let last = degrees.p * row;
    let [a, b, c, d] = [0, degrees.q, last, last + degrees.q].map(|k| DVec2::from_array(net[k]));
    // Corners: a and b at the start of u, c and d at its end.
    let edges = if along_v {
        (c - a) + (d - b)
    } else {
        (b - a) + (d - c)
    };
    let diagonals = [d - a, if along_v { c - b } else { b - c }];
    let longest = if diagonals[0].length() > diagonals[1].length() {
        diagonals[0]
    } else {
        diagonals[1]
    };
    if is_robust && edges.length() < 1e-3 * longest.length() {
        longest
    } else {
        edges
    }
}

/// The range of one parameter outside of which the distance from the line through the origin
/// along `line` does not vanish: where the convex hull of the explicit distances meets zero.
/// `None` if nowhere.
pub(super) fn clip(
    net: &[[f64; 2]],
    degrees: Degrees,
    along_v: bool,
    line: DVec2,
) -> Option<(f64, f64)> {
    let count = if along_v { degrees.q } else { degrees.p };
    let mut columns = [(f64::INFINITY, f64::NEG_INFINITY); MAX_DEGREE + 1];
    for (k, point) in net.iter().enumerate() {
        let (i, j) = (k / (degrees.q + 1), k % (degrees.q + 1));
        let column = &mut columns[if along_v { j } else { i }];
        let distance = line.perp_dot(DVec2::from_array(*point));
        *column = (column.0.min(distance), column.1.max(distance));
    }
    let columns = &columns[..=count];
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    let place = |k: usize| k as f64 / count.max(1) as f64;
    let mut meet = |x: f64| (first, last) = (first.min(x), last.max(x));
    for (i, &(low, high)) in columns.iter().enumerate() {
        if low <= 0.0 && high >= 0.0 {
            meet(place(i));
        }
        // Edges of the hull that pass zero join extremes of two columns.
        for (j, &(other_low, other_high)) in columns.iter().enumerate().skip(i + 1) {
            for (a, b) in [
                (low, other_low),
                (low, other_high),
                (high, other_low),
                (high, other_high),
            ] {
                if (a < 0.0) != (b < 0.0) {
                    meet(place(i) + (place(j) - place(i)) * (a / (a - b)));
                }
            }
        }
    }
    (first <= last).then_some((first, last))
}
