//! Where the derivatives of a surface are, and what follows for triangles and chords.

use glam::{DVec2, DVec3};

/// All vectors no farther than `radius` from `center`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::tessellate) struct Ball {
    pub(in crate::tessellate) center: DVec3,
    pub(in crate::tessellate) radius: f64,
}

impl Ball {
    /// The largest length.
    pub(in crate::tessellate) fn reach(self) -> f64 {
        self.center.length() + self.radius
    }

    /// Becomes the least ball around itself and another.
    fn include(&mut self, other: &Self) {
        let way = other.center - self.center;
        let distance = way.length();
        if distance + other.radius <= self.radius {
            return;
        }
        if distance + self.radius <= other.radius {
            *self = *other;
            return;
        }
        let radius = 0.5 * (distance + self.radius + other.radius);
        self.center += way * ((radius - self.radius) / distance);
        self.radius = radius;
    }
}

/// Where the derivatives of a surface are over a rectangle of parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spread {
    pub(in crate::tessellate) du: Ball,
    pub(in crate::tessellate) dv: Ball,
    pub(in crate::tessellate) duu: Ball,
    pub(in crate::tessellate) duv: Ball,
    pub(in crate::tessellate) dvv: Ball,
}

impl Spread {
    /// Becomes where the derivatives are over two rectangles.
    pub(super) fn include(&mut self, other: &Self) {
        self.du.include(&other.du);
        self.dv.include(&other.dv);
        self.duu.include(&other.duu);
        self.duv.include(&other.duv);
        self.dvv.include(&other.dvv);
    }

    /// The second directional derivative along `d`, which is a parameter step within a rectangle
    /// of the proportions `size`: a mean, and by how much it strays from that, a quadratic form in
    /// `d`.
    fn along(&self, d: DVec2, size: DVec2) -> (DVec3, f64) {
        let mean = self.duu.center * (d.x * d.x)
            + self.duv.center * (2.0 * d.x * d.y)
            + self.dvv.center * (d.y * d.y);
        let aspect = if size.x > 0.0 && size.y > 0.0 {
            size.y / size.x
        } else {
            1.0
        };
        let mixed = self.duv.radius * (aspect * d.x * d.x + d.y * d.y / aspect);
        let stray = self.duu.radius * d.x * d.x + mixed + self.dvv.radius * d.y * d.y;
        (mean, stray)
    }

    /// How far a step in parameters leads, at most.
    pub(in crate::tessellate) fn step(&self, d: DVec2) -> f64 {
        let center = self.du.center * d.x + self.dv.center * d.y;
        center.length() + self.du.radius * d.x.abs() + self.dv.radius * d.y.abs()
    }

    /// The largest second derivative along an axis.
    pub(in crate::tessellate) fn second(&self, axis: usize) -> f64 {
        [self.duu, self.dvv][axis].reach()
    }

    /// How far the surface over a triangle of the rectangle is from the flat triangle with
    /// the same corners, at the same parameters.
    pub(super) fn triangle(&self, [a, b, c]: [DVec2; 3], size: DVec2) -> f64 {
        let sides = [a - b, b - c, c - a].map(|d| self.along(d, size));
        over_triangle(sides.map(|side| side.0), sides.map(|side| side.1))
    }

    /// As [`Spread::triangle`] for any triangle in a rectangle of this size over which first
    /// derivatives jump: by what they differ from their middle, at most, over all of it.
    pub(in crate::tessellate) fn bent(&self, size: DVec2) -> f64 {
        self.du.radius * size.x + self.dv.radius * size.y
    }

    /// How far the surface over the segment along `d` is from the chord.
    pub(in crate::tessellate) fn chord(&self, d: DVec2, size: DVec2) -> f64 {
        let (mean, stray) = self.along(d, size);
        (mean.length() + stray) / 8.0
    }
}

