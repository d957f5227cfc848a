//! Affine maps as nodes may hold them: translation, rotation, scale.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::json::scene::UnitQuaternion;
use serde_json::{Value, json};

/// A map that scales along the axes, then turns, then moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

/// Columns whose sizes and angles differ by less than this are a rotation with scales.
const ROUNDING: f64 = 1e-9;

impl Place {
    pub(super) const IDENTITY: Self = Self {
        translation: DVec3::ZERO,
        rotation: DQuat::IDENTITY,
        scale: DVec3::ONE,
    };

    /// The places that one after the other, outer first, make up a map: one, or two where it
    /// shears.
    pub(super) fn of(map: &DAffine3) -> Vec<Self> {
        let m = map.matrix3;
        if let Some(place) = plain(&m) {
            let translation = map.translation;
            return vec![Self {
                translation,
                ..place
            }];
        }
        // m = (m V) Vt, where V are the directions that stay perpendicular.
        let v = perpendicular(&(m.transpose() * m));
        let inner = Self {
            rotation: DQuat::from_mat3(&v.transpose()).normalize(),
            ..Self::IDENTITY
        };
        let outer = Self {
            translation: map.translation,
            ..loose(&(m * v))
        };
        vec![outer, inner]
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "files hold single precision"
    )]
    pub(super) fn apply_to(&self, node: &mut gltf::json::Node) {
        if self.translation != DVec3::ZERO {
            node.translation = Some(self.translation.to_array().map(|x| x as f32));
        }
        if self.rotation != DQuat::IDENTITY {
            node.rotation = Some(self.quaternion());
        }
        if self.scale != DVec3::ONE {
            node.scale = Some(self.scale.to_array().map(|x| x as f32));
        }
    }

    /// Replaces the numbers of a node that it was [applied to](Self::apply_to) by those of double precision, which
    /// are the same in single precision.
    pub(super) fn write_in_full(&self, node: &mut Value) {
        let exact = [
            ("translation", json!(self.translation.to_array())),
            ("rotation", json!(self.rotation.normalize().to_array())),
            ("scale", json!(self.scale.to_array())),
        ];
        for (name, numbers) in exact {
            if node[name].is_array() {
                node[name] = numbers;
            }
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "files hold single precision"
    )]
    pub(super) fn quaternion(&self) -> UnitQuaternion {
        UnitQuaternion(self.rotation.normalize().to_array().map(|x| x as f32))
    }
}

/// A matrix with perpendicular columns as rotation and scale.
fn plain(m: &DMat3) -> Option<Place> {
    if *m == DMat3::IDENTITY {
        return Some(Place::IDENTITY);
    }
    let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis];
    let skew = |a: DVec3, b: DVec3| a.dot(b).abs() / (a.length() * b.length());
    let sound = skew(a, b).max(skew(b, c)).max(skew(c, a)) <= ROUNDING;
    sound.then(|| loose(m))
}

/// As [`plain`], whatever the angles.
fn loose(m: &DMat3) -> Place {
    let lengths = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
    let mut scale = lengths;
    if m.determinant() < 0.0 {
        scale.x = -scale.x;
    }
    let axes = DMat3::from_cols(m.x_axis / scale.x, m.y_axis / scale.y, m.z_axis / scale.z);
    // One size rather than three that differ by rounding.
    let mean = (lengths.x + lengths.y + lengths.z) / 3.0;
    if (lengths - mean).abs().max_element() <= ROUNDING * mean {
        let mean = if (mean - 1.0).abs() <= ROUNDING {
            1.0
        } else {
            mean
        };
        scale = scale.signum() * mean;
    }
    let rotation = DQuat::from_mat3(&axes).normalize();
    let rotation = if rotation.angle_between(DQuat::IDENTITY) <= ROUNDING {
        DQuat::IDENTITY
    } else {
        rotation
    };
    Place {
        translation: DVec3::ZERO,
        rotation,
        scale,
    }
}

/// A rotation whose columns are eigenvectors of a symmetric matrix, by Jacobi's rotations.
fn perpendicular(symmetric: &DMat3) -> DMat3 {
    let (mut s, mut v) = (*symmetric, DMat3::IDENTITY);
    for _ in 0..30 {
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let off = s.col(j)[i];
            let angle = 0.5 * (2.0 * off).atan2(s.col(j)[j] - s.col(i)[i]);
            if off.abs() <= f64::MIN_POSITIVE {
                continue;
            }
            let (sin, cos) = angle.sin_cos();
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(i)[i] = cos;
            turn.col_mut(j)[j] = cos;
            turn.col_mut(i)[j] = -sin;
            turn.col_mut(j)[i] = sin;
            s = turn.transpose() * s * turn;
            v *= turn;
        }
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(places: &[Place]) -> DAffine3 {
        places.iter().fold(DAffine3::IDENTITY, |all, p| {
            all * DAffine3::from_scale_rotation_translation(p.scale, p.rotation, p.translation)
        })
    }

    #[test]
    fn maps_are_put_together_again() {
        let turned = DAffine3::from_rotation_z(0.7) * DAffine3::from_rotation_x(-0.4);
        let plain = DAffine3::from_translation(DVec3::new(1.0, -2.0, 3.0))
            * turned
            * DAffine3::from_scale(DVec3::new(2.0, -3.0, 0.5));
        let sheared = DAffine3::from_scale(DVec3::new(1.0, 4.0, 1.0)) * plain;
        for (map, count) in [(DAffine3::IDENTITY, 1), (plain, 1), (sheared, 2)] {
            let places = Place::of(&map);
            assert_eq!(places.len(), count);
            assert!(product(&places).abs_diff_eq(map, 1e-12), "{places:?}");
        }
        assert_eq!(Place::of(&DAffine3::IDENTITY), [Place::IDENTITY]);
    }
}
