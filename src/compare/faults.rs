//! What is wrong with a mesh as a whole, in words.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use kernel::Aabb;
use rayon::prelude::*;

use super::exact::{Exact, Foot};
use super::sampling::Sample;
use super::soup::Soup;

/// Something that is wrong with a mesh as a whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// What it is.
    pub kind: FaultKind,
    /// A sentence for people.
    pub text: String,
    /// Where it is, in the coordinates of the exact scene.
    pub place: Option<DVec3>,
}

/// The kinds of faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// There is no triangle.
    Empty,
    /// The mesh is larger or smaller by a factor between units of length.
    Units,
    /// The mesh fits when it is turned by a quarter: another axis is upwards.
    Turned,
    /// The mesh fits when it is mirrored.
    Mirrored,
    /// The mesh fits when it is moved.
    Moved,
    /// The mesh is elsewhere or something else.
    Elsewhere,
    /// The triangles of closed bodies look inwards.
    InsideOut,
    /// A face has no triangles, or too few.
    Missing,
    /// Triangles belong to no surface.
    Extra,
}

impl FaultKind {
    /// One or two words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Empty => "empty mesh",
            Self::Units => "wrong units",
            Self::Turned => "wrong upward axis",
            Self::Mirrored => "mirrored",
            Self::Moved => "moved",
            Self::Elsewhere => "elsewhere",
            Self::InsideOut => "inside out",
            Self::Missing => "missing patch",
            Self::Extra => "extra geometry",
        }
    }
}

/// Points that are tried in another pose.
const TRIED: usize = 400;

/// A point fits if it is no farther away than this share of the size, and a mesh if this
/// share of its points does.
const NEAR: f64 = 0.01;
const MOST: f64 = 0.9;

/// A mesh that fits in no pose is elsewhere if more than this share of its area is not near.
const ELSEWHERE: f64 = 0.5;

/// Units that are mixed up: how many of the first make one of the second.
const UNITS: &[(f64, &str, &str)] = &[
    (1000.0, "millimetres", "metres"),
    (100.0, "centimetres", "metres"),
    (10.0, "millimetres", "centimetres"),
    (25.4, "millimetres", "inches"),
    (2.54, "centimetres", "inches"),
    (12.0, "inches", "feet"),
    (304.8, "millimetres", "feet"),
    (39.370_078_74, "inches", "metres"),
];

/// Sizes whose ratio is a factor up to this share are that factor apart.
const SAME_SIZE: f64 = 0.03;

/// Distances beyond this many times the median are not those of a coarse mesh.
const BEYOND: f64 = 8.0;

/// A face misses triangles if this share of its area is bare, and all of them if the other is.
const BARE: [f64; 2] = [0.15, 0.6];

/// A face is bare where the mesh is farther away than this share of its width.
const WIDTH: f64 = 0.1;

/// Triangles belong to no surface if all corners are farther away than this share of the size.
const FAR: f64 = 5e-3;

/// Faces that are told one by one.
const TOLD: usize = 12;

/// How far a mesh strays from the surfaces of which it is, where its triangles come as far as
/// `reach`: what is much farther is not of these surfaces.
pub(crate) fn strays(exact: &Exact<'_>, reach: f64) -> f64 {
    reach.min(FAR * exact.bounds().diagonal())
}

/// Looks for faults of a mesh that stands where the surfaces do, or elsewhere by `pose`; no face
/// that has all its triangles is farther from them than `coarse`.
pub(crate) fn faults(
    exact: &Exact<'_>,
    soup: &Soup,
    (samples, feet): (&[Sample], &[Foot]),
    coarse: f64,
    pose: Option<Fault>,
) -> Vec<Fault> {
    let mut found = Vec::new();
    let kind = pose.as_ref().map(|fault| fault.kind);
    found.extend(pose);
    if kind.is_none() {
        found.extend(missing(exact, samples, coarse));
        found.extend(extra(exact, soup, feet));
    }
    // What is elsewhere has other triangles beside it than its own.
    if matches!(kind, None | Some(FaultKind::Mirrored)) {
        found.extend(inside_out(samples, coarse));
    }
    found
}

