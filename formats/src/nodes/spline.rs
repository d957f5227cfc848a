//! The smooth interpolators of X3D 3.2: Hermite splines through key values (ISO/IEC 19775-1,
//! 19.2.2), and rotations by `squad`.

use glam::DQuat;

use super::Node;
use super::scene::turn;
use crate::Warnings;

/// Keys, values and velocities of an interpolator; each value has `size` numbers.
struct Keys {
    keys: Vec<f64>,
    values: Vec<f64>,
    size: usize,
    closed: bool,
}

impl Keys {
    /// Those of a node, if there is a value for each key.
    fn of(node: &Node, warnings: &mut Warnings) -> Option<Self> {
        let keys = node.numbers("key", warnings);
        let values = node.numbers("keyValue", warnings);
        let size = values.len().checked_div(keys.len())?;
        let mut found = Self {
            keys,
            values,
            size,
            closed: false,
        };
        let last = found.keys.len() - 1;
        let closed = node.flag("closed", false, warnings);
        found.closed = closed && last > 1 && size > 0 && found.value(0) == found.value(last);
        (size > 0).then_some(found)
    }

    fn value(&self, i: usize) -> &[f64] {
        &self.values[i * self.size..(i + 1) * self.size]
    }

    /// The key before a fraction, and how far it is from there to the next.
    fn place(&self, fraction: f64) -> (usize, f64) {
        let last = self.keys.len() - 1;
        let after = self.keys.partition_point(|&key| key <= fraction);
        if after == 0 {
            return (0, 0.0);
        }
        if after > last {
            return (last.saturating_sub(1), if last == 0 { 0.0 } else { 1.0 });
        }
        let (from, to) = (self.keys[after - 1], self.keys[after]);
        (after - 1, (fraction - from) / (to - from))
    }

    /// The keys before and after a key, around the joint of closed ones; `None` at an end.
    fn around(&self, i: usize) -> Option<(usize, usize)> {
        let last = self.keys.len() - 1;
        match (i, self.closed) {
            (0, false) => None,
            (i, false) if i == last => None,
            (0, true) => Some((last - 1, 1)),
            (i, true) if i == last => Some((last - 1, 1)),
            _ => Some((i - 1, i + 1)),
        }
    }

    /// The velocity at a key where the file gives none: that of Catmull and Rom.
    fn slope(&self, i: usize) -> Vec<f64> {
        match self.around(i) {
            None => vec![0.0; self.size],
            Some((before, after)) => {
                let pairs = self.value(after).iter().zip(self.value(before));
                pairs.map(|(a, b)| (a - b) * 0.5).collect()
            }
        }
    }

    /// What velocities are multiplied by after and before a key, for steps of different length:
    /// `F+` and `F-` of the standard.
    fn factors(&self, i: usize) -> [f64; 2] {
        let Some((before, after)) = self.around(i) else {
            return [1.0; 2];
        };
        // Around the joint of closed keys a step ends where the next begins.
        let last = self.keys.len() - 1;
        let here = if after < i { 0 } else { i };
        let there = if before > i { last } else { i };
        let forward = self.keys[after] - self.keys[here];
        let backward = self.keys[there] - self.keys[before];
        let sum = forward + backward;
        [2.0 * backward / sum, 2.0 * forward / sum]
    }
}

/// The value of a spline interpolator for a fraction.
pub(super) fn hermite(node: &Node, fraction: f64, warnings: &mut Warnings) -> Option<Vec<f64>> {
    let keys = Keys::of(node, warnings)?;
    let (i, s) = keys.place(fraction);
    if keys.keys.len() < 2 {
        return Some(keys.value(0).to_vec());
    }
    let slopes = velocities(node, &keys, warnings);
    let ([first, _], [_, second]) = (keys.factors(i), keys.factors(i + 1));
    let (s2, s3) = (s * s, s * s * s);
    let basis = [
        2.0 * s3 - 3.0 * s2 + 1.0,
        3.0 * s2 - 2.0 * s3,
        (s3 - 2.0 * s2 + s) * first,
        (s3 - s2) * second,
    ];
    let number = |k: usize| {
        basis[0] * keys.value(i)[k]
            + basis[1] * keys.value(i + 1)[k]
            + basis[2] * slopes[i][k]
            + basis[3] * slopes[i + 1][k]
    };
    Some((0..keys.size).map(number).collect())
}

/// The velocities at all keys: those of the file, for the first and the last alone if it has
/// two, or those that follow from the values.
fn velocities(node: &Node, keys: &Keys, warnings: &mut Warnings) -> Vec<Vec<f64>> {
    let given = node.numbers("keyVelocity", warnings);
    let given: Vec<&[f64]> = given.chunks_exact(keys.size).collect();
    let count = keys.keys.len();
    let mut slopes: Vec<_> = (0..count).map(|i| keys.slope(i)).collect();
    if given.len() == 2 && count > 2 {
        (slopes[0], slopes[count - 1]) = (given[0].to_vec(), given[1].to_vec());
    } else if given.len() == count {
        slopes = given.iter().map(|v| v.to_vec()).collect();
        if node.flag("normalizeVelocity", false, warnings) {
            let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            let step = |i: usize| {
                let pairs = keys.value(i).iter().zip(keys.value(i + 1));
                length(&pairs.map(|(a, b)| a - b).collect::<Vec<_>>())
            };
            let total: f64 = (0..count - 1).map(step).sum();
            for slope in &mut slopes {
                let size = length(slope);
                let scale = if size > 0.0 { total / size } else { 1.0 };
                slope.iter_mut().for_each(|x| *x *= scale);
            }
        }
    }
    slopes
}

