//! The same surface in other words: refined, cut, raised, turned, moved, in pieces.

use std::ops::Range;

use glam::{DAffine3, DVec4};

use super::{Surface, transposed};
use crate::curve::{check_inside, check_raised, check_range, transform_all};
use crate::spline::{self, Spline};
use crate::{BezierSurface, Error, KnotVector};

impl Surface {
    /// The same surface with `knot` standing `multiplicity` times along u.
    ///
    /// # Errors
    /// If the knot lies outside the open domain.
    pub fn with_knot_u(&self, knot: f64, multiplicity: usize) -> Result<Self, Error> {
        check_inside(knot, &self.knots_u.domain())?;
        Ok(self.along_u(|knots, column| spline::insert(knots, column, knot, multiplicity)))
    }

    /// The same surface with `knot` standing `multiplicity` times along v.
    ///
    /// # Errors
    /// As [`Surface::with_knot_u`].
    pub fn with_knot_v(&self, knot: f64, multiplicity: usize) -> Result<Self, Error> {
        Ok(self
            .transposed()
            .with_knot_u(knot, multiplicity)?
            .transposed())
    }

    /// The same surface with every knot of `extra` inserted along u, once for each time it
    /// stands there, in any order.
    ///
    /// # Errors
    /// If a knot lies outside the open domain, or would stand there more than `degree` times.
    pub fn refined_u(&self, extra: &[f64]) -> Result<Self, Error> {
        let extra = spline::check_refinement(&self.knots_u, extra)?;
        Ok(self.along_u(|knots, column| spline::refine(knots, column, &extra)))
    }

    /// The same surface with every knot of `extra` inserted along v.
    ///
    /// # Errors
    /// As [`Surface::refined_u`].
    pub fn refined_v(&self, extra: &[f64]) -> Result<Self, Error> {
        Ok(self.transposed().refined_u(extra)?.transposed())
    }

    /// The two parts before and after `u`, each clamped along u. They share their common
    /// control points to the last bit.
    ///
    /// # Errors
    /// If `u` is not inside the domain.
    pub fn split_u(&self, u: f64) -> Result<[Self; 2], Error> {
        check_inside(u, &self.knots_u.domain())?;
        let part = |side: usize| {
            self.along_u(|knots, column| {
                let [before, after] = spline::split(knots, column, u);
                if side == 0 { before } else { after }
            })
        };
        Ok([part(0), part(1)])
    }

    /// The two parts before and after `v`, each clamped along v.
    ///
    /// # Errors
    /// As [`Surface::split_u`].
    pub fn split_v(&self, v: f64) -> Result<[Self; 2], Error> {
        Ok(self.transposed().split_u(v)?.map(|part| part.transposed()))
    }

    /// The part over `range` along u, clamped along u.
    ///
    /// # Errors
    /// If `range` is empty or leaves the domain.
    pub fn restricted_u(&self, range: Range<f64>) -> Result<Self, Error> {
        check_range(&range, &self.knots_u.domain())?;
        Ok(self.along_u(|knots, column| spline::restrict(knots, column, &range)))
    }

    /// The part over `range` along v, clamped along v.
    ///
    /// # Errors
    /// As [`Surface::restricted_u`].
    pub fn restricted_v(&self, range: Range<f64>) -> Result<Self, Error> {
        Ok(self.transposed().restricted_u(range)?.transposed())
    }

    /// The same surface with its degree along u raised to `degree`, clamped along u if
    /// anything is raised.
    ///
    /// # Errors
    /// If `degree` is below the present degree or above [`crate::MAX_DEGREE`].
    pub fn elevated_u(&self, degree: usize) -> Result<Self, Error> {
        check_raised(degree, self.knots_u.degree())?;
        let mut surface = self.clone();
        for _ in self.knots_u.degree()..degree {
            surface = surface.along_u(spline::elevate_once);
        }
        Ok(surface)
    }

    /// The same surface with its degree along v raised to `degree`.
    ///
    /// # Errors
    /// As [`Surface::elevated_u`].
    pub fn elevated_v(&self, degree: usize) -> Result<Self, Error> {
        Ok(self.transposed().elevated_u(degree)?.transposed())
    }

