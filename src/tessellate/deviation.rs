//! How far triangles are from the surface, measured.

use glam::{DVec2, DVec3};
use kernel::BezierSurface;

use super::cone::Cone;
use super::net::share;
use super::pieces::{Pieces, Rect};
use super::rim::Face;
use crate::simd::{Simd, Task};

/// Points along a side of a triangle, less one.
const SIDE: usize = 4;

/// Samples that are evaluated side by side.
const GROUP: usize = 8;

/// How many groups there are.
const GROUPS: usize = 2;

/// How many samples differ.
const DISTINCT: usize = 13;

/// Points on a triangle, as shares of its corners: 12 spread over it and its sides, and the middle,
/// which fills what is left.
const SAMPLES: [[f64; 3]; GROUPS * GROUP] = samples();

/// The same of each group side by side.
const SHARES: [[[f64; GROUP]; 3]; GROUPS] = shares();

/// Points along a side of the nets that are evaluated side by side, at most.
const ROOM: usize = 10;

const fn samples() -> [[f64; 3]; GROUPS * GROUP] {
    let mut samples = [[1.0 / 3.0; 3]; GROUPS * GROUP];
    let (mut next, mut i) = (0, 0);
    while i < SIDE {
        let mut j = 0;
        while j < SIDE && i + j <= SIDE {
            let k = SIDE - i - j;
            if k < SIDE {
                let side = SIDE as f64;
                samples[next] = [i as f64 / side, j as f64 / side, k as f64 / side];
                next += 1;
            }
            j += 1;
        }
        i += 1;
    }
    samples
}

const fn shares() -> [[[f64; GROUP]; 3]; GROUPS] {
    let mut shares = [[[0.0; GROUP]; 3]; GROUPS];
    let mut k = 0;
    while k < 3 * GROUPS * GROUP {
        let (number, corner) = (k / 3, k % 3);
        shares[number / GROUP][corner][number % GROUP] = SAMPLES[number][corner];
        k += 1;
    }
    shares
}

/// The largest distance, at sample points that are no corners, between a triangle and the surface
/// at the parameters that belong to them.
pub(super) fn triangle(pieces: &Pieces<'_>, uvs: [DVec2; 3], corners: [DVec3; 3]) -> f64 {
    let flat = |[a, b, c]: [f64; 3]| corners[0] * a + corners[1] * b + corners[2] * c;
    if let Some(round) = &pieces.round {
        let off = |&shares: &[f64; 3]| round.distance(flat(shares));
        return SAMPLES[..DISTINCT].iter().map(off).fold(0.0, f64::max);
    }
    let piece = pieces.piece_around(&Rect::around(uvs));
    let fits = |piece: &&BezierSurface| piece.degree_u().max(piece.degree_v()) < ROOM;
    let Some(piece) = piece.filter(fits) else {
        let off = |&shares: &[f64; 3]| {
            let uv = pieces.place(uvs, shares);
            pieces.surface.evaluate(uv).distance(flat(shares))
        };
        return SAMPLES[..DISTINCT].iter().map(off).fold(0.0, f64::max);
    };
    let distances = Distances {
        piece,
        cone: pieces.cone.as_ref().filter(|cone| cone.narrows()),
        uvs,
        corners,
    };
    pieces.instructions().run(distances).sqrt()
}

/// How far a point of a triangle, with these shares of its corners, is from the surface at the parameters that
/// belong to it.
pub(crate) fn at(face: &Face<'_>, uvs: [DVec2; 3], corners: [DVec3; 3], shares: [f64; 3]) -> f64 {
    let flat = corners[0] * shares[0] + corners[1] * shares[1] + corners[2] * shares[2];
    face.point(face.pieces.place(uvs, shares)).distance(flat)
}

/// The task to find the square of the largest distance between sample points of a triangle and the places
/// of a piece that belong to them.
struct Distances<'a> {
    piece: &'a BezierSurface,
    cone: Option<&'a Cone>,
    uvs: [DVec2; 3],
    corners: [DVec3; 3],
}

impl Task for Distances<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> f64 {
        // Loops of known length are several times faster.
        match self.piece.degree_v() {
            1 => self.most::<2>(2),
            2 => self.most::<3>(3),
            3 => self.most::<4>(4),
            q => self.most::<ROOM>(q + 1),
        }
    }
}

