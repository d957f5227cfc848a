//! Surfaces at their places, cut into Bézier pieces, and the camera that looks at them.

use glam::{DVec2, DVec3};
use kernel::{Aabb, BezierSurface, Camera, Patch, Ray, Scene, Shape, Surface, TrimRegion};

use super::{ACCURACY, Counts};
use crate::intersect::net::{Degrees, evaluate_points};
use crate::render::FilmRays;

/// All surfaces of a scene in the world; those shown many times stand here as often.
#[derive(Debug)]
pub(super) struct World {
    pub(super) sheets: Vec<Sheet>,
    pub(super) pieces: Vec<Piece>,
    /// The nets `(w P, w)` of all pieces.
    points: Vec<[f64; 4]>,
    /// What belongs to each patch of the scene, if not all of its surface.
    regions: Vec<Option<TrimRegion>>,
}

/// A surface at its place.
#[derive(Debug)]
pub(super) struct Sheet {
    /// Number as in [`crate::Hit::shape`].
    pub(super) number: u32,
    pub(super) surface: Surface,
    pub(super) start: DVec2,
    pub(super) size: DVec2,
    patch: usize,
    /// Knots between pieces, the ends of the domain among them.
    pub(super) breaks: [Vec<f64>; 2],
    /// Its first piece; v runs fastest.
    first: usize,
}

/// A Bézier piece.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) sheet: u32,
    pub(super) degrees: Degrees,
    first: usize,
    pub(super) start: DVec2,
    pub(super) size: DVec2,
    pub(super) bounds: Aabb,
}

impl World {
    pub(super) fn of(scene: &Scene) -> Self {
        let mut world = Self {
            sheets: Vec::new(),
            pieces: Vec::new(),
            points: Vec::new(),
            regions: scene.patches().iter().map(Patch::region).collect(),
        };
        let patches =
            scene
                .placements()
                .into_iter()
                .filter_map(|placement| match placement.shape {
                    Shape::Patch(id) => Some((id, placement.world_from_object)),
                    Shape::Mesh(_) => None,
                });
        for (number, (id, place)) in patches.enumerate() {
            let surface = scene.patch(id).surface.transformed(&place);
            world.add(number, id.index(), surface);
        }
        world
    }

    fn add(&mut self, number: usize, patch: usize, surface: Surface) {
        let sheet = index(self.sheets.len());
        let first = self.pieces.len();
        for piece in surface.bezier_pieces() {
            let net = self.points.len();
            self.points
                .extend(piece.homogeneous().iter().map(|h| h.to_array()));
            self.pieces.push(Piece::of(&piece, sheet, net));
        }
        let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
        self.sheets.push(Sheet {
            number: index(number),
            start: DVec2::new(u.start, v.start),
            size: DVec2::new(u.end - u.start, v.end - v.start),
            patch,
            breaks: [surface.knots_u().breaks(), surface.knots_v().breaks()],
            first,
            surface,
        });
    }

    pub(super) fn sheet(&self, number: u32) -> &Sheet {
        &self.sheets[number as usize]
    }

    pub(super) fn net(&self, piece: &Piece) -> &[[f64; 4]] {
        &self.points[piece.first..piece.first + piece.degrees.len()]
    }

    /// Whether a point of a sheet belongs to its face.
    pub(super) fn keeps(&self, sheet: &Sheet, uv: DVec2) -> bool {
        let region = self.regions[sheet.patch].as_ref();
        region.is_none_or(|region| region.contains(uv))
    }

    /// Whether faces are cut by loops.
    pub(super) fn is_trimmed(&self, sheet: &Sheet) -> bool {
        self.regions[sheet.patch].is_some()
    }

    /// The piece at a point of a sheet with its number, and the point in its local parameters.
    #[inline]
    pub(super) fn locate(&self, sheet: &Sheet, uv: DVec2) -> (usize, &Piece, DVec2) {
        let column = |breaks: &[f64], x: f64| {
            let behind = breaks.partition_point(|&b| b <= x);
            behind.clamp(1, breaks.len() - 1) - 1
        };
        let [u, v] = &sheet.breaks;
        let k = sheet.first + column(u, uv.x) * (v.len() - 1) + column(v, uv.y);
        let piece = &self.pieces[k];
        (k, piece, (uv - piece.start) / piece.size)
    }

    /// The homogeneous point at parameters of a sheet.
    pub(super) fn value(&self, sheet: &Sheet, uv: DVec2, counts: &mut Counts) -> [f64; 4] {
        counts.values += 1;
        let (_, piece, local) = self.locate(sheet, uv);
        evaluate_points(self.net(piece), piece.degrees, local.x, local.y)[0]
    }

    /// The same with its derivatives by the parameters of the sheet.
    pub(super) fn derivatives(
        &self,
        sheet: &Sheet,
        uv: DVec2,
        counts: &mut Counts,
    ) -> [[f64; 4]; 3] {
        counts.derivatives += 1;
        let (_, piece, local) = self.locate(sheet, uv);
        let [h, hu, hv] = evaluate_points(self.net(piece), piece.degrees, local.x, local.y);
        let DVec2 { x, y } = piece.size;
        [h, hu.map(|c| c / x), hv.map(|c| c / y)]
    }
}