/// Whether there is a mesh and as a whole it is where the surfaces are; if not, in what other
/// pose it would be.
pub(crate) fn pose(exact: &Exact<'_>, soup: &Soup) -> Option<Fault> {
    let fault = |kind, text: String| {
        let place = None;
        Some(Fault { kind, text, place })
    };
    if soup.triangles.is_empty() {
        let text = "the mesh is empty: it has no triangle to measure".to_owned();
        return fault(FaultKind::Empty, text);
    }
    let (own, other) = (exact.bounds(), soup.bounds());
    let size = own.diagonal();
    let stride = soup.points.len().div_ceil(TRIED).max(1);
    let points: Vec<DVec3> = soup.points.iter().step_by(stride).copied().collect();
    let near = |points: &[DVec3], map: DAffine3| {
        let is_near = |p: &&DVec3| {
            let foot = exact.nearest(map.transform_point3(**p));
            foot.is_some_and(|foot| foot.distance <= NEAR * size)
        };
        points.par_iter().filter(is_near).count() as f64 / points.len() as f64
    };
    // A part of the body fits into it, too; the whole reaches as far.
    let reaches = |map: DAffine3| {
        let box_of = Aabb::around(points.iter().map(|p| map.transform_point3(*p)));
        box_of.diagonal() > 0.5 * size
    };
    let fits = |map: DAffine3| reaches(map) && near(&points, map) >= MOST;
    // It may be a part, or have more beside it.
    let is_part = near(&points, DAffine3::IDENTITY) >= MOST;
    if is_part && reaches(DAffine3::IDENTITY) {
        return None;
    }
    let stands =
        is_part || near(&soup.corners_by_area(TRIED), DAffine3::IDENTITY) >= 1.0 - ELSEWHERE;
    let ratio = other.diagonal() / size;
    let units = UNITS.iter().flat_map(|&(factor, small, large)| {
        [
            (factor, "large", small, large),
            (1.0 / factor, "small", large, small),
        ]
    });
    for (factor, word, of, taken) in units {
        if (ratio / factor - 1.0).abs() > SAME_SIZE {
            continue;
        }
        let about_origin = DAffine3::from_scale(DVec3::splat(1.0 / factor));
        let about_center = DAffine3::from_translation(own.center())
            * about_origin
            * DAffine3::from_translation(-other.center());
        let rest = if fits(about_origin) {
            "scaled it fits"
        } else if fits(about_center) {
            "scaled and moved it fits"
        } else if stands {
            continue;
        } else {
            "scaled it does not fit either"
        };
        let times = factor.max(1.0 / factor);
        let text = format!(
            "the mesh is {times} times too {word}, as if {of} were taken for {taken}; {rest}"
        );
        return fault(FaultKind::Units, text);
    }
    for (kind, text, map) in poses(own.center(), other.center()) {
        if fits(map) {
            return fault(kind, text);
        }
    }
    if stands {
        return None;
    }
    let text = format!(
        "most of the mesh is farther than {} % of the size from every surface",
        NEAR * 100.0
    );
    fault(FaultKind::Elsewhere, text)
}