    /// The same surface run through backwards along u; its normal turns around.
    #[must_use]
    pub fn reversed_u(&self) -> Self {
        let rows = self.points.chunks_exact(self.knots_v.count()).rev();
        let points = rows.flatten().copied().collect();
        Self {
            knots_u: self.knots_u.reversed(),
            knots_v: self.knots_v.clone(),
            points,
        }
    }

    /// The same surface run through backwards along v; its normal turns around.
    #[must_use]
    pub fn reversed_v(&self) -> Self {
        self.transposed().reversed_u().transposed()
    }

    /// The same surface with u and v exchanged; its normal turns around.
    ///
    /// Every operation along v is the one along u between two of these.
    #[must_use]
    pub fn transposed(&self) -> Self {
        Self {
            knots_u: self.knots_v.clone(),
            knots_v: self.knots_u.clone(),
            points: transposed(&self.points, self.knots_v.count()),
        }
    }

    /// The image of the surface under a finite affine map; parameters stay as they are.
    ///
    /// Where numbers are so large that their products are not finite, the caller checks the points.
    #[must_use]
    pub fn transformed(&self, target_from_source: &DAffine3) -> Self {
        let points = transform_all(&self.points, target_from_source);
        Self {
            knots_u: self.knots_u.clone(),
            knots_v: self.knots_v.clone(),
            points,
        }
    }

    /// The same surface over affinely moved domains.
    ///
    /// # Errors
    /// If a domain is empty or not finite.
    pub fn remapped(&self, domain_u: Range<f64>, domain_v: Range<f64>) -> Result<Self, Error> {
        let knots_u = self.knots_u.remapped(domain_u)?;
        let knots_v = self.knots_v.remapped(domain_v)?;
        Ok(Self {
            knots_u,
            knots_v,
            points: self.points.clone(),
        })
    }

    /// The Bézier pieces, one for each pair of spans with a length; v runs fastest.
    ///
    /// Neighbouring pieces share their border control points to the last bit.
    pub fn bezier_pieces(&self) -> Vec<BezierSurface> {
        if self.knots_u.is_bezier() && self.knots_v.is_bezier() {
            let degrees = [self.knots_u.degree(), self.knots_v.degree()];
            let (u, v) = (self.knots_u.domain(), self.knots_v.domain());
            return vec![BezierSurface::trusted(degrees, self.points.clone(), u, v)];
        }
        let strips = self.bezier_strips_u();
        let pieces = strips.iter().flat_map(|strip| {
            let turned = strip.transposed();
            let domain_u = strip.knots_u.domain();
            turned.bezier_strips_u().into_iter().map(move |piece| {
                let domain_v = piece.knots_u.domain();
                let piece = piece.transposed();
                let degrees = [piece.knots_u.degree(), piece.knots_v.degree()];
                BezierSurface::trusted(degrees, piece.points, domain_u.clone(), domain_v)
            })
        });
        pieces.collect()
    }

    /// Strips that are Bézier along u and unchanged along v.
    fn bezier_strips_u(&self) -> Vec<Self> {
        let p = self.knots_u.degree();
        let columns: Vec<_> = self
            .columns()
            .map(|column| spline::bezier_pieces(&self.knots_u, &column))
            .collect();
        let strip = |s: usize| {
            let range = &columns[0][s].0;
            let points = (0..=p)
                .flat_map(|i| columns.iter().map(move |c| c[s].1[i]))
                .collect();
            Self {
                knots_u: KnotVector::trusted_bezier(p, range),
                knots_v: self.knots_v.clone(),
                points,
            }
        };
        (0..columns[0].len()).map(strip).collect()
    }

    /// Applies a one-dimensional operation to every column.
    fn along_u(&self, operation: impl Fn(&KnotVector, &[DVec4]) -> Spline<DVec4>) -> Self {
        let columns: Vec<_> = self
            .columns()
            .map(|column| operation(&self.knots_u, &column))
            .collect();
        let knots_u = columns[0].0.clone();
        let points = (0..knots_u.count())
            .flat_map(|i| columns.iter().map(move |c| c.1[i]))
            .collect();
        Self {
            knots_u,
            knots_v: self.knots_v.clone(),
            points,
        }
    }
}
