//! Which curves around the faces of a shell are one edge: scenes do not say it, solids need it.
//!
//! Curves that run between the same two vertices, and along each other, are one edge of two faces, or the
//! seam of one. As few gaps as possible are closed: it is tried with narrow ones first. Where a curve
//! passes the end of another one, it is cut there. What stays without a partner leaves the shell open.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::collections::HashMap;

use glam::{DVec2, DVec3};
use kernel::{Aabb, Curve, Error, Sets, Surface, TrimLoop};

use super::model::Carrier;
use super::pace;
use super::pieces::Pieces;

/// How wide gaps between faces may be, as shares of the size of the shell: the least that will do.
const GAPS: [f64; 5] = [1e-7, 1e-6, 1e-5, 3e-5, 1e-4];

/// No gap is wider than this share of the size of a surface beside it, or else its curves would be taken
/// for those of another place.
const BESIDE: f64 = 1e-3;

/// How often curves without a partner are cut at most.
const CUTS: usize = 3;

/// Directions that differ by more make a corner, where an edge ends.
const CORNER: f64 = 1e-6;

/// Sides of a slit are no farther apart than this share of its length.
const SLIT: f64 = 1e-3;

/// Points of equal shares of an edge and of a curve of a domain are one up to this share of the size of
/// the shell.
const PACE: f64 = 1e-6;

/// Curves are compared at the ends of so many parts.
const PLACES: u8 = 8;

/// More curves than these between two vertices, or points of one, are not sorted out.
const MANY: usize = 1000;

/// A face: a surface with an outer loop and holes, all with the face on their left.
#[derive(Clone, Debug)]
pub(super) struct Face<'a> {
    pub(super) surface: &'a Surface,
    pub(super) loops: Vec<TrimLoop>,
}

/// An edge: its curve in space, and the vertices where it begins and ends.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    pub(super) curve: Curve<DVec3>,
    pub(super) ends: [usize; 2],
}

/// A stretch of a loop: its curve in the parameter domain, along the loop, and what that is in space.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    pub(super) flat: Curve<DVec2>,
    pub(super) along: Along,
}

/// What a stretch of a loop is in space.
#[derive(Clone, Copy, Debug)]
pub(super) enum Along {
    /// An edge, run through backwards or not.
    Edge(usize, bool),
    /// A vertex: a pole.
    Vertex(usize),
}

/// The edges and vertices of a shell, and the loops of its faces.
#[derive(Clone, Debug)]
pub(super) struct Shell {
    pub(super) vertices: Vec<DVec3>,
    pub(super) edges: Vec<Edge>,
    /// For every face its loops.
    pub(super) faces: Vec<Vec<Vec<Stretch>>>,
    /// For every face the component it belongs to, and whether it looks the other way than the first
    /// face of that.
    pub(super) turned: Vec<(usize, bool)>,
}

/// Why faces are no shell.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Flaw {
    /// So many curves have no partner.
    Open(usize),
    /// There is no inside.
    OneSided,
    /// A face has a slit.
    Slit,
    /// A curve leaves the numbers that can be written.
    Geometry(Error),
}

/// A curve around a face.
#[derive(Clone, Debug)]
struct Side {
    /// The numbers of the face and of the loop in it.
    place: [usize; 2],
    flat: Curve<DVec2>,
    curve: Curve<DVec3>,
}

/// Two sides that are one edge, and whether they run in opposite directions.
#[derive(Clone, Copy, Debug)]
struct Pair {
    sides: [usize; 2],
    is_opposite: bool,
}

/// The sides with their vertices, for one width of gaps.
#[derive(Clone, Debug)]
struct Joined {
    near: f64,
    /// Where each side begins and ends.
    ends: Vec<[usize; 2]>,
    vertices: Vec<DVec3>,
    pairs: Vec<Pair>,
    /// The sides without a partner.
    open: Vec<usize>,
    /// Whether a face is cut along a line, with both sides of that in the same place.
    has_slits: bool,
}

