//! Surfaces, curves and boundaries as entities.

use glam::{DMat3, DVec2, DVec3};
use kernel::{Curve, Nest, Patch, Point, Surface, TrimLoop, WireShape, nesting};

use super::cards::{Deck, Entity, Record, Status};
use super::model::Carrier;
use crate::write::bounding_loops;

/// A face, in as many entities as it has outer loops: a trimmed surface (type 144) for each,
/// or the surface (type 128) where there are none. Loops end at the border of the domain, as
/// the standard wants them, except where the surface is closed.
///
/// # Errors
/// If trim curves leave the numbers that can be written.
pub(super) fn face(deck: &mut Deck, patch: &Patch) -> Result<Vec<usize>, kernel::Error> {
    if patch.loops.is_empty() {
        return Ok(vec![deck.add(Entity {
            kind: 128,
            record: surface(&patch.surface),
            ..Entity::default()
        })]);
    }
    let closed = patch.surface.closed();
    let carrier = Carrier::new(&patch.surface, closed);
    let mut faces = Vec::new();
    for group in outlines(patch)? {
        let base = deck.add(Entity {
            kind: 128,
            status: Status::Dependent,
            record: surface(&patch.surface),
            ..Entity::default()
        });
        let mut record = Record::new(144);
        record.integers([base, 1, group.len() - 1]);
        for trim in &group {
            record.integer(boundary(deck, base, trim, &carrier)?);
        }
        faces.push(deck.add(Entity {
            kind: 144,
            record,
            ..Entity::default()
        }));
    }
    Ok(faces)
}

/// The loops of a patch that has some: in groups, each an outer loop and the holes in it.
///
/// # Errors
/// If a number is not finite.
pub(super) fn outlines(patch: &Patch) -> Result<Vec<Vec<TrimLoop>>, kernel::Error> {
    let loops = bounding_loops(patch)?;
    let groups = nesting(&loops, patch.surface.periods()).into_iter();
    let group = |nest: Nest| [vec![nest.outer], nest.holes].concat();
    let groups = groups.map(|nest| group(nest).iter().map(|&k| loops[k].clone()).collect());
    Ok(groups.collect())
}

/// A curve (type 126), or points (type 116 each), with `outer` done to them.
pub(super) fn wire(deck: &mut Deck, shape: &WireShape, outer: DMat3) -> Vec<usize> {
    match shape {
        WireShape::Curve(own) => {
            let record = record(own, false, |point| outer * point);
            vec![spline(deck, Status::Independent, record)]
        }
        WireShape::Points(points) => {
            let point = |&point: &DVec3| {
                let mut record = Record::new(116);
                record.point(outer * point);
                record.integer(0);
                deck.add(Entity {
                    kind: 116,
                    record,
                    ..Entity::default()
                })
            };
            points.iter().map(point).collect()
        }
    }
}

/// A rational B-spline surface (type 128).
pub(super) fn surface(surface: &Surface) -> Record {
    let knots = [surface.knots_u(), surface.knots_v()];
    let [rows, columns] = knots.map(|knots| knots.count());
    let mut record = Record::new(128);
    record.integers(knots.map(|knots| knots.count() - 1));
    record.integers(knots.map(|knots| knots.degree()));
    record.integers(surface.closed().map(usize::from));
    record.integer(usize::from(!surface.is_rational()));
    record.integers([0, 0]);
    for knots in knots {
        record.reals(knots.as_slice().iter().copied());
    }
    // The first index runs fastest.
    let order = || (0..columns).flat_map(move |j| (0..rows).map(move |i| i * columns + j));
    let weights: Vec<_> = surface.weights().collect();
    let points: Vec<_> = surface.points().collect();
    record.reals(order().map(|k| weights[k]));
    order().for_each(|k| record.point(points[k]));
    for knots in knots {
        record.reals([knots.domain().start, knots.domain().end]);
    }
    record
}

/// A rational B-spline curve (type 126); `place` takes its points to space.
fn record<P: Point>(curve: &Curve<P>, planar: bool, place: impl Fn(P) -> DVec3) -> Record {
    let knots = curve.knots();
    let flags = [
        planar,
        curve.start() == curve.end(),
        !curve.is_rational(),
        false,
    ];
    let mut record = Record::new(126);
    record.integers([knots.count() - 1, knots.degree()]);
    record.integers(flags.map(usize::from));
    record.reals(knots.as_slice().iter().copied());
    record.reals(curve.weights());
    curve.points().for_each(|point| record.point(place(point)));
    record.reals([knots.domain().start, knots.domain().end]);
    record.point(if planar { DVec3::Z } else { DVec3::ZERO });
    record
}

/// A loop as a curve on a surface (type 142): by its curves in the parameter domain, which are
/// the masters, and by those in space.
fn boundary(
    deck: &mut Deck,
    base: usize,
    trim: &TrimLoop,
    carrier: &Carrier<'_>,
) -> Result<usize, kernel::Error> {
    let (mut flat, mut lifted) = (Vec::new(), Vec::new());
    for segment in trim.segments() {
        flat.push(flat_curve(deck, segment));
        lifted.push(curve(deck, &carrier.lift(segment)?));
    }
    let flat = composite(deck, &flat, Status::Parametric);
    let lifted = composite(deck, &lifted, Status::Dependent);
    let mut record = Record::new(142);
    record.integers([0, base, flat, lifted, 1]);
    Ok(deck.add(Entity {
        kind: 142,
        status: Status::Dependent,
        record,
        ..Entity::default()
    }))
}

/// Adds a curve of a parameter domain.
pub(super) fn flat_curve(deck: &mut Deck, curve: &Curve<DVec2>) -> usize {
    let record = record(curve, true, |point| point.extend(0.0));
    spline(deck, Status::Parametric, record)
}

/// Adds a curve of space that is there for another entity.
pub(super) fn curve(deck: &mut Deck, curve: &Curve<DVec3>) -> usize {
    let record = record(curve, false, |point| point);
    spline(deck, Status::Dependent, record)
}

/// Adds a curve (type 126).
fn spline(deck: &mut Deck, status: Status, record: Record) -> usize {
    deck.add(Entity {
        kind: 126,
        status,
        record,
        ..Entity::default()
    })
}

/// Curves joined into one (type 102), or the curve itself if it is alone.
fn composite(deck: &mut Deck, curves: &[usize], status: Status) -> usize {
    if let &[curve] = curves {
        return curve;
    }
    let mut record = Record::new(102);
    record.pointers(curves);
    deck.add(Entity {
        kind: 102,
        status,
        record,
        ..Entity::default()
    })
}
