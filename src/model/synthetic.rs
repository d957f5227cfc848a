//! Bodies of known volume, as contours: what a scan of them would give.
//!
//! Each is known by the area of its sections `A(z)`, which has a closed form in z, and lies
//! between two planes of constant z.

use std::f64::consts::{PI, TAU};

use formats::{Layer, Place, PointBody};
use glam::{DVec2, DVec3};
use kernel::linear_from_srgb;

use crate::random::Random;

/// A body that is made up, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Synthetic {
    /// A ball of radius 100 without its poles.
    Sphere,
    /// A shell like the vault of a skull with an opening in front; its sections are sickles.
    Skull,
    /// A star-shaped zone inside of it.
    Pathology,
}

/// Radius of the ball.
const BALL: f64 = 100.0;

/// Half axes of the skull across, from front to back, and upwards.
const SKULL: [f64; 3] = [70.0, 90.0, 80.0];

/// Thickness of the skull as a share of its half axes.
const THICKNESS: f64 = 0.11;

/// Half the angle that the skull goes around.
const AROUND: f64 = 2.65;

/// Middle of the pathology, its radius across and half its height.
const PATHOLOGY: ([f64; 3], f64, f64) = ([18.0, 22.0, 22.0], 21.0, 26.0);

/// Share of its half height up to which a body with poles goes.
const POLES: f64 = 0.95;

/// Nodes of the integral over a section of the skull: more change nothing.
const NODES: u32 = 256;

/// Makes `layers` contours of `points` points each, and the volume of the body between the
/// first and the last one. Bumps depend on `seed`; the sphere has none.
///
/// The points lie on the body; the volume is exact to rounding.
pub fn synthetic(kind: Synthetic, seed: u64, layers: usize, points: usize) -> (PointBody, f64) {
    let shape = Shape::new(kind, seed);
    let [low, high] = shape.heights;
    let layer = |k: usize| {
        let share = k as f64 / (layers.max(2) - 1) as f64;
        let z = low + (high - low) * share;
        Layer {
            place: Place::item(0, format!("layer {}", k + 1)),
            points: (0..points)
                .map(|j| shape.point(TAU * j as f64 / points as f64, z))
                .collect(),
            lines: Vec::new(),
            is_closed: Some(true),
        }
    };
    let body = PointBody {
        name: shape.name.to_owned(),
        color: Some(linear_from_srgb(shape.color.into())),
        layers: (0..layers.max(2)).map(layer).collect(),
        ..PointBody::default()
    };
    (body, shape.volume())
}

/// A body: a plane curve that grows with height.
struct Shape {
    kind: Synthetic,
    name: &'static str,
    color: [f64; 3],
    /// Height, as z, of the first and the last layer.
    heights: [f64; 2],
    /// Sizes and phases of bumps, by their number around.
    bumps: Vec<(f64, DVec2)>,
}

impl Shape {
    fn new(kind: Synthetic, seed: u64) -> Self {
        let (_, _, half) = PATHOLOGY;
        let (name, color, heights, range, size) = match kind {
            Synthetic::Sphere => (
                "sphere",
                [0.5, 0.6, 0.7],
                [-BALL * POLES, BALL * POLES],
                0..0,
                0.0,
            ),
            Synthetic::Skull => ("skull", [0.89, 0.85, 0.74], [-24.0, 68.0], 2..5, 0.02),
            Synthetic::Pathology => (
                "pathology",
                [0.80, 0.16, 0.14],
                [-half * POLES, half * POLES],
                1..6,
                0.06,
            ),
        };
        let mut noise = Random(seed);
        let bump = |number: u32| {
            let (size, phase) = (size * (0.4 + 0.6 * noise.unit()), TAU * noise.unit());
            (f64::from(number), DVec2::from_angle(phase) * size)
        };
        Self {
            kind,
            name,
            color,
            heights,
            bumps: range.map(bump).collect(),
        }
    }

    /// The size of the section at a height, as a share of the largest.
    fn grown(&self, z: f64) -> f64 {
        let half = match self.kind {
            Synthetic::Sphere => BALL,
            Synthetic::Skull => SKULL[2],
            Synthetic::Pathology => PATHOLOGY.2,
        };
        (1.0 - (z / half).powi(2)).sqrt()
    }

