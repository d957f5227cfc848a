//! Edges of solids whose curves of space are off the surfaces that they bound.
//!
//! Some programs write other curves than the ellipses in which planes cut cylinders and cones, beside the right
//! curves of the parameter domain.

use std::cell::Cell;
use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Curve, modelling};

use super::boundary::{self, Boundary};
use super::curves::Reader;
use super::directory::{File, WHOLE};
use super::entities::{self, Content};
use super::quadric::{Quadric, READINGS, Reading};
use super::sheets::{self, SheetShape};
use super::transform::Transforms;
use crate::Problem;

/// A curve is off its surface beyond this share of its size.
const ASTRAY: f64 = 1e-3;

/// The curve that takes its place ends at the vertices of the edge up to this share of its size,
const MEETS: f64 = 1e-5;

/// is fitted up to this share,
const ACCURACY: f64 = 1e-9;

/// and is nowhere farther from it than this share.
const NEAR: f64 = 0.25;

/// Control points of all such curves.
const MOST: usize = 1_000_000;

/// Curves are compared at the ends of so many parts.
const PLACES: u8 = 32;

/// An edge as its list has it: pointers to its curve and to the lists of its vertices, with their numbers there.
type Edge = (i64, [(i64, i64); 2]);

/// Looks for such edges, and puts others in the place of their curves; what is to be told of that.
pub(super) fn settle(file: &File<'_>) -> Vec<(usize, Problem)> {
    let laying = Cell::new(0);
    let mut transforms = Transforms::default();
    let mut search = Search {
        reader: Reader {
            file,
            transforms: &mut transforms,
            repairs: Vec::new(),
            bases: Vec::new(),
            limit: file.entries.len(),
            laying: &laying,
        },
        edges: HashMap::new(),
        seen: HashSet::new(),
        mended: HashMap::new(),
        left: MOST,
    };
    for (index, entry) in file.entries.iter().enumerate() {
        if entry.kind == 510 {
            // What is wrong with it is told when it is shown.
            let _ = search.face(index);
        }
    }
    let mut told: Vec<_> = search.mended.keys().copied().collect();
    told.sort_unstable();
    let _ = file.mended.set(search.mended);
    file.take_asked();
    let text = "a curve of space is off its surface; that of the parameter domain is used";
    let tell = |index: usize| (index, Problem::Invalid(text.to_owned()));
    told.into_iter().map(tell).collect()
}

struct Search<'a, 'b> {
    reader: Reader<'a, 'b>,
    /// By the pointer to their list.
    edges: HashMap<i64, Vec<Edge>>,
    /// Curves, each with a surface that it has been held against.
    seen: HashSet<(i64, i64)>,
    /// By the entity of the curve.
    mended: HashMap<usize, Curve<DVec3>>,
    /// How many more control points these may have.
    left: usize,
}

impl Search<'_, '_> {
    fn face(&mut self, index: usize) -> Result<(), Problem> {
        let file = self.reader.file;
        let Some(Content::Face { surface, boundary }) =
            entities::read(file, index)?.map(|entity| entity.content)
        else {
            return Ok(());
        };
        let base = file.follow(surface, "the surface")?;
        let Boundary::Loops(loops) = boundary else {
            return Ok(());
        };
        if !matches!(file.entries[base].kind, 192 | 194 | 196 | 198) || file.entries[base].form != 1
        {
            return Ok(());
        }
        let sheet = sheets::read(&mut self.reader, base, true)?;
        let SheetShape::Quadric(quadric) = &sheet.shape else {
            return Ok(());
        };
        if sheet.place != DAffine3::IDENTITY {
            return Ok(());
        }
        for pointer in loops {
            let one = boundary::read(file, pointer)?.unwrap_or_default();
            for stretch in one.uses {
                let &[flat] = stretch.flat.as_slice() else {
                    continue;
                };
                if stretch.edge == 0 || stretch.matrix != 0 {
                    continue;
                }
                let (curve, ends) = self.edge(stretch.space, stretch.edge)?;
                if self.seen.insert((curve, surface)) {
                    self.hold(quadric, curve, ends, flat)?;
                }
            }
        }
        Ok(())
    }