impl Distances<'_> {
    /// With nets of as many points a row, at most `ROW`.
    #[inline(always)]
    fn most<const ROW: usize>(self, row: usize) -> f64 {
        let net = self.piece.homogeneous();
        let p = self.piece.degree_u();
        let mut most = [0.0_f64; GROUP];
        for group in 0..GROUPS {
            let [u, v] = self.places(group);
            let along_u: [_; ROOM] = basis(p, &u);
            let along_v: [_; ROW] = basis(row - 1, &v);
            let mut sum = [[0.0; GROUP]; 4];
            for (points, share) in net.chunks_exact(row).zip(&along_u) {
                let mut row = [[0.0; GROUP]; 4];
                for (point, share) in points.iter().zip(&along_v) {
                    for axis in 0..4 {
                        for lane in 0..GROUP {
                            row[axis][lane] += point[axis] * share[lane];
                        }
                    }
                }
                for axis in 0..4 {
                    for lane in 0..GROUP {
                        sum[axis][lane] += row[axis][lane] * share[lane];
                    }
                }
            }
            let mut square = [0.0; GROUP];
            for axis in 0..3 {
                let flat = mixed(group, self.corners.map(|corner| corner[axis]));
                for lane in 0..GROUP {
                    let off = sum[axis][lane] / sum[3][lane] - flat[lane];
                    square[lane] += off * off;
                }
            }
            for lane in 0..GROUP {
                most[lane] = most[lane].max(square[lane]);
            }
        }
        most.into_iter().fold(0.0, f64::max)
    }

    /// Where in the piece the places of a group of samples are, as shares of its ranges.
    #[inline(always)]
    fn places(&self, group: usize) -> [[f64; GROUP]; 2] {
        let ranges = [self.piece.u(), self.piece.v()];
        let mut places = [0, 1].map(|axis| mixed(group, self.uvs.map(|uv| uv[axis])));
        if let Some(cone) = self.cone {
            for (lane, shares) in SAMPLES[group * GROUP..][..GROUP].iter().enumerate() {
                let uv = cone.place(self.uvs, *shares);
                (places[0][lane], places[1][lane]) = (uv.x, uv.y);
            }
        }
        for (places, range) in places.iter_mut().zip(&ranges) {
            for place in places {
                *place = share(*place, range);
            }
        }
        places
    }
}

/// What samples of a group have of a quantity that the corners have.
#[inline(always)]
fn mixed(group: usize, [a, b, c]: [f64; 3]) -> [f64; GROUP] {
    let [x, y, z] = &SHARES[group];
    let mut mixed = [0.0; GROUP];
    for lane in 0..GROUP {
        mixed[lane] = a * x[lane] + b * y[lane] + c * z[lane];
    }
    mixed
}

/// The Bernstein polynomials of a degree at some places, zero beyond.
#[inline(always)]
fn basis<const ROOM: usize>(degree: usize, places: &[f64; GROUP]) -> [[f64; GROUP]; ROOM] {
    let mut basis = [[0.0; GROUP]; ROOM];
    basis[0] = [1.0; GROUP];
    for d in 1..=degree.min(ROOM - 1) {
        let mut saved = [0.0; GROUP];
        for value in &mut basis[..d] {
            for lane in 0..GROUP {
                let (own, rises) = (value[lane], places[lane]);
                value[lane] = saved[lane] + own * (1.0 - rises);
                saved[lane] = own * rises;
            }
        }
        basis[d] = saved;
    }
    basis
}

#[cfg(test)]
mod tests {
    use kernel::{KnotVector, Surface};

    use super::*;

    #[test]
    fn pieces_and_the_whole_surface_are_equally_far() {
        let mut rng = fastrand::Rng::with_seed(5);
        for [p, q] in [[1, 1], [2, 1], [1, 3], [3, 2], [3, 3], [6, 3], [2, 5]] {
            let count = (p + 2) * (q + 2);
            let mut point = || DVec3::new(rng.f64(), rng.f64(), rng.f64());
            let points: Vec<DVec3> = (0..count).map(|_| point()).collect();
            let weights: Vec<f64> = (0..count).map(|_| 0.3 + rng.f64()).collect();
            let knots = |d| KnotVector::clamped_uniform(d, d + 2, 1.0..3.0).unwrap();
            let surface = Surface::new(knots(p), knots(q), &points, Some(&weights)).unwrap();
            let pieces = Pieces::new(&surface);
            // Inside of a piece, and over the break between two.
            for start in [1.1, 1.8] {
                let from = DVec2::new(start, 2.1);
                let uvs = [from, from + 0.7 * DVec2::X, from + 0.3 * DVec2::Y];
                let corners = uvs.map(|uv| surface.evaluate(uv));
                let found = triangle(&pieces, uvs, corners);
                let most = SAMPLES.iter().map(|&[a, b, c]| {
                    let uv = uvs[0] * a + uvs[1] * b + uvs[2] * c;
                    let flat = corners[0] * a + corners[1] * b + corners[2] * c;
                    surface.evaluate(uv).distance(flat)
                });
                let most = most.fold(0.0, f64::max);
                assert!((found - most).abs() <= 1e-14, "{found} for {most}");
            }
        }
    }

    #[test]
    fn samples_are_distinct_and_none_is_a_corner() {
        for (number, sample) in SAMPLES[..DISTINCT].iter().enumerate() {
            assert!((sample.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!(sample.iter().all(|share| *share < 1.0));
            assert!(!SAMPLES[..number].contains(sample));
        }
    }
}
