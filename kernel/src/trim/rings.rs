//! Paths that run around a closed surface: the bands between each two of them, and what lies
//! between the outermost ones and the border.

use std::slice;

use glam::DVec2;

use super::close::{Closer, NEAR, TILES, hull};
use super::parts::{cut, moved};
use crate::{Curve, Error};

impl Closer<'_> {
    /// Adds loops around the bands that belong to the face, of paths that run around along `axis`
    /// for a whole period.
    pub(super) fn add_bands(
        &self,
        rings: &[Vec<Curve<DVec2>>],
        axis: usize,
        loops: &mut Vec<Vec<Curve<DVec2>>>,
    ) -> Result<(), Error> {
        let other = 1 - axis;
        let leveled = rings.iter().map(|ring| self.leveled(ring, axis));
        let mut leveled: Vec<_> = leveled.collect();
        leveled.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let rings: Vec<_> = leveled.into_iter().map(|(_, ring)| ring).collect();
        let is_odd = !rings.len().is_multiple_of(2);
        let begins_inside = is_odd != self.is_inverted(&rings, axis);
        let begun = rings.into_iter().map(|ring| self.begun_at_seam(ring, axis));
        let mut rings = begun.collect::<Result<Vec<_>, _>>()?.into_iter();
        if begins_inside && let Some(ring) = rings.next() {
            loops.push(self.completed(ring, axis, self.start[other])?);
        }
        while let Some(ring) = rings.next() {
            loops.push(match rings.next() {
                Some(above) => self.joined(ring, &above, axis)?,
                None => self.completed(ring, axis, self.start[other] + self.size[other])?,
            });
        }
        Ok(())
    }

    /// Whether the part of the domain next to the lower border, which an even number of rings
    /// leave out, belongs to the face, or the other way round; the rings are in their order.
    fn is_inverted(&self, rings: &[Vec<Curve<DVec2>>], axis: usize) -> bool {
        if rings.len().is_multiple_of(2) && !self.closed[1 - axis] {
            return false;
        }
        let (mut agree, mut differ) = (0, 0);
        for (above, ring) in rings.iter().rev().enumerate() {
            let is_inside = above % 2 == 1;
            // To the left of u is the larger v, to the left of v the smaller u.
            let wanted = is_forward(ring, axis) == (axis == 0);
            *(if is_inside == wanted {
                &mut agree
            } else {
                &mut differ
            }) += 1;
        }
        differ > agree
    }

    /// A ring moved by whole periods across it so that its height is in the domain, and the height.
    fn leveled(&self, path: &[Curve<DVec2>], axis: usize) -> (f64, Vec<Curve<DVec2>>) {
        let other = 1 - axis;
        let height = self.height(path, axis);
        let mut shift = DVec2::ZERO;
        if self.closed[other] {
            let periods = ((height - self.start[other]) / self.size[other]).floor();
            shift[other] = -periods * self.size[other];
        }
        let moved = path.iter().map(|curve| moved(curve, shift));
        (height + shift[other], moved.collect())
    }

    /// Where a ring passes the seam last, coming from below: of two that do not cross, it is the upper one
    /// that is higher there, whatever they do elsewhere.
    fn height(&self, path: &[Curve<DVec2>], axis: usize) -> f64 {
        let (start, size) = (self.start[axis], self.size[axis]);
        let mut height = f64::NEG_INFINITY;
        let mut pass = |p: DVec2| height = height.max(p[1 - axis]);
        for curve in path {
            let turns = (curve.start()[axis] - start) / size;
            if (turns - turns.round()).abs() <= NEAR {
                pass(curve.start());
            }
            let (min, max) = hull(slice::from_ref(curve));
            let first = ((min[axis] - start) / size).floor();
            let seams = (0..=TILES).map(|k| start + (first + f64::from(k)) * size);
            for seam in seams.take_while(|seam| *seam <= max[axis]) {
                let met = curve.crossings(axis, seam, size * NEAR);
                met.into_iter().for_each(|t| pass(curve.evaluate(t)));
            }
        }
        if height.is_finite() {
            height
        } else {
            path.first().map_or(0.0, |curve| curve.start()[1 - axis])
        }
    }

    /// The loop around what lies between a ring and a border across it.
    fn completed(
        &self,
        ring: Vec<Curve<DVec2>>,
        axis: usize,
        border: f64,
    ) -> Result<Vec<Curve<DVec2>>, Error> {
        let (start, end) = ends(&ring)?;
        let corner = |mut p: DVec2| {
            p[1 - axis] = border;
            p
        };
        through(ring, &[end, corner(end), corner(start), start])
    }

    /// The loop around what lies between two rings.
    fn joined(
        &self,
        mut ring: Vec<Curve<DVec2>>,
        other: &[Curve<DVec2>],
        axis: usize,
    ) -> Result<Vec<Curve<DVec2>>, Error> {
        let mut back = if is_forward(&ring, axis) == is_forward(other, axis) {
            other.iter().rev().map(Curve::reversed).collect()
        } else {
            other.to_vec()
        };
        let ((start, end), (next, _)) = (ends(&ring)?, ends(&back)?);
        let mut shift = DVec2::ZERO;
        shift[axis] = self.periods(end - next)[axis];
        for curve in &mut back {
            *curve = moved(curve, shift);
        }
        let (next, last) = ends(&back)?;
        ring = through(ring, &[end, next])?;
        ring.append(&mut back);
        through(ring, &[last, start])
    }

    /// A ring begun anew where it crosses the seam.
    fn begun_at_seam(
        &self,
        path: Vec<Curve<DVec2>>,
        axis: usize,
    ) -> Result<Vec<Curve<DVec2>>, Error> {
        let (size, near) = (self.size[axis], self.size[axis] * NEAR);
        let begin = path.first().map_or(0.0, |c| c.start()[axis]) - self.start[axis];
        if (begin - (begin / size).round() * size).abs() <= near {
            return Ok(path);
        }
        let periods = if is_forward(&path, axis) {
            (begin / size).ceil()
        } else {
            (begin / size).floor()
        };
        let seam = self.start[axis] + size * periods;
        let turn = path
            .last()
            .zip(path.first())
            .map(|(a, b)| self.periods(a.end() - b.start()));
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for curve in path {
            for piece in cut(&curve, axis, &[seam])? {
                let crossed = !after.is_empty() || (piece.start()[axis] - seam).abs() <= near;
                if crossed { &mut after } else { &mut before }.push(piece);
            }
        }
        let shift = turn.unwrap_or_default();
        after.extend(before.iter().map(|curve| moved(curve, shift)));
        Ok(after)
    }
}

/// Whether a ring runs towards larger parameters.
fn is_forward(ring: &[Curve<DVec2>], axis: usize) -> bool {
    ends(ring).is_ok_and(|(start, end)| end[axis] > start[axis])
}

/// Where a path starts and ends.
fn ends(path: &[Curve<DVec2>]) -> Result<(DVec2, DVec2), Error> {
    let ends = path.first().zip(path.last());
    let (first, last) = ends.ok_or(Error::EmptyLoop)?;
    Ok((first.start(), last.end()))
}

/// A path continued straight through some points.
fn through(mut path: Vec<Curve<DVec2>>, points: &[DVec2]) -> Result<Vec<Curve<DVec2>>, Error> {
    for pair in points.windows(2) {
        if pair[0] != pair[1] {
            path.push(Curve::line(pair[0], pair[1], 0.0..1.0)?);
        }
    }
    Ok(path)
}
