//! Bringing a mesh to where the surfaces are: by what files say, or by a rigid fit.

use std::f64::consts::FRAC_PI_2;
use std::iter;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use kernel::{Scene, UpAxis};
use rayon::prelude::*;

use super::exact::Exact;
use super::sampling::shares;
use super::soup::Soup;
use super::triangles::TriangleTree;

/// Points of the mesh that a fit looks at.
const POINTS: usize = 2000;

/// Points with which starts are compared.
const FIRST: usize = 150;

/// Steps after which they are.
const FIRST_STEPS: usize = 4;

/// Between quarter turns of the axes there are this many parts.
const PARTS: u32 = 6;

/// How many of the starts are tried to the end: the best ones after the first steps.
const TRIED: usize = 6;

/// None of them is so many times worse than the best.
const WORSE: f64 = 4.0;

/// Rounds of a fit.
const ROUNDS: usize = 60;

/// A fit has settled when it moves points by less than this share of the size.
const SETTLED: f64 = 1e-13;

/// The same where triangles stand for the surfaces.
const ROUGHLY: f64 = 1e-6;

/// Points farther away than this many times the median are outliers.
const OUTLIER: f64 = 5.0;

/// Rounds in which axes become principal.
const SWEEPS: usize = 12;

/// What a mesh file says about its coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    /// Length of its unit in metres, if it tells.
    pub metres: Option<f64>,
    /// Its upward axis, if it tells.
    pub up: Option<UpAxis>,
}

/// The map from a mesh to the exact scene that unit and upward axis of both ask for; what one
/// of them does not tell is taken to be the same.
pub fn from_metadata(scene: &Scene, mesh: &Frame) -> DAffine3 {
    let own = scene.unit.as_ref().map(|unit| unit.metres);
    // A glTF file is in metres even if what it was made from had no unit.
    let scale = match (mesh.metres, own) {
        (Some(mesh), Some(own)) => mesh / own,
        _ => 1.0,
    };
    let turn = match (mesh.up.unwrap_or(scene.up), scene.up) {
        (UpAxis::Y, UpAxis::Z) => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        (UpAxis::Z, UpAxis::Y) => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        _ => DMat3::IDENTITY,
    };
    DAffine3::from_mat3(turn * scale)
}

/// A rigid fit of a mesh onto the surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// What was done to the mesh, after unit and upward axis.
    pub scene_from_mesh: DAffine3,
    /// Root mean square distance of its points from the surfaces before.
    pub before: f64,
    /// The same afterwards: the residual.
    pub residual: f64,
}

/// Moves and turns a mesh until its points are nearest to the surfaces on average: centre onto
/// centre and principal axes onto principal axes, with turns between, then by steps towards the
/// planes that touch the surfaces \[Chen 92\]. At first these are triangles, and all of the mesh
/// counts; in the end its corners do, which are where their maker put them.
pub(crate) fn fit(exact: &Exact<'_>, soup: &Soup) -> Fit {
    let numbers = 0..exact.triangles.len();
    let triangles = TriangleTree::new(numbers.map(|k| exact.corners(k)).collect());
    let rough = |p: DVec3| {
        let found = triangles.nearest(p)?;
        let [a, b, c] = triangles.corners()[found.triangle as usize];
        let normal = (b - a).cross(c - a).try_normalize();
        Some((found.closest.point, normal))
    };
    let close = |p: DVec3| {
        let foot = exact.nearest(p)?;
        let surface = &exact.faces[foot.face as usize].patch.surface;
        Some((foot.point, surface.normal(foot.uv)))
    };
    let points = spread(soup.tree.corners(), POINTS);
    let few = spread(soup.tree.corners(), FIRST);
    let first_steps = |start: DAffine3| {
        let steps = 0..FIRST_STEPS;
        let map = steps.fold(start, |map, _| step(&rough, &few, &map, Pull::All).0);
        (distances(&rough, &few, &map).mean, map)
    };
    let starts = starts(&points, &spread(triangles.corners(), POINTS));
    let mut tried: Vec<_> = starts.into_par_iter().map(first_steps).collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = exact.bounds().diagonal();
    // What is best after a few steps need not be in the end.
    let worst = WORSE * tried[0].0;
    let promising = tried
        .into_iter()
        .take_while(|(mean, _)| mean.total_cmp(&worst).is_le());
    let poses = promising
        .take(TRIED)
        .map(|(_, start)| settled(&rough, &points, start, ROUGHLY * size));
    let best = poses.min_by(|a, b| a.0.mean.total_cmp(&b.0.mean));
    let (_, best) = best.expect("there is a start");
    let stride = soup.points.len().div_ceil(POINTS).max(1);
    let corners: Vec<DVec3> = soup.points.iter().step_by(stride).copied().collect();
    let unmoved = DAffine3::IDENTITY;
    let before = distances(&close, &corners, &unmoved);
    let (after, fitted) = settled(&close, &corners, best, SETTLED * size);
    let (after, scene_from_mesh) = if after.mean < before.mean {
        (after, fitted)
    } else {
        (before, unmoved)
    };
    Fit {
        scene_from_mesh,
        before: before.rms,
        residual: after.rms,
    }
}

