//! The lights of a picture, and where they shine.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

use glam::DVec3;
use kernel::{Camera, Light, LightKind, NodeId, Scene, Shape};

/// A light that is on.
#[derive(Debug)]
pub(crate) struct ActiveLight {
    /// Its direction is of length one, or zero if it has none.
    pub(crate) light: Light,
    /// Light from the camera itself throws no shadow that it could see.
    pub(crate) shadows: bool,
    /// The numbers of the shapes on which alone it shines.
    pub(crate) scope: Option<Vec<Range<u32>>>,
}

impl ActiveLight {
    /// Whether it shines on the shape of that number.
    pub(crate) fn shines_on(&self, shape: u32) -> bool {
        let holds = |scope: &Vec<Range<u32>>| scope.iter().any(|range| range.contains(&shape));
        self.scope.as_ref().is_none_or(holds)
    }
}

/// The scene's lights, or three good ones placed relative to the camera; and the headlight.
pub(crate) fn active(scene: &Scene, camera: &Camera) -> Vec<ActiveLight> {
    let (right, up, forward) = (camera.right(), camera.up(), camera.forward());
    let scopes = scopes(scene);
    let on = |mut light: Light, shadows| {
        if let LightKind::Directional { direction } = &mut light.kind {
            *direction = direction.normalize_or_zero();
        }
        ActiveLight {
            scope: scopes.get(light.scope.as_slice()).cloned(),
            light,
            shadows,
        }
    };
    let parallel = |direction: DVec3, brightness: f64, shadows| {
        let light = Light {
            kind: LightKind::Directional { direction },
            color: DVec3::splat(brightness),
            ambient: DVec3::ZERO,
            scope: Vec::new(),
        };
        on(light, shadows)
    };
    if scene.lights.is_empty() {
        return vec![
            parallel(right * 0.7 - up * 0.9 + forward * 0.8, 0.80, true),
            parallel(-right * 0.9 - up * 0.3 + forward * 0.6, 0.22, true),
            parallel(-right * 0.3 - up * 0.7 - forward * 0.8, 0.25, true),
            parallel(forward, 0.18, false),
        ];
    }
    let mut lights: Vec<_> = scene.lights.iter().map(|l| on(l.clone(), true)).collect();
    if scene.headlight {
        lights.push(parallel(forward, 1.0, false));
    }
    lights
}

/// The numbers of the shapes below each node, by its path, in which alone a light shines.
fn scopes(scene: &Scene) -> HashMap<&[NodeId], Vec<Range<u32>>> {
    let paths = scene.lights.iter().map(|light| light.scope.as_slice());
    let mut scopes: HashMap<_, Vec<Range<u32>>> = paths
        .filter(|path| !path.is_empty())
        .map(|path| (path, Vec::new()))
        .collect();
    if scopes.is_empty() {
        return scopes;
    }
    let depths: BTreeSet<usize> = scopes.keys().map(|path| path.len()).collect();
    let mut placements = scene.placements();
    // Meshes are numbered after patches.
    placements.sort_by_key(|at| matches!(at.shape, Shape::Mesh(_)));
    for (number, at) in (0..).zip(&placements) {
        for &depth in depths.range(..=at.path.len()) {
            let Some(list) = scopes.get_mut(&at.path[..depth]) else {
                continue;
            };
            match list.last_mut() {
                Some(last) if last.end == number => last.end += 1,
                _ => list.push(number..number + 1),
            }
        }
    }
    scopes
}

/// Direction to a light, distance, and the share of its colour that reaches `point`.
pub(crate) fn arrival(light: &Light, point: DVec3) -> Option<(DVec3, f64, f64)> {
    match light.kind {
        LightKind::Directional { direction } => {
            (direction != DVec3::ZERO).then_some((-direction, f64::INFINITY, 1.0))
        }
        LightKind::Point { position, falloff } => {
            let reach = position.distance(point);
            Some((
                (position - point).try_normalize()?,
                reach,
                falloff.at(reach),
            ))
        }
        LightKind::Spot {
            position,
            direction,
            inner,
            outer,
            falloff,
        } => {
            let reach = position.distance(point);
            let towards = (position - point).try_normalize()?;
            let angle = direction
                .try_normalize()?
                .dot(-towards)
                .clamp(-1.0, 1.0)
                .acos();
            let cone = if angle <= inner {
                1.0
            } else if angle >= outer {
                0.0
            } else {
                (outer - angle) / (outer - inner)
            };
            Some((towards, reach, cone * falloff.at(reach)))
        }
    }
}
