//! Surfaces of straight lines that all run towards one point, or side by side: cones and cylinders over
//! any curve.
//!
//! With the share `s` of the way from the wider end such a surface is `r E + A`, where `E` depends on the
//! parameter across the lines, `u`, alone, and `r` and the point `A` on `s` alone, both linear: `r` is 1 at the
//! wider end. A point of a flat triangle with the barycentric coordinates `l_i` is
//! `r sum(m_i E(u_i)) + A`, where `s = sum(l_i s_i)` belongs to `r` and `A`, and `m_i = l_i r_i / r`. The `m_i`
//! add up to 1 too, hence the surface at `u = sum(m_i u_i)` and `s` is the place to compare with: they are as far
//! apart as the curve from its chords, whatever the extent along the lines.

use glam::{DVec2, DVec3, DVec4};
use kernel::Surface;

use super::pieces::Rect;

/// Ends of lines that are off by less than this share of their extent are where they should be.
const OFF: f64 = 1e-9;

/// Weights at the ends of a line that differ by no more than this share are one.
const ROUNDING: f64 = 1e-14;

/// A surface of such lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    /// The axis of the parameters along the lines.
    axis: usize,
    /// Where the lines are farthest apart, and the other end.
    ends: [f64; 2],
    /// What is left of `r` at the other end.
    narrow: f64,
    /// How far flat triangles and surface may be apart because the lines are not where they should be.
    pub(super) off: f64,
}

impl Cone {
    /// A surface as one, if it is one.
    pub(super) fn of(surface: &Surface) -> Option<Self> {
        (0..2).find_map(|axis| Self::along(surface, axis))
    }

    fn along(surface: &Surface, axis: usize) -> Option<Self> {
        let knots = [surface.knots_u(), surface.knots_v()][axis];
        if (knots.degree(), knots.count()) != (1, 2) {
            return None;
        }
        let net = surface.homogeneous();
        let count = net.len() / 2;
        let line = |k: usize| match axis {
            0 => [net[k], net[k + count]],
            _ => [net[2 * k], net[2 * k + 1]],
        };
        let is_even = |[a, b]: [DVec4; 2]| (a.w - b.w).abs() <= ROUNDING * a.w;
        if !(0..count).map(line).all(is_even) {
            return None;
        }
        let at = |k: usize, end: usize| line(k)[end].truncate() / line(k)[end].w;
        let middle = |end: usize| (0..count).map(|k| at(k, end)).sum::<DVec3>() / count as f64;
        let middles = [middle(0), middle(1)];
        let arm = |k: usize, end: usize| at(k, end) - middles[end];
        let size = |end: usize| {
            (0..count)
                .map(|k| arm(k, end).length_squared())
                .sum::<f64>()
        };
        let sizes = [size(0), size(1)];
        let (wide, other) = if sizes[0] < sizes[1] { (1, 0) } else { (0, 1) };
        let product: f64 = (0..count).map(|k| arm(k, wide).dot(arm(k, other))).sum();
        let narrow = product / sizes[wide];
        // Not next to zero at an apex, nor beyond it by rounding; and not next to one where lines are side by side.
        let exact = [0.0, 1.0]
            .into_iter()
            .find(|x: &f64| (narrow - x).abs() < OFF);
        let narrow = exact.unwrap_or(narrow);
        let off = (0..count).map(|k| arm(k, other).distance(arm(k, wide) * narrow));
        let off = off.fold(0.0, f64::max);
        let domain = knots.domain();
        let ends = [domain.start, domain.end];
        // Lines may neither cross nor be points.
        let is_one = narrow >= 0.0 && off <= OFF * sizes[wide].sqrt();
        is_one.then(|| Self {
            axis,
            ends: [ends[wide], ends[other]],
            narrow,
            off: 2.0 * off,
        })
    }

    /// Whether the lines come closer to each other: else parameters of flat triangles are spread evenly.
    pub(super) fn narrows(&self) -> bool {
        self.narrow < 1.0
    }

    /// The axis of the parameters across the lines.
    pub(super) fn across(&self) -> usize {
        1 - self.axis
    }

    /// What `r` is at parameters.
    fn radius(&self, uv: DVec2) -> f64 {
        let [wide, other] = self.ends;
        let share = ((uv[self.axis] - wide) / (other - wide)).clamp(0.0, 1.0);
        1.0 + (self.narrow - 1.0) * share
    }

