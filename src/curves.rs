//! Curves and points drawn over a picture, as thin tubes and small balls.
//!
//! They have no area, so no ray meets them; each gets a radius in pixels instead.

use glam::{DVec2, DVec3};
use kernel::{Camera, Curve, Material, Scene, WireShape};

use crate::film::Film;
use crate::render::Eye;

/// Radii in pixels.
const TUBE: f64 = 1.25;
const BALL: f64 = 2.5;

/// How far what is drawn may stray from a curve, in pixels.
const STRAY: f64 = 0.05;

/// How often a part of a curve is halved at most.
const HALVINGS: u32 = 14;

/// Draws all curves and points of the scene that no surface hides, where the depths of the film
/// tell. The data channels stay those of the surfaces.
///
/// Curves are followed to within a twentieth of a pixel.
#[must_use]
pub fn draw_curves(film: Film, scene: &Scene, camera: &Camera) -> Film {
    let mut brush = Brush {
        eye: Eye::new(camera, film.width() as usize, film.height() as usize),
        ink: vec![Ink::default(); film.colors().len()],
        film,
        radius: TUBE,
        color: Material::THIN,
    };
    for placement in scene.wire_placements() {
        let wire = scene.wire(placement.wire);
        let own = |id| scene.material(id).flat();
        brush.color = wire.material.map_or(Material::THIN, own);
        match &wire.shape {
            WireShape::Curve(curve) => {
                brush.radius = TUBE;
                brush.curve(&curve.transformed(&placement.world_from_object));
            }
            WireShape::Points(points) => {
                brush.radius = BALL;
                for &point in points {
                    let spot = brush.spot(placement.world_from_object.transform_point3(point));
                    brush.stroke(spot, spot);
                }
            }
        }
    }
    brush.finish()
}

/// What is drawn at a pixel.
#[derive(Clone, Copy, Default)]
struct Ink {
    coverage: f64,
    color: DVec3,
}

/// A point as it is seen.
#[derive(Clone, Copy)]
struct Spot {
    /// In pixels from the upper left.
    place: DVec2,
    depth: f64,
}

struct Brush<'a> {
    eye: Eye<'a>,
    film: Film,
    ink: Vec<Ink>,
    radius: f64,
    color: DVec3,
}

impl Brush<'_> {
    fn spot(&self, point: DVec3) -> Spot {
        let (place, depth) = self.eye.project(point);
        Spot { place, depth }
    }

    fn curve(&mut self, curve: &Curve<DVec3>) {
        // Where the middle lies on the chord, halves may still bend to both sides.
        let parts = u32::try_from(2 * curve.degree()).unwrap_or(u32::MAX);
        for piece in curve.bezier_pieces() {
            let domain = piece.domain();
            let at = |k: u32| {
                let share = f64::from(k) / f64::from(parts);
                domain.start + (domain.end - domain.start) * share
            };
            for k in 0..parts {
                let ends = [at(k), at(k + 1)];
                let spots = ends.map(|t| self.spot(piece.evaluate(t)));
                self.part(&piece, ends, spots, HALVINGS);
            }
        }
    }

    /// Draws the curve between two parameters.
    fn part(&mut self, curve: &Curve<DVec3>, [a, b]: [f64; 2], [p, q]: [Spot; 2], left: u32) {
        let t = f64::midpoint(a, b);
        let middle = self.spot(curve.evaluate(t));
        let spots = [p, middle, q];
        if self.is_outside(&spots) {
            return;
        }
        let in_front = spots.iter().all(|spot| spot.depth > 0.0);
        let stray = middle
            .place
            .distance(nearest(middle.place, p.place, q.place).0);
        if left > 0 && !(in_front && stray <= STRAY) {
            self.part(curve, [a, t], [p, middle], left - 1);
            self.part(curve, [t, b], [middle, q], left - 1);
        } else if in_front {
            self.stroke(p, middle);
            self.stroke(middle, q);
        }
    }

    /// Whether all of these are behind the camera, or beyond one side of the film.
    fn is_outside(&self, spots: &[Spot]) -> bool {
        let size = self.size();
        let all = |test: &dyn Fn(&Spot) -> bool| spots.iter().all(test);
        let behind = |spot: &Spot| spot.depth <= 0.0;
        if spots.iter().any(behind) {
            return all(&behind);
        }
        let margin = self.radius + 1.0;
        all(&|s| s.place.x < -margin)
            || all(&|s| s.place.y < -margin)
            || all(&|s| s.place.x > size.x + margin)
            || all(&|s| s.place.y > size.y + margin)
    }

    fn size(&self) -> DVec2 {
        DVec2::new(f64::from(self.film.width()), f64::from(self.film.height()))
    }

    /// Draws a straight tube, or a ball where both ends are one.
    fn stroke(&mut self, p: Spot, q: Spot) {
        if p.depth <= 0.0 || q.depth <= 0.0 || !(p.place + q.place).is_finite() {
            return;
        }
        let reach = self.radius + 0.5;
        let last = self.size() - 1.0;
        let low = (p.place.min(q.place) - reach).floor().max(DVec2::ZERO);
        let high = (p.place.max(q.place) + reach).floor().min(last);
        let mut y = low.y;
        while y <= high.y {
            let mut x = low.x;
            while x <= high.x {
                self.dab(DVec2::new(x, y), p, q);
                x += 1.0;
            }
            y += 1.0;
        }
    }

    /// Draws what covers one pixel.
    fn dab(&mut self, corner: DVec2, p: Spot, q: Spot) {
        let center = corner + 0.5;
        let (axis, share) = nearest(center, p.place, q.place);
        let distance = center.distance(axis);
        let coverage = (self.radius + 0.5 - distance).clamp(0.0, 1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "inside the film"
        )]
        let index = corner.y as usize * self.film.width() as usize + corner.x as usize;
        if coverage <= self.ink[index].coverage {
            return;
        }
        // In perspective it is one over the depth that runs evenly along the picture.
        let depth = if self.eye.is_parallel() {
            p.depth + (q.depth - p.depth) * share
        } else {
            1.0 / ((1.0 - share) / p.depth + share / q.depth)
        };
        // Curves on surfaces that are seen from the side stand out, too.
        let front = depth - 2.0 * self.radius * self.eye.pixel(depth);
        let surface = self.film.data().get(index);
        if surface.is_some_and(|data| front > f64::from(data.depth)) {
            return;
        }
        let across = (distance / self.radius).min(1.0);
        let light = 0.6 + 0.4 * (1.0 - across * across).sqrt();
        self.ink[index] = Ink {
            coverage,
            color: self.color * light,
        };
    }

    /// The film with all that is drawn.
    #[expect(clippy::cast_possible_truncation, reason = "film is single precision")]
    fn finish(mut self) -> Film {
        for (pixel, ink) in self.film.colors_mut().iter_mut().zip(&self.ink) {
            let through = (1.0 - ink.coverage) as f32;
            let drawn = (ink.color * ink.coverage).extend(ink.coverage).as_vec4();
            for (c, ink) in pixel.iter_mut().zip(drawn.to_array()) {
                *c = *c * through + ink;
            }
        }
        self.film
    }
}

