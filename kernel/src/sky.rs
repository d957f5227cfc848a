//! What is behind everything, by direction.

use std::f64::consts::PI;

use glam::DVec3;

/// Colours behind everything that change with the height above the horizon.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    up: DVec3,
    sky: Vec<(f64, DVec3)>,
    ground: Vec<(f64, DVec3)>,
}

impl Sky {
    /// A sky around the unit vector `up`.
    ///
    /// Each entry is an angle in radians and the linear colour there: in `sky` from `up`
    /// downwards, in `ground` from below upwards; angles that do not grow are moved up. Colours
    /// change evenly between two angles. The last colour of the sky reaches down to the
    /// ground, which ends at its last angle. An empty sky is black.
    pub fn new(up: DVec3, mut sky: Vec<(f64, DVec3)>, mut ground: Vec<(f64, DVec3)>) -> Self {
        for stops in [&mut sky, &mut ground] {
            let mut last: f64 = 0.0;
            for (angle, _) in stops {
                last = angle.min(PI).max(last);
                *angle = last;
            }
        }
        Self { up, sky, ground }
    }

    /// The unit vector upwards.
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// The colours of the sky, with their angles from `up` downwards, which do not fall.
    pub fn sky(&self) -> &[(f64, DVec3)] {
        &self.sky
    }

    /// The colours of the ground, with their angles from below upwards, which do not fall.
    pub fn ground(&self) -> &[(f64, DVec3)] {
        &self.ground
    }

    /// The linear colour seen along `direction`.
    pub fn color(&self, direction: DVec3) -> DVec3 {
        let angle = direction.angle_between(self.up);
        let below = PI - angle;
        match self.ground.last() {
            Some(&(end, _)) if below < end || below <= 0.0 => mixed(&self.ground, below),
            _ => mixed(&self.sky, angle),
        }
    }
}

/// The colour at an angle.
fn mixed(stops: &[(f64, DVec3)], angle: f64) -> DVec3 {
    let after = stops.partition_point(|&(stop, _)| stop <= angle);
    match (after.checked_sub(1).map(|i| stops[i]), stops.get(after)) {
        (Some((a, from)), Some(&(b, to))) => from.lerp(to, (angle - a) / (b - a)),
        (Some((_, color)), None) | (None, Some(&(_, color))) => color,
        (None, None) => DVec3::ZERO,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_change_evenly_between_angles() {
        let (red, green, blue, white) = (DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE);
        let sky = Sky::new(
            DVec3::Y,
            vec![(0.0, red), (1.0, green), (0.5, blue)],
            vec![(0.0, white), (0.5, green)],
        );
        let at = |angle: f64| sky.color(DVec3::new(angle.sin(), angle.cos(), 0.0) * 3.0);
        let near = |a: DVec3, b: DVec3| assert!(a.distance(b) < 1e-12, "{a} {b}");
        near(at(0.0), red);
        near(at(0.25), red * 0.75 + green * 0.25);
        // The angle that does not grow lies on the one before.
        near(at(1.2), blue);
        near(at(PI - 0.6), blue);
        near(at(PI - 0.25), (white + green) * 0.5);
        near(at(PI), white);
        near(
            Sky::new(DVec3::Y, Vec::new(), Vec::new()).color(DVec3::X),
            DVec3::ZERO,
        );
    }
}
