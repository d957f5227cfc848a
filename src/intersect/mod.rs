//! Where a ray meets a shape: the methods, and what they answer.

mod arc;
mod edge;
pub(crate) mod net;
pub(crate) mod newton;
pub(crate) mod subdivide;
mod tangent;
pub(crate) mod triangle;
mod twofold;

use std::fmt;
use std::ops::Range;

use glam::{DVec2, DVec3};
use kernel::Ray;

use crate::accelerator::{Accelerator, Workspace};
use crate::methods::{self, Picture, Variant};
use net::Degrees;

pub(crate) use tangent::Touch;

/// A point where a ray meets a shape, in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The ray parameter, in lengths of the ray's direction.
    pub t: f64,
    /// Parameters of the point: the patch's own, or barycentric for a triangle.
    pub uv: DVec2,
    /// The point on the shape.
    pub point: DVec3,
    /// Unit normal along `du x dv`, not turned towards the ray; zero where there is none.
    pub normal: DVec3,
    /// Number of the shape: patches from 0 on in file order after instancing, then meshes. What it is
    /// stands there in [`Scene::numbered_placements`](kernel::Scene::numbered_placements).
    pub shape: u32,
    /// Whether the ray only touches, runs along the surface, or meets a singular point, so
    /// that the root could not be proven to be a simple crossing.
    pub tangential: bool,
    /// Whether it stands for a gap between two faces that the ray passes through.
    pub filled: bool,
    /// Bound on the error of `point`, in scene units.
    pub error: f64,
    /// Instance and item of the accelerator that were hit.
    pub(crate) place: (u32, u32),
    /// Which triangle of a mesh.
    pub(crate) triangle: u32,
}

/// A way to find where rays meet patches: one row per file of this folder or of
/// [`crate::methods`].
///
/// Each row holds whole-ray functions, compiled for the method; nothing is looked up
/// within the loop over cells. Methods that work on the whole picture leave single rays to the
/// production method.
#[derive(Clone, Copy)]
pub struct Method {
    /// Name on the command line.
    pub name: &'static str,
    /// One sentence for `--help`.
    pub summary: &'static str,
    /// Departures from its defaults that it knows.
    pub variants: &'static [Variant],
    pub(crate) nearest: fn(&Accelerator, &Ray, Range<f64>, &mut Workspace) -> Option<Hit>,
    pub(crate) any: fn(&Accelerator, &Ray, Range<f64>, &mut Workspace) -> bool,
    pub(crate) all: fn(&Accelerator, &Ray, Range<f64>, &mut Workspace, &mut Vec<Hit>),
    /// What finds the rays of the camera, if not the functions above.
    pub(crate) picture: Option<Picture>,
}

impl fmt::Debug for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Method({})", self.name)
    }
}

/// All methods; the first is the default.
pub const METHODS: &[Method] = &[
    PRODUCTION,
    Method {
        name: "gradient-mc",
        summary: "random points of each piece, then the gradient (Sisojevs 2011)",
        variants: &[Variant::SeedLiteral],
        picture: Some(methods::GRADIENT_MC),
        ..PRODUCTION
    },
    Method {
        name: "gradient-map",
        summary: "preliminary map of the picture, then the gradient (Sisojevs 2011)",
        variants: &[Variant::Map8, Variant::Tree, Variant::SeedLiteral],
        picture: Some(methods::GRADIENT_MAP),
        ..PRODUCTION
    },
    Method {
        name: "descent-map",
        summary: "preliminary map, then steepest descent with directions reused (Sisojevs 2009)",
        variants: &[Variant::Map8, Variant::Tree, Variant::SeedLiteral],
        picture: Some(methods::DESCENT_MAP),
        ..PRODUCTION
    },
    Method {
        name: "newton-map",
        summary: "preliminary map, then Newton's iteration on the film (Sisojevs 2011)",
        variants: &[Variant::Map8, Variant::Tree, Variant::Homogeneous],
        picture: Some(methods::NEWTON_MAP),
        ..PRODUCTION
    },
    Method {
        name: "martin",
        summary: "flattening, boxes, Newton's iteration from their middles (Martin 2000)",
        variants: &[Variant::Tree],
        picture: Some(methods::MARTIN),
        ..PRODUCTION
    },
    Method {
        name: "nishita",
        summary: "Bezier clipping (Nishita 1990)",
        variants: &[],
        picture: Some(methods::NISHITA),
        ..PRODUCTION
    },
    Method {
        name: "efremov",
        summary: "Bezier clipping with repairs (Efremov 2005)",
        variants: &[],
        picture: Some(methods::EFREMOV),
        ..PRODUCTION
    },
    Method {
        name: "wang",
        summary: "Newton's iteration from the neighbouring pixel, else clipping (Wang 2001)",
        variants: &[],
        picture: Some(methods::WANG),
        ..PRODUCTION
    },
];