/// Steps until points move by less than `little`. All of them pull first: where most have found
/// their places, the others would stay away. What has no place is to pull no more, if the
/// others come nearer then. The result says how far they are away in the end.
fn settled(
    nearest: &impl Nearest,
    points: &[DVec3],
    start: DAffine3,
    little: f64,
) -> (Distances, DAffine3) {
    let walked = |mut map: DAffine3, pull: Pull| {
        for _ in 0..ROUNDS {
            let (next, moved) = step(nearest, points, &map, pull);
            map = next;
            if moved <= little {
                break;
            }
        }
        map
    };
    let measured = |map: DAffine3| (distances(nearest, points, &map), map);
    let all = measured(walked(start, Pull::All));
    let most = measured(walked(all.1, Pull::Near));
    if most.0.mean < all.0.mean { most } else { all }
}

/// Points that stand for equal areas of triangles.
fn spread(triangles: &[[DVec3; 3]], count: usize) -> Vec<DVec3> {
    let area = |[a, b, c]: &[DVec3; 3]| 0.5 * (*b - *a).cross(*c - *a).length();
    let each = triangles.iter().map(area).sum::<f64>() / count as f64;
    let mut points = Vec::new();
    let mut covered = 0.0;
    for triangle in triangles {
        covered += area(triangle);
        while points.len() < count && (points.len() as f64 + 0.5) * each <= covered {
            let number = u32::try_from(points.len()).unwrap_or(u32::MAX);
            let shares = shares(number, u32::MAX);
            points.push((0..3).map(|k| triangle[k] * shares[k]).sum());
        }
    }
    points
}

/// Where to begin: as things stand, and with centres and axes in one, turned by parts of a
/// quarter about each.
fn starts(mesh: &[DVec3], surfaces: &[DVec3]) -> Vec<DAffine3> {
    let [(from, own), (to, axes)] = [mesh, surfaces].map(principal_axes);
    let mut starts = vec![DAffine3::IDENTITY];
    let angles = (1..PARTS).map(|part| FRAC_PI_2 * f64::from(part) / f64::from(PARTS));
    let between = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| {
        angles
            .clone()
            .map(move |angle| DMat3::from_axis_angle(axis, angle))
    });
    let between: Vec<DMat3> = iter::once(DMat3::IDENTITY).chain(between).collect();
    for turn in quarter_turns() {
        starts.extend(between.iter().map(|between| {
            let turn = axes * *between * turn * own.transpose();
            DAffine3 {
                matrix3: turn,
                translation: to - turn * from,
            }
        }));
    }
    starts
}

/// The centre of points, and the axes about which they do not deviate, by Jacobi's rotations.
fn principal_axes(points: &[DVec3]) -> (DVec3, DMat3) {
    let center = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let mut spread = DMat3::ZERO;
    for p in points.iter().map(|p| *p - center) {
        spread += DMat3::from_cols(p * p.x, p * p.y, p * p.z);
    }
    let mut axes = DMat3::IDENTITY;
    for (i, j) in [(0, 1), (0, 2), (1, 2)].repeat(SWEEPS) {
        let angle = 0.5 * (2.0 * spread.col(j)[i]).atan2(spread.col(i)[i] - spread.col(j)[j]);
        let (sin, cos) = angle.sin_cos();
        let mut turn = DMat3::IDENTITY;
        (turn.col_mut(i)[i], turn.col_mut(i)[j]) = (cos, sin);
        (turn.col_mut(j)[i], turn.col_mut(j)[j]) = (-sin, cos);
        spread = turn.transpose() * spread * turn;
        axes *= turn;
    }
    (center, axes)
}

/// The turns that take axes to axes.
fn quarter_turns() -> Vec<DMat3> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .flat_map(|a| [a, -a]);
    let axes: Vec<DVec3> = axes.collect();
    let pairs = axes.iter().flat_map(|&x| axes.iter().map(move |&y| (x, y)));
    let upright = pairs.filter(|(x, y)| x.dot(*y).abs() < 0.5);
    upright
        .map(|(x, y)| DMat3::from_cols(x, y, x.cross(y)))
        .collect()
}