/// Other poses in which the mesh may fit, those about the origin first, and what is wrong if
/// it does; `own` and `other` are the middles of the boxes around surfaces and mesh.
fn poses(own: DVec3, other: DVec3) -> Vec<(FaultKind, String, DAffine3)> {
    let axes = [(DVec3::X, "x"), (DVec3::Y, "y"), (DVec3::Z, "z")];
    let turns = || {
        let quarters = axes.iter().flat_map(|(axis, name)| {
            [(1.0, "+90"), (-1.0, "-90")].map(|(sign, word)| {
                let turn = DQuat::from_axis_angle(*axis, sign * std::f64::consts::FRAC_PI_2);
                let text = format!(
                    "the mesh fits when it is turned by {word} degrees about {name}: another \
                     axis is upwards"
                );
                (FaultKind::Turned, text, DMat3::from_quat(turn))
            })
        });
        quarters.collect::<Vec<_>>()
    };
    let mirrors = || {
        axes.map(|(axis, name)| {
            let text = format!("the mesh is mirrored: it fits when {name} changes its sign");
            (
                FaultKind::Mirrored,
                text,
                DMat3::from_diagonal(DVec3::ONE - 2.0 * axis),
            )
        })
    };
    let about_origin = turns().into_iter().chain(mirrors());
    let mut poses: Vec<_> = about_origin
        .map(|(kind, text, turn)| (kind, text, DAffine3::from_mat3(turn)))
        .collect();
    let way = own - other;
    let text = format!(
        "the mesh fits when it is moved by {:.6}, {:.6}, {:.6}",
        way.x, way.y, way.z
    );
    poses.push((FaultKind::Moved, text, DAffine3::from_translation(way)));
    let about_center = turns().into_iter().chain(mirrors());
    poses.extend(about_center.map(|(kind, text, turn)| {
        let translation = own - turn * other;
        let matrix3 = turn;
        (
            kind,
            format!("{text}, and is moved"),
            DAffine3 {
                matrix3,
                translation,
            },
        )
    }));
    poses
}

/// Whether closed bodies are turned inside out, where they have triangles.
fn inside_out(samples: &[Sample], coarse: f64) -> Option<Fault> {
    let has_triangles = |s: &&Sample| s.outwards.is_some() && s.distance <= coarse;
    let known = samples.iter().filter(has_triangles);
    let (mut inwards, mut all) = (0.0, 0.0);
    for sample in known {
        all += sample.area;
        // Beside a sharp edge the nearest triangle says nothing.
        if sample.outwards == Some(false) && sample.flat < std::f64::consts::FRAC_PI_4 {
            inwards += sample.area;
        }
    }
    (all > 0.0 && inwards > 0.05 * all).then(|| Fault {
        kind: FaultKind::InsideOut,
        text: format!(
            "the triangles over {:.0} % of the closed bodies look inwards, as they do when a \
             mesh is mirrored or its winding is reversed",
            100.0 * inwards / all
        ),
        place: None,
    })
}

/// The value below which half of all are.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let half = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}

/// What distance a sample may have where the mesh is only coarse: a few times that of the best tenth of
/// the faces, each by its own median, so that faces without triangles do not stand for the rest.
pub(crate) fn typical(exact: &Exact<'_>, samples: &[Sample]) -> f64 {
    let mut faces = vec![Vec::new(); exact.faces.len()];
    for sample in samples {
        faces[sample.face as usize].push(sample.distance);
    }
    let medians = faces.into_iter().filter(|face| !face.is_empty());
    let mut medians: Vec<f64> = medians.map(|face| median(face.into_iter())).collect();
    medians.sort_by(f64::total_cmp);
    BEYOND * medians.get(medians.len() / 10).copied().unwrap_or_default()
}

