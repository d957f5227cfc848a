//! One rational Bézier piece of a surface.

use std::ops::Range;

use glam::{DVec3, DVec4};

use crate::Aabb;

/// A rational Bézier piece with its place in the parent's parameter domain.
///
/// The net is `(w P, w)`, row by row: `points[i * (degree_v + 1) + j]`.
#[derive(Clone, Debug, PartialEq)]
pub struct BezierSurface {
    degree_u: usize,
    degree_v: usize,
    points: Vec<DVec4>,
    u: Range<f64>,
    v: Range<f64>,
}

impl BezierSurface {
    /// A piece from a valid net with `[degree_u, degree_v]`.
    pub(crate) fn trusted(
        [degree_u, degree_v]: [usize; 2],
        points: Vec<DVec4>,
        u: Range<f64>,
        v: Range<f64>,
    ) -> Self {
        Self {
            degree_u,
            degree_v,
            points,
            u,
            v,
        }
    }

    /// Degree along u.
    pub fn degree_u(&self) -> usize {
        self.degree_u
    }

    /// Degree along v.
    pub fn degree_v(&self) -> usize {
        self.degree_v
    }

    /// The control points `(w P, w)`, `[i * (degree_v + 1) + j]`.
    pub fn homogeneous(&self) -> &[DVec4] {
        &self.points
    }

    /// The part of the parent's u domain.
    pub fn u(&self) -> Range<f64> {
        self.u.clone()
    }

    /// The part of the parent's v domain.
    pub fn v(&self) -> Range<f64> {
        self.v.clone()
    }

    /// The Cartesian control points.
    pub fn points(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.points.iter().map(|h| h.truncate() / h.w)
    }

    /// A box around the control points, and so around the piece.
    pub fn hull_bounds(&self) -> Aabb {
        Aabb::around(self.points())
    }

    /// The two parts before and after the local parameter `t` in `0..1` along u.
    pub fn split_u(&self, t: f64) -> [Self; 2] {
        let row = self.degree_v + 1;
        let (mut left, mut right) = (self.points.clone(), self.points.clone());
        for j in 0..row {
            split(&mut left[j..], &mut right[j..], self.degree_u, row, t);
        }
        let middle = self.u.start + (self.u.end - self.u.start) * t;
        let part = |points, u| Self {
            points,
            u,
            ..self.clone()
        };
        [
            part(left, self.u.start..middle),
            part(right, middle..self.u.end),
        ]
    }

    /// The two parts before and after the local parameter `t` in `0..1` along v.
    pub fn split_v(&self, t: f64) -> [Self; 2] {
        let row = self.degree_v + 1;
        let (mut left, mut right) = (self.points.clone(), self.points.clone());
        for i in 0..=self.degree_u {
            split(
                &mut left[i * row..],
                &mut right[i * row..],
                self.degree_v,
                1,
                t,
            );
        }
        let middle = self.v.start + (self.v.end - self.v.start) * t;
        let part = |points, v| Self {
            points,
            v,
            ..self.clone()
        };
        [
            part(left, self.v.start..middle),
            part(right, middle..self.v.end),
        ]
    }
}

/// De Casteljau's algorithm on every `stride`-th point; both slices hold the same points
/// before and the two halves after.
fn split(left: &mut [DVec4], right: &mut [DVec4], degree: usize, stride: usize, t: f64) {
    for level in 1..=degree {
        for k in 0..=degree - level {
            right[k * stride] = right[k * stride] * (1.0 - t) + right[(k + 1) * stride] * t;
        }
        left[level * stride] = right[0];
    }
}