/// Finds the edges of the faces of a closed shell.
pub(super) fn shell(faces: &[Face<'_>]) -> Result<Shell, Flaw> {
    let carriers: Vec<_> = (faces.iter())
        .map(|face| Carrier::new(face.surface, face.surface.closed()))
        .collect();
    let sides = sides(faces, &carriers).map_err(Flaw::Geometry)?;
    let sizes: Vec<_> = (faces.iter())
        .map(|face| face.surface.hull_bounds().diagonal())
        .collect();
    let all = sides.iter().map(|side| side.curve.hull_bounds());
    let size = all.reduce(Aabb::union).map_or(0.0, |b| b.diagonal());
    let mut least = usize::MAX;
    for rounds in [0, CUTS] {
        for gap in GAPS {
            let near = size * gap;
            let Some(mut joined) = joined(&sides, &sizes, near) else {
                continue;
            };
            let mut sides = Cow::Borrowed(sides.as_slice());
            for _ in 0..rounds {
                let cut = cut(&sides, &joined, &carriers).map_err(Flaw::Geometry)?;
                let again = Some(()).filter(|()| cut.len() > sides.len());
                let Some(again) = again.and_then(|()| self::joined(&cut, &sizes, near)) else {
                    break;
                };
                (sides, joined) = (Cow::Owned(cut), again);
            }
            if joined.open.is_empty() {
                return finished(faces, &sides, joined, size);
            }
            least = least.min(joined.open.len());
        }
    }
    Err(Flaw::Open(least))
}

/// The curves around all faces, cut at their corners, in the order of their loops.
fn sides(faces: &[Face<'_>], carriers: &[Carrier<'_>]) -> Result<Vec<Side>, Error> {
    let is_corner = |before: &Curve<DVec2>, after: &Curve<DVec2>| {
        let [before, after] = [
            before.derivatives(before.domain().end),
            after.derivatives(after.domain().start),
        ]
        .map(|at| at.first.normalize_or_zero());
        before.distance(after) > CORNER
    };
    let mut sides = Vec::new();
    for ((index, face), carrier) in faces.iter().enumerate().zip(carriers) {
        for (number, trim) in face.loops.iter().enumerate() {
            for segment in trim.segments() {
                for flat in segment.clone().parts(is_corner) {
                    let curve = carrier.lift(&flat)?;
                    let place = [index, number];
                    sides.push(Side { place, flat, curve });
                }
            }
        }
    }
    Ok(sides)
}

/// Finds the vertices and the pairs for a width of gaps; `None` if too much would become one vertex.
fn joined(sides: &[Side], sizes: &[f64], near: f64) -> Option<Joined> {
    let (ends, vertices) = vertices(sides, near)?;
    let mut between: HashMap<[usize; 2], Vec<usize>> = HashMap::new();
    let mut order = Vec::new();
    for (index, side) in sides.iter().enumerate() {
        let [a, b] = ends[index];
        if a == b && is_point(side, near) {
            continue;
        }
        let key = [a.min(b), a.max(b)];
        let others = between.entry(key).or_default();
        if others.is_empty() {
            order.push(key);
        }
        others.push(index);
    }
    let (mut pairs, mut open, mut has_slits) = (Vec::new(), Vec::new(), false);
    for key in order {
        let mut left = between.remove(&key).unwrap_or_default();
        if left.len() > MANY {
            open.append(&mut left);
        }
        left.reverse();
        while let Some(one) = left.pop() {
            let gap = |other: usize| {
                let sizes = [one, other].map(|k| sizes[sides[k].place[0]] * BESIDE);
                let near = near.min(sizes[0]).min(sizes[1]);
                apart(&sides[one].curve, &sides[other].curve, near)
            };
            let gaps = left.iter().enumerate().rev();
            let partners = gaps.filter_map(|(k, &other)| Some((k, gap(other)?)));
            let Some((nearest, _)) = partners.min_by(|a, b| a.1.total_cmp(&b.1)) else {
                open.push(one);
                continue;
            };
            let other = left.remove(nearest);
            let is_opposite = match key[0] == key[1] {
                true => runs_against(&sides[one].curve, &sides[other].curve, near),
                false => ends[one][0] == ends[other][1],
            };
            has_slits |= is_slit(&sides[one], &sides[other]);
            let sides = [one, other];
            pairs.push(Pair { sides, is_opposite });
        }
    }
    Some(Joined {
        near,
        ends,
        vertices,
        pairs,
        open,
        has_slits,
    })
}

/// Whether a loop comes back along a side where it went: sides of a seam are a period apart.
fn is_slit(one: &Side, other: &Side) -> bool {
    let size = one.flat.start().distance(one.flat.end());
    let [back, on] = [other.flat.end(), other.flat.start()];
    one.place[0] == other.place[0]
        && one.flat.start().distance(back) <= size * SLIT
        && one.flat.end().distance(on) <= size * SLIT
}

/// Whether a curve is no more than a point.
fn is_point(side: &Side, near: f64) -> bool {
    let start = side.curve.start();
    let mut points = side.curve.points();
    points.all(|point| point.distance(start) <= near)
}

/// Points of a curve between its ends.
fn places(curve: &Curve<DVec3>) -> impl Iterator<Item = (f64, DVec3)> {
    let domain = curve.domain();
    (1..PLACES).map(move |k| {
        let share = f64::from(k) / f64::from(PLACES);
        let t = domain.start + (domain.end - domain.start) * share;
        (share, curve.evaluate(t))
    })
}

/// How far a curve is at most from another one; `None` if that is more than `near`.
fn apart(one: &Curve<DVec3>, other: &Curve<DVec3>, near: f64) -> Option<f64> {
    let (domain, pieces) = (other.domain(), OnceCell::new());
    let mut most = 0.0_f64;
    for (share, point) in places(one) {
        // Most are at the same share of both curves, or of one of them turned.
        let shares = [1.0 - share, share].into_iter();
        let off = shares.map(|share| {
            let t = domain.start + (domain.end - domain.start) * share;
            other.evaluate(t).distance(point)
        });
        let mut off = off.fold(f64::INFINITY, f64::min);
        if off > near {
            let pieces = pieces.get_or_init(|| Pieces::of(other));
            (_, off) = pieces.nearest(point, near)?;
        }
        most = most.max(off);
    }
    Some(most)
}

/// Whether two closed curves that begin in the same vertex, and run along each other, do so in opposite
/// directions.
fn runs_against(one: &Curve<DVec3>, other: &Curve<DVec3>, near: f64) -> bool {
    let pieces = Pieces::of(other);
    let nearest = |(_, point)| Some(pieces.nearest(point, near)?.0);
    let first = places(one).next().and_then(nearest);
    let last = places(one).last().and_then(nearest);
    first > last
}

/// The numbers of the vertices where sides begin and end, and their places; `None` if a vertex is much
/// wider than it may be.
fn vertices(sides: &[Side], near: f64) -> Option<(Vec<[usize; 2]>, Vec<DVec3>)> {
    let points: Vec<DVec3> = sides
        .iter()
        .flat_map(|side| [side.curve.start(), side.curve.end()])
        .collect();
    let mut sets = Sets::new(points.len());
    // A loop goes on where it was.
    let mut first = 0;
    for index in 0..sides.len() {
        let is_last = sides
            .get(index + 1)
            .is_none_or(|next| next.place != sides[index].place);
        let next = if is_last { first } else { index + 1 };
        sets.join(2 * index + 1, 2 * next);
        if is_last {
            first = index + 1;
        }
    }
    let cell = |point: DVec3| (point / near).floor();
    let key = |cell: DVec3| (cell + 0.0).to_array().map(f64::to_bits);
    let mut cells: HashMap<[u64; 3], Vec<usize>> = HashMap::new();
    for (index, &point) in points.iter().enumerate() {
        let own = cell(point);
        for around in 0..27_u8 {
            let step = [around % 3, around / 3 % 3, around / 9].map(|k| f64::from(k) - 1.0);
            for &other in cells
                .get(&key(own + DVec3::from(step)))
                .into_iter()
                .flatten()
            {
                if points[other].distance(point) <= near {
                    sets.join(other, index);
                }
            }
        }
        let inside = cells.entry(key(own)).or_default();
        if inside.iter().all(|&other| points[other] != point) {
            inside.push(index);
        }
        if inside.len() > MANY {
            return None;
        }
    }
    let (mut numbers, mut places) = (HashMap::new(), Vec::new());
    let mut ends = Vec::new();
    for (index, &point) in points.iter().enumerate() {
        let number = *numbers.entry(sets.root(index)).or_insert_with(|| {
            places.push(point);
            places.len() - 1
        });
        if point.distance(places[number]) > 2.0 * near {
            return None;
        }
        ends.push(number);
    }
    let ends = ends.chunks_exact(2).map(|pair| [pair[0], pair[1]]);
    Some((ends.collect(), places))
}

/// The sides, with those that have no partner cut at the vertices they pass.
fn cut(sides: &[Side], joined: &Joined, carriers: &[Carrier<'_>]) -> Result<Vec<Side>, Error> {
    let mut loose: Vec<usize> = joined.open.iter().flat_map(|&k| joined.ends[k]).collect();
    loose.sort_unstable();
    loose.dedup();
    let mut is_open = vec![false; sides.len()];
    joined.open.iter().for_each(|&k| is_open[k] = true);
    let mut all = Vec::new();
    for (index, side) in sides.iter().enumerate() {
        let domain = side.curve.domain();
        let mut stops = Vec::new();
        if is_open[index] {
            let (bounds, pieces) = (side.curve.hull_bounds(), Pieces::of(&side.curve));
            let around = DVec3::splat(joined.near);
            let (least, most) = (bounds.min - around, bounds.max + around);
            for &vertex in loose.iter().filter(|k| !joined.ends[index].contains(k)) {
                let point = joined.vertices[vertex];
                if point.cmplt(least).any() || point.cmpgt(most).any() {
                    continue;
                }
                // What is beside a knot would leave a piece that is none.
                let mut breaks = side.curve.knots().breaks().into_iter();
                let at = breaks.find(|&t| side.curve.evaluate(t).distance(point) <= joined.near);
                let at = at.or_else(|| Some(pieces.nearest(point, joined.near)?.0));
                stops.extend(at.filter(|&t| domain.start < t && t < domain.end));
            }
        }
        if stops.is_empty() {
            all.push(side.clone());
            continue;
        }
        stops.extend([domain.start, domain.end]);
        stops.sort_by(f64::total_cmp);
        stops.dedup();
        for range in stops.windows(2) {
            let flat = side.flat.restricted(range[0]..range[1])?;
            let curve = carriers[side.place[0]].lift(&flat)?;
            all.push(Side {
                place: side.place,
                flat,
                curve,
            });
        }
    }
    Ok(all)
}

/// The shell of sides that all have partners.
fn finished(faces: &[Face<'_>], sides: &[Side], joined: Joined, size: f64) -> Result<Shell, Flaw> {
    if joined.has_slits {
        return Err(Flaw::Slit);
    }
    let turned = turned(sides, &joined.pairs, faces.len()).ok_or(Flaw::OneSided)?;
    let mut edges = Vec::new();
    let mut along: Vec<_> = joined
        .ends
        .iter()
        .map(|ends| Along::Vertex(ends[0]))
        .collect();
    let mut flats: Vec<_> = sides.iter().map(|side| side.flat.clone()).collect();
    let near = 2.0 * joined.near + size * PACE;
    for pair in &joined.pairs {
        let ([one, other], paced) = matched(faces, sides, pair, near).map_err(Flaw::Geometry)?;
        along[one] = Along::Edge(edges.len(), false);
        along[other] = Along::Edge(edges.len(), pair.is_opposite);
        edges.push(Edge {
            curve: sides[one].curve.clone(),
            ends: joined.ends[one],
        });
        if let Some(paced) = paced {
            flats[other] = paced;
        }
    }
    let mut loops: Vec<Vec<Vec<Stretch>>> = vec![Vec::new(); faces.len()];
    for ((side, flat), along) in sides.iter().zip(flats).zip(along) {
        let [face, number] = side.place;
        let own = &mut loops[face];
        if own.len() <= number {
            own.resize_with(number + 1, Vec::new);
        }
        own[number].push(Stretch { flat, along });
    }
    Ok(Shell {
        vertices: joined.vertices,
        edges,
        faces: loops,
        turned,
    })
}

/// The side of a pair that gives the edge its curve, and the other one, with what that becomes if it
/// runs at another pace: in planes it is the edge, elsewhere straight ones stay straight.
fn matched(
    faces: &[Face<'_>],
    sides: &[Side],
    pair: &Pair,
    near: f64,
) -> Result<([usize; 2], Option<Curve<DVec2>>), Error> {
    let [one, other] = pair.sides;
    let turned = |curve: &Curve<DVec3>| match pair.is_opposite {
        true => curve.reversed(),
        false => curve.clone(),
    };
    let size = |k: usize| sides[k].curve.homogeneous().len();
    let is_same = pace::is_same(&sides[one].curve, &turned(&sides[other].curve), near);
    let rank = |k: usize| {
        let is_plane = pace::is_plane(faces[sides[k].place[0]].surface);
        (is_plane, sides[k].flat.homogeneous().len() == 2)
    };
    let is_turned = match is_same {
        true => size(other) < size(one),
        false => rank(other) < rank(one),
    };
    let [one, other] = if is_turned {
        [other, one]
    } else {
        [one, other]
    };
    if is_same {
        return Ok(([one, other], None));
    }
    let (edge, side) = (turned(&sides[one].curve), &sides[other]);
    let ends = [side.flat.start(), side.flat.end()];
    let paced = match pace::in_plane(faces[side.place[0]].surface, &edge, ends) {
        Some(image) => image,
        None => pace::paced(&side.flat, &side.curve, &edge, near)?,
    };
    Ok(([one, other], Some(paced)))
}

/// For every face its component, and whether it looks the other way than the first one there; `None`
/// if faces cannot all look to the same side.
fn turned(sides: &[Side], pairs: &[Pair], count: usize) -> Option<Vec<(usize, bool)>> {
    let mut beside = vec![Vec::new(); count];
    for pair in pairs {
        let [one, other] = pair.sides.map(|k| sides[k].place[0]);
        beside[one].push((other, !pair.is_opposite));
        beside[other].push((one, !pair.is_opposite));
    }
    let mut turned: Vec<Option<(usize, bool)>> = vec![None; count];
    for first in 0..count {
        if turned[first].is_some() {
            continue;
        }
        turned[first] = Some((first, false));
        let mut waiting = vec![(first, false)];
        while let Some((face, own)) = waiting.pop() {
            for &(other, is_against) in &beside[face] {
                match turned[other] {
                    Some((_, known)) if known != (own ^ is_against) => return None,
                    Some(_) => {}
                    None => {
                        turned[other] = Some((first, own ^ is_against));
                        waiting.push((other, own ^ is_against));
                    }
                }
            }
        }
    }
    turned.into_iter().collect()
}