/// The point of a segment that is nearest to `p`, and its share of the way from `a` to `b`.
fn nearest(p: DVec2, a: DVec2, b: DVec2) -> (DVec2, f64) {
    let way = b - a;
    let share = (p - a).dot(way) / way.length_squared();
    let share = if share.is_finite() {
        share.clamp(0.0, 1.0)
    } else {
        0.0
    };
    (a + way * share, share)
}

#[cfg(test)]
mod tests {
    use kernel::{KnotVector, Node, Projection, Wire};

    use super::*;
    use crate::film::PixelData;

    /// A circle of radius one, exactly, around the axis of view, and a point in its middle.
    fn circle() -> Scene {
        let (mut points, mut weights) = (Vec::new(), Vec::new());
        for k in 0..9 {
            let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_4).sin_cos();
            let far = if k % 2 == 0 { 1.0 } else { 2.0_f64.sqrt() };
            points.push(DVec3::new(cos, sin, 0.0) * far);
            weights.push(1.0 / far);
        }
        let knots = [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0];
        let knots = KnotVector::new(2, knots.to_vec()).unwrap();
        let curve = Curve::new(knots, &points, Some(&weights)).unwrap();
        let mut scene = Scene::default();
        let shapes = [
            WireShape::Curve(curve),
            WireShape::Points(vec![DVec3::ZERO]),
        ];
        let wires = shapes.map(|shape| {
            let wire = Wire {
                name: String::new(),
                source: String::new(),
                shape,
                material: None,
            };
            scene.add_wire(wire).unwrap()
        });
        let root = scene.add_node(Node {
            wires: wires.to_vec(),
            ..Node::default()
        });
        scene.set_root(root.unwrap()).unwrap();
        scene
    }

    #[test]
    fn a_circle_is_a_ring_of_even_width() {
        let scene = circle();
        for projection in [
            Projection::Orthographic { extent: 4.0 },
            Projection::Perspective {
                vertical_fov: 2.0 * 0.4_f64.atan(),
            },
        ] {
            // A hundred pixels are four units, at five units from the camera.
            let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, projection);
            let film = draw_curves(Film::new(120, 100), &scene, &camera.unwrap());
            for (k, color) in film.colors().iter().enumerate() {
                let center = DVec2::new((k % 120) as f64, (k / 120) as f64) + 0.5;
                let far = center.distance(DVec2::new(60.0, 50.0));
                let expected = (TUBE + 0.5 - (far - 25.0).abs())
                    .max(BALL + 0.5 - far)
                    .clamp(0.0, 1.0);
                assert!(
                    (f64::from(color[3]) - expected).abs() < 2.0 * STRAY,
                    "{center}"
                );
            }
        }
    }

    #[test]
    fn surfaces_in_front_hide_curves() {
        let scene = circle();
        let view = Projection::Orthographic { extent: 4.0 };
        let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, view).unwrap();
        let coverage = |depth: f32| -> f32 {
            let mut film = Film::with_data(100, 100);
            film.data_mut().fill(PixelData {
                depth,
                ..PixelData::MISS
            });
            let film = draw_curves(film, &scene, &camera);
            film.colors().iter().map(|color| color[3]).sum()
        };
        assert!(coverage(4.5) <= 0.0);
        assert!((coverage(5.0) - coverage(PixelData::FAR)).abs() < 1e-3);
    }
}