/// How far a surface is from a flat triangle with the same corners at most, at the same parameters,
/// with second derivatives along the three sides that are no farther from `means` than `strays`.
///
/// With `l` the barycentric coordinates of a point, the difference there is half of the sum of
/// `l_i l_j` times the derivatives along the sides: Taylor's formula about the point, of which the
/// constant part is an identity and the rest a quadratic form. On a saddle what the sides add has
/// opposite signs: along the longest of them it is taken with its sign.
fn over_triangle(means: [DVec3; 3], strays: [f64; 3]) -> f64 {
    let lengths = means.map(DVec3::length);
    let sum = |values: [f64; 3]| [0, 1, 2].map(|k| values[k] + strays[k]);
    let plain = highest(sum(lengths));
    let [x, y, z] = means;
    if x.dot(y).min(y.dot(z)).min(z.dot(x)) >= 0.0 {
        return plain;
    }
    let longest = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j]));
    let axis = means[longest.unwrap_or(0)].normalize_or_zero();
    let heights = means.map(|mean| mean.dot(axis));
    let aside = sum([0, 1, 2].map(|k| (means[k] - axis * heights[k]).length()));
    let side = |sign: f64| highest([0, 1, 2].map(|k| aside[k] + sign * heights[k]));
    plain.min(side(1.0).max(side(-1.0)))
}

/// The greatest value over a triangle of half the sum of `l_i l_j` times what is given for its sides.
pub(in crate::tessellate) fn highest([x, y, z]: [f64; 3]) -> f64 {
    let longest = x.max(y).max(z);
    let others = x + y + z - longest;
    if longest >= others {
        return longest.max(0.0) / 8.0;
    }
    // Half the squared radius of the circle around a triangle with these squared sides.
    let product = if longest <= x {
        y * z
    } else if longest <= y {
        x * z
    } else {
        x * y
    };
    let excess = others - longest;
    0.5 * longest / (4.0 - excess * excess / product)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How far a surface with constant second derivatives is from the flat triangle, by samples.
    fn sampled(spread: &Spread, corners: [DVec2; 3]) -> f64 {
        let height = |p: DVec2| {
            0.5 * spread.duu.center * (p.x * p.x)
                + spread.duv.center * (p.x * p.y)
                + 0.5 * spread.dvv.center * (p.y * p.y)
        };
        let mut most = 0.0_f64;
        for i in 0..=60 {
            for j in 0..=60 - i {
                let shares = [i, j, 60 - i - j].map(|k| f64::from(k) / 60.0);
                let (mut uv, mut flat) = (DVec2::ZERO, DVec3::ZERO);
                for (share, corner) in shares.into_iter().zip(corners) {
                    uv += corner * share;
                    flat += height(corner) * share;
                }
                most = most.max(height(uv).distance(flat));
            }
        }
        most
    }

    #[test]
    fn a_triangle_on_a_saddle_counts_with_the_signs_of_its_sides() {
        let ball = |center| Ball {
            center,
            radius: 0.0,
        };
        let of = |duu, duv, dvv| Spread {
            duu: ball(duu),
            duv: ball(duv),
            dvv: ball(dvv),
            ..Spread::default()
        };
        // The largest triangle within one of a saddle: rows are as far apart as the root of ten.
        let widest = [
            DVec2::ZERO,
            DVec2::new(8.0_f64.sqrt(), 0.0),
            DVec2::new(2.0_f64.sqrt(), 10.0_f64.sqrt()),
        ];
        let saddle = of(DVec3::Z, DVec3::ZERO, DVec3::NEG_Z);
        let bound = saddle.triangle(widest, DVec2::ONE);
        assert!((bound - 1.0).abs() < 1e-12, "{bound}");
        let mut rng = fastrand::Rng::with_seed(3);
        let (mut exact, count) = (0, 1000);
        for _ in 0..count {
            let mut vector = || DVec3::new(rng.f64(), rng.f64(), rng.f64()) - 0.5;
            let spread = of(vector(), vector(), vector());
            let corners = [vector(), vector(), vector()].map(DVec3::truncate);
            let (bound, found) = (
                spread.triangle(corners, DVec2::ONE),
                sampled(&spread, corners),
            );
            assert!(found <= bound * (1.0 + 1e-12), "{found} {bound}");
            exact += usize::from(found > 0.8 * bound);
        }
        assert!(exact > count * 3 / 4, "{exact} of {count}");
    }
}
