//! Which parameters belong to the points of a flat triangle, and how far the surface is there.

use glam::{DVec2, DVec3};

use super::super::cone::Cone;
use super::super::round::Round;
use super::{Pieces, Rect, Spread};

impl Pieces<'_> {
    /// How far a flat triangle is from the surface at the [parameters](Self::place) that belong to its
    /// points; a coarser bound where it is `enough`, or so much that it is hopeless, or a better one would be `futile`.
    pub(crate) fn off_flat(
        &self,
        uvs: [DVec2; 3],
        (enough, hopeless): (f64, f64),
        futile: impl Fn() -> bool,
    ) -> f64 {
        let rect = Rect::around(uvs);
        let is_creased = self.is_creased_inside(&rect);
        let Some(cone) = &self.cone else {
            let size = rect.size();
            let bound = |spread: &Spread| {
                if is_creased {
                    spread.bent(size)
                } else {
                    spread.triangle(uvs, size)
                }
            };
            return self.bound_until(&rect, bound, (enough, hopeless), futile);
        };
        if is_creased {
            let rect = cone.wide_end(&rect);
            return self.spread(&rect).bent(rect.size()) + cone.off;
        }
        let sides = [[uvs[0], uvs[1]], [uvs[1], uvs[2]], [uvs[2], uvs[0]]];
        let enough = (enough - cone.off, hopeless - cone.off);
        let off = |side: [DVec2; 2]| self.off_chord(cone, side, enough);
        sides.map(off).into_iter().fold(0.0, f64::max) + cone.off
    }

    /// How far a chord of a cone is from it at the parameters that belong to its points, without what the cone
    /// is off.
    fn off_chord(&self, cone: &Cone, ends: [DVec2; 2], enough: (f64, f64)) -> f64 {
        let bend = cone.bend(ends);
        if bend <= 0.0 {
            return 0.0;
        }
        let rect = cone.wide_end(&Rect::around(ends));
        let bound = |spread: &Spread| bend * spread.second(cone.across());
        self.bound_until(&rect, bound, enough, || false)
    }

    /// How far a chord is from the surface where the parameters that belong to it are not those of the straight
    /// way, at least, and by how much more what lies between both may be.
    pub(in crate::tessellate) fn beside_chord(&self, ends: [DVec2; 2]) -> [f64; 2] {
        let aside = self.cone.map_or(0.0, |cone| cone.aside(ends));
        let Some(cone) = self.cone.filter(|_| aside > 0.0) else {
            return [0.0; 2];
        };
        let wide = self.spread(&cone.wide_end(&Rect::around(ends)));
        let second = wide.second(cone.across());
        let bound = |bend: f64| bend * second + cone.off;
        [bound(cone.bend(ends)), bound(aside * aside / 8.0)]
    }

    /// The parameters that belong to a point of a flat triangle, or of a segment, with shares of its corners.
    #[inline]
    pub(crate) fn place<const N: usize>(&self, uvs: [DVec2; N], shares: [f64; N]) -> DVec2 {
        if let Some(cone) = &self.cone {
            return cone.place(uvs, shares);
        }
        let mut sum = DVec2::ZERO;
        for k in 0..N {
            sum += uvs[k] * shares[k];
        }
        if let Some(round) = &self.round {
            let mut flat = DVec3::ZERO;
            for k in 0..N {
                flat += self.surface.evaluate(uvs[k]) * shares[k];
            }
            return round.place(flat, sum);
        }
        sum
    }

    /// The axis of the parameters across the lines that meet at a vertex with a [regular
    /// normal](Surface::point_and_regular_normal) or none, if they do.
    pub(in crate::tessellate) fn across_apex(&self, uv: DVec2, normal: DVec3) -> Option<usize> {
        let cone = self.cone.filter(|cone| cone.is_apex(uv));
        let round = self.round.as_ref().filter(|_| normal == DVec3::ZERO);
        cone.map(|cone| cone.across()).or(round.map(Round::around))
    }
}