    /// The parameters that belong to a point of a flat triangle, or of a segment, with shares of its corners.
    pub(super) fn place<const N: usize>(&self, uvs: [DVec2; N], shares: [f64; N]) -> DVec2 {
        let (mut plain, mut sum, mut across) = (DVec2::ZERO, 0.0, 0.0);
        for (uv, share) in uvs.into_iter().zip(shares) {
            let part = share * self.radius(uv);
            plain += uv * share;
            sum += part;
            across += uv[self.across()] * part;
        }
        // All corners at an apex are one point.
        if sum > 0.0 {
            plain[self.across()] = across / sum;
        }
        plain
    }

    /// Positive if what belongs to a triangle runs anticlockwise in the parameters, negative if clockwise: its sides
    /// are straight where `u` and `1 / r` are the coordinates, hence where `u r` and `s` are.
    pub(super) fn turn(&self, uvs: [DVec2; 3]) -> f64 {
        let middle = uvs[0][self.across()];
        let [a, b, c] = uvs.map(|mut uv| {
            uv[self.across()] = (uv[self.across()] - middle) * self.radius(uv);
            uv
        });
        (b - a).perp_dot(c - a)
    }

    /// How far the parameters that belong to a chord are from the straight way between its ends, across the lines.
    pub(super) fn aside(&self, [from, to]: [DVec2; 2]) -> f64 {
        let across = (to[self.across()] - from[self.across()]).abs();
        let roots = [from, to].map(|uv| self.radius(uv).sqrt());
        let sum = roots[0] + roots[1];
        if sum > 0.0 {
            across * (roots[1] - roots[0]).abs() / sum
        } else {
            0.0
        }
    }

    /// Whether parameters are those of an apex, where all lines meet.
    pub(super) fn is_apex(&self, uv: DVec2) -> bool {
        self.radius(uv) <= 0.0
    }

    /// The part of the wider end that a rectangle lies over.
    pub(super) fn wide_end(&self, rect: &Rect) -> Rect {
        let mut end = *rect;
        end.min[self.axis] = self.ends[0];
        end.max[self.axis] = self.ends[0];
        end
    }

    /// How far the part of a flat triangle along one of its sides is from the surface at most, for a second
    /// derivative across the lines of one at the wider end between its ends. The whole triangle is no
    /// farther away than its sides.
    ///
    /// With a function `g` that has the length of that derivative as its own second derivative, it is
    /// `r sum(m_i (g(u_i) - g(u)))`, no more than `r sum(m_i d_i(c))` where `d_i(c)` is how far `g(u_i)` is above
    /// the tangent at any `c`. As `r m_i = l_i r_i`, no more than the largest of all `r_i d_i(c)` is left, and for
    /// the best `c` that is the same for two of the corners.
    pub(super) fn bend(&self, [from, to]: [DVec2; 2]) -> f64 {
        let across = from[self.across()] - to[self.across()];
        let roots = [from, to].map(|uv| self.radius(uv).sqrt());
        let sum = roots[0] + roots[1];
        if sum > 0.0 {
            0.5 * (roots[0] * roots[1] * across / sum).powi(2)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use kernel::modelling::{self, Frame};

    use super::*;
    use crate::random::Random;

    #[test]
    fn lines_of_a_cylinder_are_side_by_side_whatever_rounding_makes_of_them() {
        let mut random = Random(5);
        for _ in 0..50 {
            let (origin, axis) = (random.vector() * 1e3, random.vector());
            let frame = Frame::about(origin, axis).unwrap();
            let cylinder = modelling::cylinder(&frame, 0.7, 0.0..TAU, 0.0..3.0).unwrap();
            let cone = Cone::of(&cylinder).unwrap();
            assert!(!cone.narrows(), "{cone:?}");
            let ends = [DVec2::new(0.3, 0.2), DVec2::new(1.9, 2.7)];
            assert!(cone.aside(ends) <= 0.0 && cone.off <= 1e-12 * 1e3);
        }
        let ends = [DVec3::X, DVec3::new(0.5, 0.0, 2.0)];
        let line = kernel::Curve::line(ends[0], ends[1], 0.0..1.0).unwrap();
        let cone = modelling::revolve(&line, DVec3::ZERO, DVec3::Z, 0.0..TAU).unwrap();
        assert!(Cone::of(&cone).unwrap().narrows());
    }
}