/// Faces without triangles: they are farther from the mesh than `coarse`.
fn missing(exact: &Exact<'_>, samples: &[Sample], coarse: f64) -> Vec<Fault> {
    let mut boxes = vec![Aabb::EMPTY; exact.faces.len()];
    for vertex in &exact.vertices {
        let own = &mut boxes[vertex.face as usize];
        *own = own.including(vertex.point);
    }
    let mut areas = vec![0.0; exact.faces.len()];
    let mut bare = vec![0.0; exact.faces.len()];
    let mut worst: Vec<Option<&Sample>> = vec![None; exact.faces.len()];
    samples
        .iter()
        .for_each(|s| areas[s.face as usize] += s.area);
    for sample in samples {
        let face = sample.face as usize;
        let width = areas[face] / boxes[face].diagonal();
        if sample.distance > coarse.max(WIDTH * width) {
            bare[face] += sample.area;
            if worst[face].is_none_or(|w| w.distance < sample.distance) {
                worst[face] = Some(sample);
            }
        }
    }
    let mut found = Vec::new();
    let mut more = 0;
    for (face, own) in exact.faces.iter().enumerate() {
        let share = bare[face] / areas[face];
        let Some(place) = worst[face].filter(|_| share > BARE[0]) else {
            continue;
        };
        if found.len() == TOLD {
            more += 1;
            continue;
        }
        let what = if share > BARE[1] {
            "has no triangles"
        } else {
            "has too few triangles"
        };
        let text = format!(
            "patch {face} (\"{}\", {}) {what}: at least {:.0} % of its area is bare, up to {:.6} \
             from the mesh",
            own.patch.name,
            own.patch.source,
            100.0 * share,
            place.distance
        );
        found.push(Fault {
            kind: FaultKind::Missing,
            text,
            place: Some(place.point),
        });
    }
    if more > 0 {
        found.push(Fault {
            kind: FaultKind::Missing,
            text: format!("{more} more patches miss triangles"),
            place: None,
        });
    }
    found
}

/// The distance that the corners of half of the area of a mesh do not exceed.
fn typical_of(soup: &Soup, feet: &[Foot]) -> f64 {
    let each = soup.triangles.iter().enumerate().map(|(number, corners)| {
        let distances = corners.map(|k| feet[k as usize].distance);
        let most = distances[0].max(distances[1]).max(distances[2]);
        (most, soup.area(number))
    });
    let mut each: Vec<(f64, f64)> = each.collect();
    each.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = 0.5 * each.iter().map(|(_, area)| area).sum::<f64>();
    let half = each.iter().find(|(_, area)| {
        left -= area;
        left <= 0.0
    });
    half.map_or(0.0, |(most, _)| *most)
}

/// Triangles that belong to no surface.
fn extra(exact: &Exact<'_>, soup: &Soup, feet: &[Foot]) -> Vec<Fault> {
    if feet.len() != soup.points.len() {
        return Vec::new();
    }
    let far = (BEYOND * typical_of(soup, feet)).max(FAR * exact.bounds().diagonal());
    let (parts, count) = soup.parts();
    // For every part: triangles, their area, the largest and the least distance of a corner.
    let mut sums = vec![(0_usize, 0.0_f64, 0.0_f64, f64::INFINITY, DVec3::ZERO); count];
    let mut strays = (0_usize, 0.0, 0.0_f64, DVec3::ZERO);
    for (number, triangle) in soup.triangles.iter().enumerate() {
        let distances = triangle.map(|k| feet[k as usize].distance);
        let least = distances[0].min(distances[1]).min(distances[2]);
        let (most, at) = triangle.iter().fold((0.0, DVec3::ZERO), |(most, at), &k| {
            let own = feet[k as usize].distance;
            if own > most {
                (own, soup.points[k as usize])
            } else {
                (most, at)
            }
        });
        let part = &mut sums[parts[number]];
        part.0 += 1;
        part.1 += soup.area(number);
        part.3 = part.3.min(least);
        if most > part.2 {
            (part.2, part.4) = (most, at);
        }
        if least > far {
            strays.0 += 1;
            strays.1 += soup.area(number);
            if most > strays.2 {
                (strays.2, strays.3) = (most, at);
            }
        }
    }
    let mut found = Vec::new();
    for (triangles, area, most, least, at) in sums {
        if least > far && found.len() < TOLD {
            strays.0 -= triangles;
            found.push(Fault {
                kind: FaultKind::Extra,
                text: format!(
                    "a part of {triangles} triangles with an area of {area:.6} stands apart from \
                     every surface, {least:.6} to {most:.6} away"
                ),
                place: Some(at),
            });
        }
    }
    if strays.0 > 0 {
        found.push(Fault {
            kind: FaultKind::Extra,
            text: format!(
                "{} triangles belong to no surface: they are up to {:.6} away",
                strays.0, strays.2
            ),
            place: Some(strays.3),
        });
    }
    found
}
