//! Edges of solids whose curves of space are off the surfaces that they bound.
//!
//! Some programs write other curves than the ellipses in which planes cut cylinders and cones, beside the right
//! curves of the parameter domain.

use std::cell::Cell;
use std::collections::{HashMap, HashSet};
use std::ops::Range;

use glam::{DAffine3, DVec3};
use kernel::{Curve, modelling};

use super::boundary::{self, Boundary, Edge, Edges};
use super::curves::{OFF, Rail, Reader};
use super::directory::{File, WHOLE};
use super::entities::{self, Content};
use super::quadric::{Quadric, READINGS};
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

/// Looks for such edges, and puts others in the place of their curves; what is to be told of that.
pub(super) fn settle(file: &File<'_>) -> Vec<(usize, Problem)> {
    // Without lists of edges there are none.
    if file.entries.iter().all(|entry| entry.kind != 504) {
        return Vec::new();
    }
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
        edges: Edges::default(),
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
    let tell = |index: usize| (index, Problem::Invalid(OFF.to_owned()));
    told.into_iter().map(tell).collect()
}

struct Search<'a, 'b> {
    reader: Reader<'a, 'b>,
    edges: Edges,
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
                let edge = self.edges.find(file, stretch.space, stretch.edge)?;
                if self.seen.insert((edge.curve, surface)) {
                    self.hold(quadric, edge, flat)?;
                }
            }
        }
        Ok(())
    }

    /// Holds an edge against a surface.
    fn hold(&mut self, quadric: &Quadric, edge: Edge, flat: i64) -> Result<(), Problem> {
        let file = self.reader.file;
        let index = file.follow(edge.curve, "an edge")?;
        if file.entries[index].kind != 126 || self.mended.contains_key(&index) || self.left == 0 {
            return Ok(());
        }
        let rails = self.reader.rails(index)?;
        let [Rail { curve: space, .. }] = rails.as_slice() else {
            return Ok(());
        };
        let size = space.hull_bounds().diagonal();
        if places(space).all(|point| quadric.off(point) <= ASTRAY * size) {
            return Ok(());
        }
        let flats = self.reader.flat(flat)?;
        let [flat] = flats.as_slice() else {
            return Ok(());
        };
        let mut vertices = [DVec3::ZERO; 2];
        for (vertex, (list, number)) in vertices.iter_mut().zip(edge.vertices) {
            *vertex = vertex_of(file, list, number)?;
        }
        let [start, end] = [flat.domain().start, flat.domain().end];
        for reading in READINGS {
            let at = |t: f64| quadric.point(flat.evaluate(t), reading);
            let apart =
                |a: f64, b: f64| at(a).distance(vertices[0]).max(at(b).distance(vertices[1]));
            let is_near = |t: f64| {
                let point = at(t);
                places(space).any(|other| other.distance(point) <= NEAR * size)
            };
            let meets = apart(start, end).min(apart(end, start)) <= MEETS * size;
            if meets && parts(flat.domain()).all(is_near) {
                let fit =
                    modelling::fit(at, &flat.knots().breaks(), ACCURACY * size, DVec3::distance);
                let mut mended = fit.map_err(Problem::Geometry)?.curve;
                if runs_against(&mended, space) {
                    mended = mended.reversed();
                }
                self.left = self.left.saturating_sub(mended.points().count());
                self.mended.insert(index, mended);
                break;
            }
        }
        Ok(())
    }
}

/// Points of a curve.
fn places(curve: &Curve<DVec3>) -> impl Iterator<Item = DVec3> {
    parts(curve.domain()).map(|t| curve.evaluate(t))
}

/// The parameters at which curves are compared.
fn parts(domain: Range<f64>) -> impl Iterator<Item = f64> {
    let share = |k: u8| f64::from(k) / f64::from(PLACES);
    (0..=PLACES).map(move |k| domain.start + (domain.end - domain.start) * share(k))
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
