//! Two surfaces, and points that are on both of them.

use glam::{DMat3, DVec2, DVec3, DVec4};

use crate::Surface;

/// Steps of Newton's method until two points are one.
const STEPS: usize = 24;

/// Points are one if they are nearer than this share of the size of what they are of; it is gone on
/// while they come nearer until they are that much nearer than that.
const NEAR: f64 = 1e-11;
const BEST: f64 = 1e-14;

/// Parameters farther than this outside a surface are not looked at.
const OUTSIDE: f64 = 0.5;

/// How much of the identity is added to matrices that may be singular.
const DAMPING: f64 = 1e-15;

/// Two Bézier pieces, each over the unit square.
#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    /// The first, whose parameters are the first two of four.
    pub(super) first: &'a Surface,
    /// The second, whose parameters are the others.
    pub(super) second: &'a Surface,
    /// The size of what they are parts of.
    pub(super) size: f64,
}

/// What is known of a point on both surfaces.
pub(super) struct Course {
    /// The point.
    pub(super) point: DVec3,
    /// The direction in which the surfaces go on together, of length one.
    pub(super) along: DVec3,
    /// How the parameters change per length there.
    pub(super) rate: DVec4,
    /// The sine of the angle between the surfaces.
    pub(super) sine: f64,
}

impl Pair<'_> {
    fn tangents(&self, at: DVec4) -> [(DVec3, [DVec3; 2]); 2] {
        let (first, second) = halves(at);
        [self.first.tangents(first), self.second.tangents(second)]
    }

    /// How far the points of the surfaces are from each other.
    pub(super) fn distance(&self, at: DVec4) -> f64 {
        let (first, second) = halves(at);
        self.first
            .evaluate(first)
            .distance(self.second.evaluate(second))
    }

    /// Parameters near these at which the surfaces have the same point, with one of the four left as it is
    /// if asked; none if none are found.
    pub(super) fn settled(&self, mut at: DVec4, fixed: Option<usize>) -> Option<DVec4> {
        let mut best = f64::INFINITY;
        for _ in 0..STEPS {
            let [(p, [pu, pv]), (q, [qu, qv])] = self.tangents(at);
            let apart = p - q;
            let distance = apart.length();
            if distance <= BEST * self.size || (best <= NEAR * self.size && distance > 0.5 * best) {
                return Some(at);
            }
            best = best.min(distance);
            let mut columns = [pu, pv, -qu, -qv];
            if let Some(fixed) = fixed {
                columns[fixed] = DVec3::ZERO;
            }
            // The least step that brings the points together, as far as the tangents tell.
            let squares = columns.iter().fold(DMat3::ZERO, |sum, c| {
                sum + DMat3::from_cols(*c * c.x, *c * c.y, *c * c.z)
            });
            let trace = squares.x_axis.x + squares.y_axis.y + squares.z_axis.z;
            let share =
                (squares + DMat3::from_diagonal(DVec3::splat(DAMPING * trace))).inverse() * apart;
            let step = DVec4::from_array(columns.map(|column| column.dot(share)));
            at -= step;
            let is_inside = at.min_element() >= -OUTSIDE && at.max_element() <= 1.0 + OUTSIDE;
            if !is_inside {
                return None;
            }
        }
        (self.distance(at) <= NEAR * self.size).then_some(at)
    }

    /// How the surfaces go on from a point in common; none where one has no normal.
    pub(super) fn course(&self, at: DVec4) -> Option<Course> {
        let [(point, first), (_, second)] = self.tangents(at);
        let [m, n] = [first, second].map(|[u, v]| u.cross(v).try_normalize());
        let along = m?.cross(n?);
        let sine = along.length();
        let along = along.try_normalize()?;
        let first = in_plane(first, along)?;
        let second = in_plane(second, along)?;
        let rate = DVec4::new(first.x, first.y, second.x, second.y);
        Some(Course {
            point,
            along,
            rate,
            sine,
        })
    }
}

/// The parameters of a surface at which it is nearest to a point next to it, from a guess; none if they
/// are not found or far outside.
pub(super) fn foot(surface: &Surface, point: DVec3, mut at: DVec2, size: f64) -> Option<DVec2> {
    for _ in 0..STEPS {
        let (own, tangents) = surface.tangents(at);
        let step = in_plane(tangents, point - own)?;
        at += step;
        let is_inside = at.min_element() >= -OUTSIDE && at.max_element() <= 1.0 + OUTSIDE;
        if !is_inside {
            return None;
        }
        let [u, v] = tangents;
        if (u * step.x + v * step.y).length() <= BEST * size {
            return Some(at);
        }
    }
    None
}

/// The combination of two tangents that is nearest to a vector.
pub(super) fn in_plane([u, v]: [DVec3; 2], vector: DVec3) -> Option<DVec2> {
    let (uu, uv, vv) = (u.length_squared(), u.dot(v), v.length_squared());
    let determinant = uu * vv - uv * uv;
    let (x, y) = (u.dot(vector), v.dot(vector));
    let found = DVec2::new(x * vv - y * uv, y * uu - x * uv) / determinant;
    found.is_finite().then_some(found)
}

/// The parameters of the first and of the second surface.
pub(super) fn halves(at: DVec4) -> (DVec2, DVec2) {
    (DVec2::new(at.x, at.y), DVec2::new(at.z, at.w))
}