impl Piece {
    fn of(piece: &BezierSurface, sheet: u32, first: usize) -> Self {
        let (u, v) = (piece.u(), piece.v());
        Self {
            sheet,
            degrees: Degrees {
                p: piece.degree_u(),
                q: piece.degree_v(),
            },
            first,
            start: DVec2::new(u.start, v.start),
            size: DVec2::new(u.end - u.start, v.end - v.start),
            bounds: piece.hull_bounds(),
        }
    }

    /// Parameters of the sheet at local ones.
    pub(super) fn global(&self, local: DVec2) -> DVec2 {
        self.start + self.size * local
    }
}

impl Sheet {
    /// Parameters at a share of the domain.
    pub(super) fn at(&self, share: DVec2) -> DVec2 {
        self.start + self.size * share
    }
}

/// A ray as two planes through it: it is where both distances vanish.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planes {
    pub(super) e: [DVec3; 2],
    c: [f64; 2],
    origin: DVec3,
    direction: DVec3,
    inverse_square: f64,
}

/// Distances of a point from both planes, with their derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Distances {
    pub(super) f: DVec2,
    pub(super) fu: DVec2,
    pub(super) fv: DVec2,
    /// The ray parameter of the point.
    pub(super) t: f64,
}

impl Planes {
    /// Any two perpendicular planes.
    pub(super) fn of(ray: &Ray) -> Self {
        let (a, b) = ray.direction.normalize().any_orthonormal_pair();
        Self::with_normals(ray, [a, b])
    }

    /// Planes with these normals, perpendicular to the ray and of length one.
    pub(super) fn with_normals(ray: &Ray, e: [DVec3; 2]) -> Self {
        Self {
            e,
            c: e.map(|e| e.dot(ray.origin)),
            origin: ray.origin,
            direction: ray.direction,
            inverse_square: ray.direction.length_squared().recip(),
        }
    }

    /// Distances of a homogeneous point, times its weight.
    #[inline]
    pub(super) fn weighted(&self, h: &[f64; 4]) -> DVec2 {
        let x = DVec3::new(h[0], h[1], h[2]);
        DVec2::new(
            self.e[0].dot(x) - self.c[0] * h[3],
            self.e[1].dot(x) - self.c[1] * h[3],
        )
    }

    pub(super) fn distances(&self, h: &[f64; 4]) -> DVec2 {
        self.weighted(h) / h[3]
    }

    /// The ray parameter of a homogeneous point.
    pub(super) fn time(&self, h: &[f64; 4]) -> f64 {
        let point = DVec3::new(h[0], h[1], h[2]) / h[3];
        (point - self.origin).dot(self.direction) * self.inverse_square
    }

    /// Distances and their derivatives from a homogeneous point and its derivatives.
    pub(super) fn with_derivatives(&self, [h, hu, hv]: &[[f64; 4]; 3]) -> Distances {
        let scale = h[3].recip();
        let f = self.weighted(h) * scale;
        Distances {
            f,
            fu: (self.weighted(hu) - f * hu[3]) * scale,
            fv: (self.weighted(hv) - f * hv[3]) * scale,
            t: self.time(h),
        }
    }
}

/// A camera with the number of its pixels.
#[derive(Clone, Debug)]
pub(super) struct View {
    camera: Camera,
    rays: FilmRays,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl View {
    pub(super) fn new(camera: &Camera, (width, height): (u32, u32)) -> Self {
        let size = DVec2::new(f64::from(width), f64::from(height));
        Self {
            rays: FilmRays::new(camera, size),
            camera: camera.clone(),
            width,
            height,
        }
    }

    pub(super) fn size(&self) -> DVec2 {
        DVec2::new(f64::from(self.width), f64::from(self.height))
    }

    /// The ray through the middle of a pixel.
    pub(super) fn ray(&self, x: u32, y: u32) -> Ray {
        let place = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
        self.rays.through(place)
    }

    /// The width of a pixel at a ray parameter; that is the depth, as rays of a camera have
    /// component one along the view.
    pub(super) fn footprint(&self, t: f64) -> f64 {
        let width = 2.0 * self.rays.lens.half.x / f64::from(self.width);
        if self.rays.lens.is_parallel {
            width
        } else {
            width * t.abs()
        }
    }

    /// How near to the ray a point must be.
    pub(super) fn accuracy(&self, t: f64) -> f64 {
        ACCURACY * self.footprint(t)
    }

    /// A homogeneous point as `(x w, y w, w)` in pixels from the upper left corner; the weight
    /// is that after projection, and negative behind the camera.
    pub(super) fn project(&self, h: &[f64; 4]) -> [f64; 3] {
        let from_eye = DVec3::new(h[0], h[1], h[2]) - self.camera.eye() * h[3];
        let weight = if self.rays.lens.is_parallel {
            h[3]
        } else {
            from_eye.dot(self.camera.forward())
        };
        let size = self.size() * 0.5;
        let x = from_eye.dot(self.camera.right()) / self.rays.lens.half.x;
        let y = from_eye.dot(self.camera.up()) / self.rays.lens.half.y;
        [(x + weight) * size.x, (weight - y) * size.y, weight]
    }

    /// Depth of a homogeneous point along the view.
    pub(super) fn depth(&self, h: &[f64; 4]) -> f64 {
        let point = DVec3::new(h[0], h[1], h[2]) / h[3];
        (point - self.camera.eye()).dot(self.camera.forward())
    }
}

/// A position as a number that is stored.
pub(super) fn index(position: usize) -> u32 {
    u32::try_from(position).expect("fewer surfaces and pieces than 2^32")
}