    /// An edge of a list, counted from 1 on.
    fn edge(&mut self, list: i64, number: i64) -> Result<Edge, Problem> {
        if !self.edges.contains_key(&list) {
            let edges = edges(self.reader.file, list)?;
            self.edges.insert(list, edges);
        }
        let place = usize::try_from(number).ok().and_then(|n| n.checked_sub(1));
        let edge = place.and_then(|place| self.edges[&list].get(place));
        edge.copied()
            .ok_or_else(|| Problem::Invalid("no such edge".to_owned()))
    }

    /// Holds an edge against a surface.
    fn hold(
        &mut self,
        quadric: &Quadric,
        curve: i64,
        ends: [(i64, i64); 2],
        flat: i64,
    ) -> Result<(), Problem> {
        let file = self.reader.file;
        let index = file.follow(curve, "an edge")?;
        if file.entries[index].kind != 126 || self.mended.contains_key(&index) || self.left == 0 {
            return Ok(());
        }
        let [rail] = self
            .reader
            .rails(index)?
            .try_into()
            .map_err(|_| several())?;
        let space = rail.curve;
        let size = space.hull_bounds().diagonal();
        if places(&space).all(|point| quadric.off(point) <= ASTRAY * size) {
            return Ok(());
        }
        let [flat] = self.reader.flat(flat)?.try_into().map_err(|_| several())?;
        let mut vertices = [DVec3::ZERO; 2];
        for (vertex, (list, number)) in vertices.iter_mut().zip(ends) {
            *vertex = vertex_of(file, list, number)?;
        }
        let domain = flat.domain();
        for reading in READINGS {
            let at = |share: f64| {
                let t = domain.start + (domain.end - domain.start) * share;
                quadric.point(flat.evaluate(t), reading)
            };
            let apart = |ends: [f64; 2]| {
                let [a, b] = ends.map(at);
                a.distance(vertices[0]).max(b.distance(vertices[1]))
            };
            let is_near = |point: DVec3| places(&space).any(|p| p.distance(point) <= NEAR * size);
            if apart([0.0, 1.0]).min(apart([1.0, 0.0])) <= MEETS * size
                && shares().map(at).all(is_near)
            {
                let mended = lifted(quadric, reading, &flat, size)?;
                self.left = self.left.saturating_sub(mended.points().count());
                let mended = if runs_against(&mended, &space) {
                    mended.reversed()
                } else {
                    mended
                };
                self.mended.insert(index, mended);
                break;
            }
        }
        Ok(())
    }
}

fn several() -> Problem {
    Problem::Invalid("several curves where one is wanted".to_owned())
}

/// Points of a curve.
fn places(curve: &Curve<DVec3>) -> impl Iterator<Item = DVec3> {
    let domain = curve.domain();
    shares().map(move |share| curve.evaluate(domain.start + (domain.end - domain.start) * share))
}

/// Where curves are looked at, as shares of their domain.
fn shares() -> impl Iterator<Item = f64> {
    (0..=PLACES).map(|k| f64::from(k) / f64::from(PLACES))
}

/// Whether a curve runs against another one beside it.
fn runs_against(one: &Curve<DVec3>, other: &Curve<DVec3>) -> bool {
    let at = |curve: &Curve<DVec3>, share: f64| {
        let domain = curve.domain();
        curve.evaluate(domain.start + (domain.end - domain.start) * share)
    };
    let apart = |a: f64, b: f64| at(one, a).distance(at(other, b));
    apart(0.25, 0.75) + apart(0.75, 0.25) < apart(0.25, 0.25) + apart(0.75, 0.75)
}