    /// The distance of the outline, or of the middle of the shell, from the axis: 1 and bumps.
    fn radius(&self, angle: f64) -> f64 {
        let bump = |&(number, size): &(f64, DVec2)| size.dot(DVec2::from_angle(number * angle));
        1.0 + self.bumps.iter().map(bump).sum::<f64>()
    }

    /// The point at `s`, from 0 to 2 pi around the section at a height.
    fn point(&self, s: f64, z: f64) -> DVec3 {
        let size = self.grown(z);
        match self.kind {
            Synthetic::Sphere => (DVec2::from_angle(s) * (BALL * size)).extend(z),
            Synthetic::Skull => {
                // Around the middle of the shell on its inside, back on its outside.
                let angle = AROUND * s.cos();
                let distance = size * self.radius(angle) - 0.5 * THICKNESS * s.sin();
                let flat = DVec2::from_angle(angle + 0.5 * PI) * distance;
                DVec3::new(SKULL[0] * flat.x, SKULL[1] * flat.y, z)
            }
            Synthetic::Pathology => {
                let (middle, radius, _) = PATHOLOGY;
                let flat = DVec2::from_angle(s) * (radius * size * self.radius(s));
                flat.extend(z) + DVec3::from(middle)
            }
        }
    }

    /// The volume between the first and the last layer.
    fn volume(&self) -> f64 {
        let [low, high] = self.heights;
        // The integral of the square of the size of sections, or for the shell of the size.
        let ball = |z: f64, half: f64| z - z.powi(3) / (3.0 * half * half);
        let arc = |z: f64, half: f64| {
            0.5 * (z * (1.0 - (z / half).powi(2)).sqrt() + half * (z / half).asin())
        };
        match self.kind {
            Synthetic::Sphere => PI * BALL * BALL * (ball(high, BALL) - ball(low, BALL)),
            Synthetic::Pathology => {
                let (_, radius, half) = PATHOLOGY;
                let squares = self.bumps.iter().map(|bump| bump.1.length_squared());
                let area = PI * radius * radius * (1.0 + 0.5 * squares.sum::<f64>());
                area * (ball(high, half) - ball(low, half))
            }
            Synthetic::Skull => {
                // The thickness at an angle, times the distance of its middle, around.
                let node = |k: u32| {
                    let t = PI * (f64::from(k) + 0.5) / f64::from(NODES);
                    self.radius(AROUND * t.cos()) * t.sin().powi(2)
                };
                let around = (0..NODES).map(node).sum::<f64>() * PI / f64::from(NODES);
                let area = SKULL[0] * SKULL[1] * THICKNESS * AROUND * around;
                area * (arc(high, SKULL[2]) - arc(low, SKULL[2]))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The volume of prisms over polygons of many points, by Simpson's rule over many layers.
    fn prisms(kind: Synthetic, seed: u64) -> f64 {
        let (body, _) = synthetic(kind, seed, 401, 4000);
        let areas: Vec<f64> = body
            .layers
            .iter()
            .map(|layer| {
                let next = layer.points.iter().cycle().skip(1);
                let turns = layer.points.iter().zip(next);
                let sum: f64 = turns
                    .map(|(a, b)| a.truncate().perp_dot(b.truncate()))
                    .sum();
                0.5 * sum.abs()
            })
            .collect();
        let step = body.layers[1].points[0].z - body.layers[0].points[0].z;
        let weights = (0..areas.len()).map(|k| match k {
            0 | 400 => 1.0,
            _ if k % 2 == 1 => 4.0,
            _ => 2.0,
        });
        areas.iter().zip(weights).map(|(a, w)| a * w).sum::<f64>() * step / 3.0
    }

    #[test]
    fn volumes_are_those_of_the_sections() {
        for kind in [Synthetic::Sphere, Synthetic::Skull, Synthetic::Pathology] {
            for seed in [1, 7] {
                let (_, volume) = synthetic(kind, seed, 2, 3);
                let found = prisms(kind, seed);
                assert!(
                    (found / volume - 1.0).abs() < 3e-6,
                    "{kind:?}: {found} {volume}"
                );
            }
        }
        let [a, b] = [1, 2].map(|seed| synthetic(Synthetic::Skull, seed, 2, 3).1);
        assert!((a - b).abs() > 1e-3 * a);
    }
}