const PRODUCTION: Method = Method {
    variants: &[Variant::Single],
    ..method::<newton::Newton>()
};

const fn method<I: Intersector>() -> Method {
    Method {
        name: I::NAME,
        summary: I::SUMMARY,
        variants: &[],
        nearest: |a, ray, range, w| a.nearest_with::<I>(ray, range, w),
        any: |a, ray, range, w| a.any_with::<I>(ray, range, w),
        all: |a, ray, range, w, hits| a.all_with::<I>(ray, range, w, hits),
        picture: None,
    }
}

/// Finds all the roots of one ray in one cell.
pub(crate) trait Intersector: Default + 'static {
    /// Name on the command line.
    const NAME: &'static str;
    /// One sentence for `--help`.
    const SUMMARY: &'static str;

    /// Replaces `scratch.roots` by every point of the cell that the ray's line meets.
    fn roots(scratch: &mut Scratch, target: &Target<'_>);
}

/// A cell of a piece, and the ray's line that may meet it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target<'a> {
    pub(crate) piece: PieceNet<'a>,
    pub(crate) line: Line,
    /// The cell in local parameters.
    pub(crate) cell: Rect,
    /// Where the line meets the tangent plane in the middle of the cell, from -1 to 1.
    pub(crate) start: [f64; 2],
    /// The inverse of the derivatives and the normal in the middle of the cell.
    pub(crate) rows: [DVec3; 3],
    /// Bound on how far the cell strays from that frame as seen along the line: below one
    /// there is at most one root.
    pub(crate) stray: f64,
}

/// One Bézier piece in its own units: centred and scaled so that it fits the unit ball,
/// with weights of at most one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PieceNet<'a> {
    pub(crate) degrees: Degrees,
    /// The points `(w P, w)`.
    pub(crate) points: &'a [[f64; 4]],
}

/// Parameters, spread over a piece, at which one that is a curve has no area.
const SPREAD: [f64; 6] = [0.07, 0.23, 0.41, 0.59, 0.78, 0.94];

/// Derivatives up to this sine of an angle are parallel, by rounding: where all are, a piece is a curve.
const PARALLEL: f64 = 1e-14;

impl PieceNet<'_> {
    /// Whether it has no area, being a curve.
    pub(crate) fn is_curve(&self) -> bool {
        let is_flat = |u: f64, v: f64| {
            let [x, du, dv] = net::evaluate_at(self, u, v);
            let point = x.truncate() / x.w;
            let [du, dv] = [du, dv].map(|d| (d.truncate() - point * d.w) / x.w);
            du.cross(dv).length() <= PARALLEL * du.length() * dv.length()
        };
        SPREAD
            .iter()
            .all(|&u| SPREAD.iter().all(|&v| is_flat(u, v)))
    }
}

/// A ray's line as two planes through it, in the units of a piece: the line is where
/// `e1 . x = c1` and `e2 . x = c2`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    /// A point of the line next to the piece, and its unit direction.
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) e1: DVec3,
    pub(crate) e2: DVec3,
    pub(crate) c1: f64,
    pub(crate) c2: f64,
    /// Bound on the rounding errors of the distances from both planes.
    pub(crate) slack: f64,
}

/// Part of a piece in its local parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect {
    pub(crate) u: (f64, f64),
    pub(crate) v: (f64, f64),
}

/// A root in the local parameters of a piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Root {
    pub(crate) u: f64,
    pub(crate) v: f64,
    /// Whether it could not be proven to be a simple crossing.
    pub(crate) tangential: bool,
    /// Whether rounding hides more than [`newton::BLUR`] of its place.
    pub(crate) blurred: bool,
    /// Whether it stands for a part of the piece that is seen from its edge, and too flat for a
    /// contact to be told from others.
    pub(crate) flat: bool,
}

/// Memory that the solvers reuse from cell to cell.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// What the last call found.
    pub(crate) roots: Vec<Root>,
    /// Cells that wait, each a header and two nets.
    pub(crate) stack: Vec<f64>,
    /// The nets of the cell at hand.
    pub(crate) net: Vec<f64>,
    /// The preconditioned nets, and room for splitting.
    pub(crate) spare: Vec<f64>,
    /// Stretches along which the ray runs.
    pub(crate) arcs: arc::Arcs,
    /// How many cells were examined since the start, parts of cells among them.
    pub(crate) cells: u64,
}
