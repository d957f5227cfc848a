//! What closes the ends of tubes.

use glam::{DVec2, DVec3};

use super::layers::area;
use super::{check_positive, plane, ruled};
use crate::{Curve, Error, KnotVector, Patch, Surface, TrimLoop};

/// A rim is flat if it strays from its plane at most by this share of its size.
const FLAT: f64 = 1e-9;

/// The plane of a flat cap reaches beyond its rim by this share of its size.
const MARGIN: f64 = 0.01;

/// How far the control points of a quarter of a circle are along its tangents.
const QUARTER: f64 = 0.552_284_749_830_793_4;

/// Places of each piece of a rim where it is asked whether its middle sees it.
const SAMPLES: u32 = 8;

/// What closes an end of a tube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cap {
    /// The plane inside the rim, or straight lines to its middle if it is not flat.
    Flat,
    /// A dome of this height that begins along the tube and ends level.
    Rounded {
        /// How far its top is above the middle of the rim.
        height: f64,
    },
}

/// An end of a tube along v.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TubeEnd {
    /// Where v begins.
    Start,
    /// Where v ends.
    End,
}

/// The face that closes a tube, closed along u with its normals outwards, at one of its ends. Its
/// normal points outwards, too.
///
/// The rim of the tube is that of the face: to the last bit for domes, and up to rounding for
/// planes.
///
/// # Errors
/// If a height is not positive, the rim has no area, the middle of a rim that is not flat or
/// gets a dome does not see it all, or the tube is rational.
pub fn cap(tube: &Surface, end: TubeEnd, cap: Cap) -> Result<Patch, Error> {
    let v = tube.knots_v().domain();
    // Seen from outside, rims run counter-clockwise.
    let tube = match end {
        TubeEnd::Start => tube.reversed_u().reversed_v(),
        TubeEnd::End => tube.clone(),
    };
    let u = tube.knots_u().domain();
    let tube = tube.restricted_u(u)?.restricted_v(v.clone())?;
    let rim = Rim::new(&tube, v.end)?;
    match cap {
        Cap::Flat if rim.is_flat() => rim.flat(),
        Cap::Flat => {
            rim.check_star()?;
            let middle = vec![rim.middle; rim.points.len()];
            let middle = Curve::new(rim.curve.knots().clone(), &middle, None)?;
            Ok(ruled(&rim.curve, &middle)?.into())
        }
        Cap::Rounded { height } => {
            check_positive(height)?;
            rim.check_star()?;
            rim.dome(&tube, height)
        }
    }
}

/// The end of a tube, counter-clockwise about the direction outwards.
struct Rim {
    curve: Curve<DVec3>,
    points: Vec<DVec3>,
    middle: DVec3,
    outwards: DVec3,
    size: f64,
}

impl Rim {
    fn new(tube: &Surface, end: f64) -> Result<Self, Error> {
        if tube.is_rational() {
            return Err(Error::Singular);
        }
        let curve = tube.iso_curve_v(end);
        let points: Vec<DVec3> = curve.points().collect();
        let area = area(&points);
        let middle = points.iter().skip(1).sum::<DVec3>() / (points.len() - 1) as f64;
        let outwards = area.try_normalize().ok_or(Error::NoDirection)?;
        let size = points
            .iter()
            .map(|p| p.distance(middle))
            .fold(0.0, f64::max);
        Ok(Self {
            curve,
            points,
            middle,
            outwards,
            size,
        })
    }

    fn is_flat(&self) -> bool {
        let height = |p: &DVec3| (p - self.middle).dot(self.outwards).abs();
        self.points.iter().all(|p| height(p) <= FLAT * self.size)
    }

    /// Refuses rims that turn back as seen from the middle.
    fn check_star(&self) -> Result<(), Error> {
        for pair in self.curve.knots().breaks().windows(2) {
            for k in 0..SAMPLES {
                let share = (f64::from(k) + 0.5) / f64::from(SAMPLES);
                let d = self
                    .curve
                    .derivatives(pair[0] + (pair[1] - pair[0]) * share);
                let turn = (d.point - self.middle).cross(d.first).dot(self.outwards);
                if turn.is_nan() || turn <= 0.0 {
                    return Err(Error::NotStarShaped);
                }
            }
        }
        Ok(())
    }