/// A curve of the parameter domain in space.
fn lifted(
    quadric: &Quadric,
    reading: Reading,
    flat: &Curve<DVec2>,
    size: f64,
) -> Result<Curve<DVec3>, Problem> {
    let at = |t: f64| quadric.point(flat.evaluate(t), reading);
    let breaks = flat.knots().breaks();
    let fit = modelling::fit(at, &breaks, ACCURACY * size, DVec3::distance);
    Ok(fit.map_err(Problem::Geometry)?.curve)
}

/// The edges of a list (type 504).
fn edges(file: &File<'_>, pointer: i64) -> Result<Vec<Edge>, Problem> {
    let index = file.follow(pointer, "an edge list")?;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let count = parameters.count()?;
    let mut edges = Vec::new();
    for _ in 0..parameters.expect(count, "edges")? {
        let curve = parameters.integer()?;
        let mut end = || Ok::<_, Problem>((parameters.integer_or(0)?, parameters.integer_or(0)?));
        edges.push((curve, [end()?, end()?]));
    }
    Ok(edges)
}

/// A vertex of a list (type 502), counted from 1 on.
fn vertex_of(file: &File<'_>, pointer: i64, number: i64) -> Result<DVec3, Problem> {
    let index = file.follow(pointer, "a vertex list")?;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let count = parameters.count()?;
    let before = u64::try_from(number.saturating_sub(1)).unwrap_or(count);
    if before >= count {
        return Err(Problem::Invalid("no such vertex".to_owned()));
    }
    parameters.skip(before.saturating_mul(3));
    let mut real = || parameters.real();
    Ok(DVec3::new(real()?, real()?, real()?))
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use crate::iges::testing::{formed, part, read, shows};

    #[test]
    fn edges_off_their_surface_give_way_to_their_parameters() {
        // Around the top of a cylinder, but for the vertex too low and too far out.
        let place = |k: u32| match k {
            0 | 8 => ",1.,0.,2.".to_owned(),
            _ => {
                let angle = f64::from(k).to_radians() * 45.0;
                format!(",{:?},{:?},1.5", 1.1 * angle.cos(), 1.1 * angle.sin())
            }
        };
        let places: String = (0..=8).map(place).collect();
        let knots = "0.,0.,1.,2.,3.,4.,5.,6.,7.,8.,8.,1.,1.,1.,1.,1.,1.,1.,1.,1.";
        for (flat, text) in [
            (
                "0.,2.,0.,360.,2.,0.",
                "that of the parameter domain is used",
            ),
            (
                "6.283185307179586,2.,0.,0.,2.,0.",
                "that of the parameter domain is used",
            ),
            // Not at the vertex.
            ("0.,1.9,0.,360.,1.9,0.", "it is laid onto it"),
        ] {
            let (scene, warnings) = read(&[
                part(116, 0, "0.,0.,0."),
                part(123, 0, "0.,0.,1."),
                part(123, 0, "1.,0.,0."),
                part(192, 1, "1,3,1.,5"),
                part(100, 0, "0.,0.,0.,1.,0.,1.,0."),
                part(110, 0, "1.,0.,0.,1.,0.,2."),
                part(
                    126,
                    0,
                    &format!("8,1,0,1,1,0,{knots}{places},0.,8.,0.,0.,1."),
                ),
                part(502, 1, "2,1.,0.,0.,1.,0.,2."),
                part(504, 1, "3,9,15,1,15,1,11,15,1,15,2,13,15,2,15,2"),
                part(110, 0, flat),
                part(508, 1, "4,0,17,1,1,0,0,17,2,1,0,0,17,3,0,1,0,19,0,17,2,0,0"),
                formed(510, 1, "7,1,1,21"),
            ]);
            assert!(warnings[0].contains(text), "{warnings:?}");
            let is_mended = text.contains("domain");
            let patch = &scene.patches()[0];
            for k in 1..12 {
                let angle = f64::from(k) * 0.5;
                assert_eq!(
                    shows(patch, DVec2::from_angle(angle).extend(1.99)),
                    is_mended,
                    "{angle}"
                );
            }
        }
    }
}