/// The rotation of a `SquadOrientationInterpolator` for a fraction (Shoemake 1987).
pub(super) fn squad(node: &Node, fraction: f64, warnings: &mut Warnings) -> Option<DQuat> {
    let keys = Keys::of(node, warnings).filter(|keys| keys.size == 4)?;
    let (i, s) = keys.place(fraction);
    let rotation = |i: usize| {
        let value = <[f64; 4]>::try_from(keys.value(i)).unwrap_or([0.0, 0.0, 1.0, 0.0]);
        turn(value, node)
    };
    if keys.keys.len() < 2 {
        return Some(rotation(0));
    }
    let control = |i: usize| {
        let here = rotation(i);
        let Some((before, after)) = keys.around(i) else {
            return here;
        };
        let log = |other: DQuat| (here.inverse() * short(here, other)).to_scaled_axis();
        let sum = log(rotation(before)) + log(rotation(after));
        here * DQuat::from_scaled_axis(sum * -0.25)
    };
    let (from, to) = (rotation(i), rotation(i + 1));
    let way = from.slerp(to, s);
    let around = control(i).slerp(control(i + 1), s);
    Some(way.slerp(around, 2.0 * s * (1.0 - s)))
}

/// The same rotation by the quaternion that is nearer to another one.
fn short(near: DQuat, other: DQuat) -> DQuat {
    if near.dot(other) < 0.0 { -other } else { other }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes::Field;

    fn node(kind: &str, fields: &[(&str, &str)]) -> Node {
        let field = |(name, value): &(&str, &str)| Field {
            name: (*name).into(),
            value: (*value).into(),
        };
        Node {
            kind: kind.into(),
            fields: fields.iter().map(field).collect(),
            ..Node::default()
        }
    }

    fn at(fields: &[(&str, &str)], fraction: f64) -> f64 {
        let node = node("SplineScalarInterpolator", fields);
        hermite(&node, fraction, &mut Warnings::default()).unwrap()[0]
    }

    #[test]
    fn a_spline_goes_through_its_values_with_its_velocities() {
        let fields = [("key", "0 0.5 1"), ("keyValue", "1 3 2")];
        for (key, value) in [(0.0, 1.0), (0.5, 3.0), (1.0, 2.0), (-1.0, 1.0), (2.0, 2.0)] {
            assert!((at(&fields, key) - value).abs() < 1e-15, "{key}");
        }
        // Halfway: the mean of the values, and an eighth of the slope at the end, (2 - 1) / 2.
        assert!((at(&fields, 0.25) - (2.0 - 0.5 / 8.0)).abs() < 1e-15);
        // Slopes of a line of the file: the line itself.
        let line = [("key", "0 1"), ("keyValue", "0 5"), ("keyVelocity", "5 5")];
        assert!((at(&line, 0.3) - 1.5).abs() < 1e-15);
        // Unequal steps: the slope before the middle key is taken by 2 * 0.25 / 1.
        let uneven = [("key", "0 0.75 1"), ("keyValue", "0 0 2")];
        let slope = 1.0 * 2.0 * 0.25;
        assert!((at(&uneven, 0.375) + slope / 8.0).abs() < 1e-15);
    }

    #[test]
    fn closed_splines_are_smooth_at_their_joint() {
        let fields = [
            ("key", "0 0.25 0.5 0.75 1"),
            ("keyValue", "0 2 -1 -4 0"),
            ("closed", "TRUE"),
        ];
        let step = 1e-6;
        let before = (at(&fields, 1.0) - at(&fields, 1.0 - step)) / step;
        let after = (at(&fields, step) - at(&fields, 0.0)) / step;
        assert!((before - after).abs() < 1e-4, "{before} {after}");
        assert!(before.abs() > 1.0);
    }

    #[test]
    fn even_turns_stay_even() {
        let fields = [
            ("key", "0 0.5 1"),
            ("keyValue", "0 1 0 0, 0 1 0 1, 0 1 0 2"),
        ];
        let node = node("SquadOrientationInterpolator", &fields);
        for fraction in [0.0, 0.2, 0.5, 0.9, 1.0] {
            let (axis, angle) = squad(&node, fraction, &mut Warnings::default())
                .unwrap()
                .to_axis_angle();
            assert!(
                (axis.y * angle - 2.0 * fraction).abs() < 1e-12,
                "{fraction}"
            );
        }
    }
}