    /// The plane inside.
    fn flat(&self) -> Result<Patch, Error> {
        let x = self.outwards.any_orthonormal_vector();
        let y = self.outwards.cross(x);
        let flat = |p: &DVec3| DVec2::new((p - self.middle).dot(x), (p - self.middle).dot(y));
        let points: Vec<DVec2> = self.points.iter().map(flat).collect();
        let margin = DVec2::splat(self.size * MARGIN);
        let least = points
            .iter()
            .copied()
            .reduce(DVec2::min)
            .unwrap_or_default()
            - margin;
        let most = points
            .iter()
            .copied()
            .reduce(DVec2::max)
            .unwrap_or_default()
            + margin;
        let corner = self.middle + x * least.x + y * least.y;
        let (across, up) = (x * (most.x - least.x), y * (most.y - least.y));
        let surface = plane(corner, across, up, least.x..most.x, least.y..most.y)?;
        let rim = Curve::new(self.curve.knots().clone(), &points, None)?;
        let gap = rim.start().distance(rim.end());
        let trim = TrimLoop::new(vec![rim], gap)?;
        Ok(Patch {
            loops: vec![trim],
            ..surface.into()
        })
    }

    /// A surface from the rim to a point above its middle.
    fn dome(&self, tube: &Surface, height: f64) -> Result<Patch, Error> {
        let count = tube.knots_v().count();
        let points: Vec<DVec3> = tube.points().collect();
        let slopes: Vec<DVec3> = points
            .chunks_exact(count)
            .map(|row| row[count - 1] - row[count - 2])
            .collect();
        let rise = slopes.iter().map(|s| s.dot(self.outwards)).sum::<f64>() / slopes.len() as f64;
        let top = self.middle + self.outwards * height;
        let level = |way: DVec3| way - self.outwards * way.dot(self.outwards);
        let rows: Vec<[DVec3; 3]> = (self.points.iter().zip(slopes))
            .map(|(rim, slope)| {
                let up = if rise > 0.0 {
                    slope / rise
                } else {
                    self.outwards
                };
                [*rim, level(rim - self.middle), up]
            })
            .collect();
        // Walls that lean inwards go on as far as the next row is outside of the one after it.
        let room = rows.iter().map(|[_, across, up]| {
            let inwards = -level(*up).dot(*across);
            if inwards > 0.0 {
                (1.0 - QUARTER) * across.length_squared() / inwards
            } else {
                f64::INFINITY
            }
        });
        let step = room.fold(height * QUARTER, f64::min);
        let net: Vec<DVec3> = rows
            .iter()
            .flat_map(|[rim, across, up]| [*rim, rim + up * step, top + across * QUARTER, top])
            .collect();
        let knots_v = KnotVector::bezier(3, 0.0..1.0)?;
        let surface = Surface::new(self.curve.knots().clone(), knots_v, &net, None)?;
        Ok(surface.into())
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;
    use crate::Integrals;
    use crate::modelling::loft;

    /// A round tube of height 2 and radius 1, lofted.
    fn tube() -> Vec<Surface> {
        let ring = |k: u32| {
            let point = |j: u32| DVec2::from_angle(TAU * f64::from(j) / 48.0);
            (0..48).map(|j| point(j).extend(f64::from(k))).collect()
        };
        loft(&(0..3).map(ring).collect::<Vec<_>>()).unwrap()
    }

    fn body(kind: Cap) -> Integrals {
        let strips = tube();
        let caps = [
            cap(&strips[0], TubeEnd::Start, kind).unwrap(),
            cap(&strips[1], TubeEnd::End, kind).unwrap(),
        ];
        let faces = strips.into_iter().map(Patch::from).chain(caps);
        let each = faces.map(|face| Integrals::of(&face, DVec3::new(0.3, 0.1, 0.7)));
        each.fold(Integrals::default(), |sum, face| sum.plus(&face, 1.0))
    }

    #[test]
    fn caps_close_bodies() {
        let flat = body(Cap::Flat);
        assert!(flat.normal().length() < 1e-12, "{:?}", flat.normal());
        assert!(
            (flat.volume() / TAU - 1.0).abs() < 2e-5,
            "{}",
            flat.volume()
        );
        // Two halves of a sphere, about.
        let round = body(Cap::Rounded { height: 1.0 });
        assert!(round.normal().length() < 1e-12);
        let expected = TAU + 4.0 / 3.0 * PI;
        assert!(
            (round.volume() / expected - 1.0).abs() < 1e-3,
            "{}",
            round.volume()
        );
    }

    #[test]
    fn domes_begin_along_the_tube() {
        let strips = tube();
        let dome = cap(&strips[1], TubeEnd::End, Cap::Rounded { height: 0.4 }).unwrap();
        for k in 0..=100 {
            let u = f64::from(k) / 100.0;
            let side = strips[1].derivatives(DVec2::new(u, 2.0));
            let dome = dome.surface.derivatives(DVec2::new(u, 0.0));
            assert!(side.point.distance(dome.point) < 1e-13);
            let [a, b] = [side, dome].map(|d| d.du.cross(d.dv).normalize());
            assert!(a.distance(b) < 1e-10);
        }
    }

    #[test]
    fn domes_over_walls_that_lean_inwards_keep_to_their_side() {
        // A cone up to a tenth of its radius.
        let ring = |radius: f64, z: f64| {
            let point = |j: u32| DVec2::from_angle(TAU * f64::from(j) / 48.0) * radius;
            (0..48).map(|j| point(j).extend(z)).collect()
        };
        let strips = loft(&[ring(1.0, 0.0), ring(0.1, 1.0)]).unwrap();
        for height in [0.02, 0.1, 1.0, 1e3] {
            let dome = cap(&strips[0], TubeEnd::End, Cap::Rounded { height }).unwrap();
            for k in 0..100 {
                let (u, v) = (f64::from(k % 10) / 10.0, f64::from(k / 10) / 10.0);
                let start = dome.surface.evaluate(DVec2::new(u, 0.0));
                let found = dome.surface.evaluate(DVec2::new(u, v));
                assert!(
                    found.truncate().dot(start.truncate()) > 0.0,
                    "{height} {u} {v}"
                );
                let before = dome.surface.evaluate(DVec2::new(u, (v - 0.05).max(0.0)));
                assert!(found.z >= before.z, "{height} {u} {v}");
            }
            // It begins along the wall.
            let d = dome.surface.derivatives(DVec2::new(0.3, 0.0));
            let radial = d.point.truncate().normalize();
            let lean = d.dv.truncate().dot(radial) / d.dv.z;
            assert!((lean + 0.9).abs() < 1e-2, "{lean}");
        }
    }

    #[test]
    fn rims_that_turn_back_take_a_flat_cap_only() {
        // A sickle: two arcs about one middle.
        let arc = |radius: f64, from: f64, to: f64| {
            let angle = move |k: u32| from + (to - from) * f64::from(k) / 30.0;
            (0..30).map(move |k| DVec2::from_angle(angle(k)) * radius)
        };
        let ring = |z: f64| {
            let outer = arc(1.0, -2.0, 2.0);
            outer
                .chain(arc(0.8, 2.0, -2.0))
                .map(|p| p.extend(z))
                .collect()
        };
        let strips = loft(&[ring(0.0), ring(1.0)]).unwrap();
        let dome = cap(&strips[0], TubeEnd::End, Cap::Rounded { height: 1.0 });
        assert_eq!(dome, Err(Error::NotStarShaped));
        let flat = cap(&strips[0], TubeEnd::End, Cap::Flat).unwrap();
        let area = Integrals::of(&flat, DVec3::ZERO).area();
        let expected = 2.0 * (1.0 - 0.64);
        assert!((area / expected - 1.0).abs() < 0.02, "{area}");
        assert!(cap(&strips[0], TubeEnd::End, Cap::Rounded { height: 0.0 }).is_err());
    }
}