/// Distances of points.
#[derive(Clone, Copy, Debug)]
struct Distances {
    mean: f64,
    /// The root of the mean square.
    rms: f64,
}

/// How far points are away.
fn distances(nearest: &impl Nearest, points: &[DVec3], map: &DAffine3) -> Distances {
    let distance = |p: &DVec3| {
        let p = map.transform_point3(*p);
        nearest(p).map_or(0.0, |(foot, _)| p.distance(foot))
    };
    let distances: Vec<f64> = points.par_iter().map(distance).collect();
    let count = points.len().max(1) as f64;
    Distances {
        mean: distances.iter().sum::<f64>() / count,
        rms: (distances.iter().map(|d| d * d).sum::<f64>() / count).sqrt(),
    }
}

/// Finds the nearest point, and the normal there if there is one.
trait Nearest: Fn(DVec3) -> Option<(DVec3, Option<DVec3>)> + Sync {}

impl<F: Fn(DVec3) -> Option<(DVec3, Option<DVec3>)> + Sync> Nearest for F {}

/// Which points move a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pull {
    All,
    /// All but outliers.
    Near,
}

/// One step of a fit, and how far it moves points at most, about.
fn step(nearest: &impl Nearest, points: &[DVec3], map: &DAffine3, pull: Pull) -> (DAffine3, f64) {
    let mut pairs: Vec<(DVec3, DVec3, DVec3)> = points
        .par_iter()
        .filter_map(|p| {
            let p = map.transform_point3(*p);
            let (foot, normal) = nearest(p)?;
            // Beside a border the way to it says more than the plane.
            let way = (p - foot).try_normalize();
            let normal = normal.or(way)?;
            let normal = way.filter(|w| w.dot(normal).abs() < 0.9).unwrap_or(normal);
            Some((p, foot, normal))
        })
        .collect();
    if pull == Pull::Near {
        let mut distances: Vec<f64> = pairs.iter().map(|(p, q, _)| p.distance(*q)).collect();
        distances.sort_by(f64::total_cmp);
        let median = distances.get(distances.len() / 2).copied();
        pairs.retain(|(p, q, _)| median.is_some_and(|median| p.distance(*q) <= OUTLIER * median));
    }
    if pairs.is_empty() {
        return (*map, 0.0);
    }
    let count = pairs.len() as f64;
    let center = pairs.iter().map(|(p, ..)| *p).sum::<DVec3>() / count;
    let reach = pairs
        .iter()
        .map(|(p, ..)| p.distance(center))
        .fold(0.0, f64::max);
    // The turn (times the reach, so that all unknowns are lengths) and the way that bring the
    // points into the planes, by least squares.
    let mut rows = [[0.0; 7]; 6];
    for (p, q, n) in &pairs {
        let turn = (*p - center).cross(*n) / reach;
        let row = [turn.x, turn.y, turn.z, n.x, n.y, n.z, (*q - *p).dot(*n)];
        for i in 0..6 {
            for j in 0..7 {
                rows[i][j] += row[i] * row[j];
            }
        }
    }
    // What no plane determines stays as it is.
    let raised = 1e-9 * (0..6).map(|k| rows[k][k]).sum::<f64>();
    (0..6).for_each(|k| rows[k][k] += raised);
    let Some(x) = solve(rows) else {
        return (*map, 0.0);
    };
    let turn = DVec3::new(x[0], x[1], x[2]) / reach;
    let way = DVec3::new(x[3], x[4], x[5]);
    let about = DAffine3::from_rotation_translation(DQuat::from_scaled_axis(turn), center + way);
    let next = about * DAffine3::from_translation(-center) * *map;
    (next, turn.length() * reach + way.length())
}

/// Gauss elimination with row exchange; `None` if the matrix is singular.
fn solve(mut rows: [[f64; 7]; 6]) -> Option<[f64; 6]> {
    for k in 0..6 {
        let pivot = (k..6).max_by(|&i, &j| rows[i][k].abs().total_cmp(&rows[j][k].abs()))?;
        rows.swap(k, pivot);
        if !rows[k][k].is_normal() {
            return None;
        }
        for i in 0..6 {
            if i != k {
                let factor = rows[i][k] / rows[k][k];
                let pivot = rows[k];
                for (entry, above) in rows[i].iter_mut().zip(&pivot).skip(k) {
                    *entry -= factor * above;
                }
            }
        }
    }
    Some(std::array::from_fn(|k| rows[k][6] / rows[k][k]))
}
