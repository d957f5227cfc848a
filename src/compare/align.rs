//! Bringing a mesh to where the surfaces are: by what files say, or by a rigid fit.

use std::f64::consts::FRAC_PI_4;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use kernel::{Scene, UpAxis};
use rayon::prelude::*;

use super::exact::Exact;
use super::soup::Soup;

/// Points of the mesh that a fit looks at.
const POINTS: usize = 2000;

/// Points with which turns are tried first.
const FIRST: usize = 200;

/// How many of the turns are tried to the end: the best ones after a few steps.
const TRIED: usize = 6;

/// Rounds of a fit.
const ROUNDS: usize = 60;

/// A fit has settled when it moves points by less than this share of the size.
const SETTLED: f64 = 1e-13;

/// Points farther away than this many times the median do not pull.
const OUTLIER: f64 = 5.0;

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

/// Moves and turns a mesh until its points are nearest to the surfaces on average: first as a
/// whole, onto the centre and by eighths of turns, then by steps towards the planes that touch the
/// surfaces \[Chen 92\].
pub(crate) fn fit(exact: &Exact<'_>, soup: &Soup) -> Fit {
    let stride = soup.points.len().div_ceil(POINTS).max(1);
    let points: Vec<DVec3> = soup.points.iter().step_by(stride).copied().collect();
    let few: Vec<DVec3> = points
        .iter()
        .step_by(points.len().div_ceil(FIRST).max(1))
        .copied()
        .collect();
    let before = residual(exact, &points, &DAffine3::IDENTITY);
    let (from, to) = (soup.bounds().center(), exact.bounds().center());
    let centred = |turn: DMat3| DAffine3 {
        matrix3: turn,
        translation: to - turn * from,
    };
    let mut starts = vec![DAffine3::IDENTITY];
    let between =
        [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| DMat3::from_axis_angle(axis, FRAC_PI_4));
    for turn in quarter_turns() {
        let turns = between.map(|between| between * turn);
        starts.extend([turn].into_iter().chain(turns).map(centred));
    }
    let few_steps = |start: DAffine3| {
        let map = step(exact, &few, &step(exact, &few, &start).0).0;
        (residual(exact, &few, &map), map)
    };
    let mut tried: Vec<_> = starts.into_par_iter().map(few_steps).collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = exact.bounds().diagonal();
    let settled = |(_, mut map): (f64, DAffine3)| {
        for _ in 0..ROUNDS {
            let (next, moved) = step(exact, &points, &map);
            map = next;
            if moved <= SETTLED * size {
                break;
            }
        }
        (residual(exact, &points, &map), map)
    };
    // What is best after a few steps need not be in the end.
    let best = tried.into_iter().take(TRIED).map(settled);
    let best = best.chain([(before, DAffine3::IDENTITY)]);
    let best = best.min_by(|a, b| a.0.total_cmp(&b.0));
    let (residual, scene_from_mesh) = best.expect("there is one");
    Fit {
        scene_from_mesh,
        before,
        residual,
    }
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

/// Root mean square distance of points from the surfaces.
fn residual(exact: &Exact<'_>, points: &[DVec3], map: &DAffine3) -> f64 {
    let square = |p: &DVec3| {
        let foot = exact.nearest(map.transform_point3(*p));
        foot.map_or(0.0, |foot| foot.distance * foot.distance)
    };
    let squares: Vec<f64> = points.par_iter().map(square).collect();
    (squares.iter().sum::<f64>() / points.len().max(1) as f64).sqrt()
}

/// One step of a fit, and how far it moves points at most, about.
fn step(exact: &Exact<'_>, points: &[DVec3], map: &DAffine3) -> (DAffine3, f64) {
    let pairs: Vec<(DVec3, DVec3, DVec3)> = points
        .par_iter()
        .filter_map(|p| {
            let p = map.transform_point3(*p);
            let foot = exact.nearest(p)?;
            let surface = &exact.faces[foot.face as usize].patch.surface;
            // Beside a border the way to it says more than the plane.
            let way = (p - foot.point).try_normalize();
            let normal = surface.normal(foot.uv).or(way)?;
            let normal = way.filter(|w| w.dot(normal).abs() < 0.9).unwrap_or(normal);
            Some((p, foot.point, normal))
        })
        .collect();
    let mut distances: Vec<f64> = pairs.iter().map(|(p, q, _)| p.distance(*q)).collect();
    distances.sort_by(f64::total_cmp);
    let far = match distances.get(distances.len() / 2) {
        Some(median) => OUTLIER * median,
        None => return (*map, 0.0),
    };
    let count = pairs.len() as f64;
    let center = pairs.iter().map(|(p, ..)| *p).sum::<DVec3>() / count;
    let reach = pairs
        .iter()
        .map(|(p, ..)| p.distance(center))
        .fold(0.0, f64::max);
    // The turn (times the reach, so that all unknowns are lengths) and the way that bring the
    // points into the planes, by least squares.
    let mut rows = [[0.0; 7]; 6];
    for (p, q, n) in pairs.iter().filter(|(p, q, _)| p.distance(*q) <= far) {
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
