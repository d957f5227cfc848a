//! From surfaces to triangles, with a proof of how far apart they are.
//!
//! Edges come first: each is found once, sampled once, and given to both of its faces, so
//! that neighbours share their points to the last bit. Then every face is filled with
//! triangles and refined until the second derivatives of the surface over each, bounded by
//! the control points, prove that it is within the tolerance.
//!
//! What is proven, up to rounding: every point of a triangle is within `proven` of the surface at
//! the parameters that belong to it, and every point of a face is within `proven` of a triangle.

mod bounds;
mod calm;
mod chains;
mod cone;
pub(crate) mod deviation;
mod edge;
mod face;
mod group;
mod net;
pub(crate) mod pieces;
mod rim;
mod room;
mod round;
mod separable;
mod sew;
mod shell;
mod strips;
#[cfg(test)]
mod tests;
mod trail;
mod vanish;

use std::{fmt, io};

use glam::{DAffine3, DVec2, DVec3};
use kernel::{Camera, Child, Mesh, Projection, Scene, Shape, WireId, WireShape};
use rayon::prelude::*;

use self::room::Room;
use self::strips::Reach;

pub(crate) use rim::Face;
pub(crate) use sew::{Edge, Sewn, Use, sew};
pub use shell::Shell;
pub use strips::Strip;

/// How far triangles may be from the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// A length in units of the scene.
    Length(f64),
    /// A share of the diagonal of the box around the scene.
    Relative(f64),
}

impl Tolerance {
    /// The length, in units of a scene with a box of that diagonal.
    pub fn length(self, diagonal: f64) -> f64 {
        match self {
            Self::Length(length) => length,
            Self::Relative(share) => share * diagonal,
        }
    }
}

/// What triangles have to keep to.
#[derive(Clone, Debug, PartialEq)]
pub struct TessellateOptions {
    /// Largest distance between triangles and surface, above 0 and finite.
    pub tolerance: Tolerance,
    /// Largest angle between the normals at the ends of a side, in radians, above 0 and finite;
    /// over less than the tolerance they may turn by any.
    pub angle: f64,
    /// Longest side, in units of the scene, above 0 and finite.
    pub max_edge: Option<f64>,
    /// A view for which the tolerance of each face is at least what is seen of it.
    pub screen: Option<Screen>,
    /// Most points, of all faces together.
    pub most_points: usize,
}

impl TessellateOptions {
    /// Refuses limits that are out of their range.
    fn check(&self) -> Result<(), TessellateError> {
        let (Tolerance::Length(tolerance) | Tolerance::Relative(tolerance)) = self.tolerance;
        let screen = self.screen.as_ref();
        let limits = [
            ("tolerance", Some(tolerance)),
            ("angle", Some(self.angle)),
            ("longest side", self.max_edge),
            ("tolerance in pixels", screen.map(|s| s.pixels)),
            ("number of rows", screen.map(|s| s.height.into())),
        ];
        let is_out = |found: f64| !(found > 0.0 && found.is_finite());
        let mut limits = limits.into_iter().filter_map(|(name, x)| Some((name, x?)));
        match limits.find(|&(_, found)| is_out(found)) {
            Some((name, found)) => Err(TessellateError::OutOfRange { name, found }),
            None => Ok(()),
        }
    }
}

/// Why there are no triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum TessellateError {
    /// Limits ask for more points than are allowed.
    TooManyPoints {
        /// How many are allowed.
        most: usize,
    },
    /// A limit is not above 0 and finite.
    OutOfRange {
        /// Which one.
        name: &'static str,
        /// Its value.
        found: f64,
    },
}

impl fmt::Display for TessellateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyPoints { most } => write!(
                f,
                "triangles this fine have more than {most} points; allow a larger tolerance, angle \
                 or side, or more points"
            ),
            Self::OutOfRange { name, found } => {
                write!(f, "the {name} is {found}; it must be positive and finite")
            }
        }
    }
}

impl std::error::Error for TessellateError {}

/// A view that needs no more detail than it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Screen {
    /// The camera.
    pub camera: Camera,
    /// Tolerance in pixels, above 0 and finite.
    pub pixels: f64,
    /// Rows of the picture, at least one.
    pub height: u32,
}

/// Points of all faces together: about two and a half gigabytes while they are made.
const MOST_POINTS: usize = 5_000_000;

impl Default for TessellateOptions {
    /// A two thousandth of the diagonal, 15 degrees, and five million points.
    fn default() -> Self {
        Self {
            tolerance: Tolerance::Relative(1.0 / 2000.0),
            angle: 15.0_f64.to_radians(),
            max_edge: None,
            screen: None,
            most_points: MOST_POINTS,
        }
    }
}

/// The triangles of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Tessellation {
    /// The triangles of each patch of the scene, in its own coordinates; `None` for patches
    /// that nothing shows.
    pub faces: Vec<Option<FaceMesh>>,
    /// The straight lines of each wire of the scene that is a curve; `None` for points and for what
    /// nothing shows.
    pub strips: Vec<Option<Strip>>,
    /// What hangs together.
    pub shells: Vec<Shell>,
    /// The tolerance in units of the scene.
    pub tolerance: f64,
    /// Boundaries of faces that cross each other so that neighbours may not share all points.
    pub crossings: usize,
}

impl Tessellation {
    pub(crate) const FOREIGN: &str = "the triangles are not those of the scene";

    /// Whether there is a face for each patch of the scene, and a strip for each wire.
    pub(crate) fn is_of(&self, scene: &Scene) -> bool {
        self.faces.len() == scene.patches().len() && self.strips.len() == scene.wires().len()
    }

    /// Refuses a scene that the triangles are not of.
    pub(crate) fn check(&self, scene: &Scene) -> io::Result<()> {
        if self.is_of(scene) {
            return Ok(());
        }
        Err(io::Error::new(io::ErrorKind::InvalidInput, Self::FOREIGN))
    }

    /// The points of a wire of the scene, and whether lines run through them; `None` if there are none.
    pub(crate) fn thread<'s>(
        &'s self,
        scene: &'s Scene,
        id: WireId,
    ) -> Option<(&'s [DVec3], bool)> {
        let (points, has_lines) = match &scene.wire(id).shape {
            WireShape::Points(points) => (points, false),
            WireShape::Curve(_) => (&self.strips[id.index()].as_ref()?.points, true),
        };
        (!points.is_empty()).then_some((points, has_lines))
    }
}

/// The triangles of a patch.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceMesh {
    /// Triangles with exact normals and the texture coordinates of the patch. Neighbouring
    /// patches share positions to the last bit.
    pub mesh: Mesh,
    /// Parameters of the vertices on the surface.
    pub parameters: Vec<DVec2>,
    /// Whether triangles and normals are turned against those of the surface, so that all
    /// of a shell look to the same side. Triangles of strips in which boundaries overlap look to the
    /// other side.
    pub flipped: bool,
    /// The tolerance of this face, in its own units.
    pub tolerance: f64,
    /// How much its own units are lengthened at most where it is shown.
    pub scale: f64,
    /// How far surface and triangles are apart at most, in the patch's own units; infinite where
    /// boundaries cross, so that nothing is proven.
    pub proven: f64,
    /// The largest distance found at sample points.
    pub sampled: f64,
    /// The largest distance between the surface and a point shared with a neighbour.
    pub gap: f64,
    /// Triangles that pass a limit because parameters cannot be told apart any more, and all where
    /// boundaries cross.
    pub unproven: usize,
    /// Straight pieces of the boundaries that triangles do not keep to, because they cross others.
    pub undrawn: usize,
}

/// Limits in the coordinates of a group of faces.
#[derive(Clone, Copy, Debug)]
struct Limits<'a> {
    angle: f64,
    max_edge: f64,
    room: &'a Room,
}

/// Makes triangles of every patch that is shown. The result does not depend on the number of
/// threads.
///
/// # Errors
/// If more points would be needed than are allowed, or a limit is out of its range.
pub fn tessellate(
    scene: &Scene,
    options: &TessellateOptions,
) -> Result<Tessellation, TessellateError> {
    options.check()?;
    // Once among the threads of the pool, instead of at each step.
    rayon::scope(|_| inside(scene, options))
}

/// [`tessellate`] within a thread of the pool.
fn inside(scene: &Scene, options: &TessellateOptions) -> Result<Tessellation, TessellateError> {
    let diagonal = scene.extent().diagonal();
    let tolerance = options.tolerance.length(diagonal);
    // Of a scene without extent nothing is left whatever the tolerance.
    let tolerance = if tolerance > 0.0 {
        tolerance
    } else {
        f64::MIN_POSITIVE
    };
    let tolerances = match &options.screen {
        Some(screen) => screen.tolerances(scene, tolerance),
        None => vec![tolerance; scene.patches().len()],
    };
    let groups = group::groups(scene);
    let room = Room::new(options.most_points);
    let done: Option<Vec<_>> = groups
        .par_iter()
        .map(|group| group.tessellate(scene, &tolerances, options, &room))
        .collect();
    let most = options.most_points;
    let done = done.ok_or(TessellateError::TooManyPoints { most })?;
    let strips = strips(scene, tolerance, options.angle, &room);
    let mut result = Tessellation {
        faces: vec![None; scene.patches().len()],
        strips: strips.ok_or(TessellateError::TooManyPoints { most })?,
        shells: Vec::new(),
        tolerance,
        crossings: 0,
    };
    for (group, done) in groups.iter().zip(done) {
        for (member, face) in group.members().zip(done.faces) {
            result.faces[member.index()] = Some(face);
        }
        result.shells.extend(done.shells);
        result.crossings += done.crossings;
    }
    Ok(result)
}

/// The straight lines of all curves that stand for themselves; `None` if there is no room for them.
fn strips(scene: &Scene, tolerance: f64, angle: f64, room: &Room) -> Option<Vec<Option<Strip>>> {
    let mut scales = vec![0.0_f64; scene.wires().len()];
    for (node, scale) in scene.nodes().iter().zip(lengthened(scene)) {
        for wire in &node.wires {
            let own = &mut scales[wire.index()];
            *own = own.max(scale);
        }
    }
    let wires = scene.wires().par_iter().zip(scales);
    let strips = wires.map(|(wire, scale)| match &wire.shape {
        WireShape::Curve(curve) if scale > 0.0 => {
            let tolerance = tolerance / scale;
            let reach = Reach {
                tolerance,
                angle,
                room,
            };
            Strip::of(curve, scale, &reach).map(Some)
        }
        _ => Some(None),
    });
    strips.collect()
}

/// How much what is in each node is lengthened at most where it is shown; zero where it is not.
fn lengthened(scene: &Scene) -> Vec<f64> {
    let mut scales = vec![0.0_f64; scene.nodes().len()];
    if let Some(root) = scene.root() {
        scales[root.index()] = stretch(&scene.node(root).parent_from_node);
    }
    // From the root down.
    for (index, node) in scene.nodes().iter().enumerate().rev() {
        for child in &node.children {
            if let Child::Node(id) = child {
                let scale = scales[index] * stretch(&scene.node(*id).parent_from_node);
                scales[id.index()] = scales[id.index()].max(scale);
            }
        }
    }
    scales
}

impl Screen {
    /// For every patch what its pixels cover where it comes nearest, but not less than
    /// `least`.
    fn tolerances(&self, scene: &Scene, least: f64) -> Vec<f64> {
        let mut tolerances = vec![f64::INFINITY; scene.patches().len()];
        for placement in scene.placements() {
            let Shape::Patch(id) = placement.shape else {
                continue;
            };
            let bounds = scene.patch(id).hull_bounds();
            let bounds = bounds.transformed(&placement.world_from_object);
            let eye = self.camera.eye();
            let distance = eye.distance(eye.clamp(bounds.min, bounds.max));
            let rows = f64::from(self.height);
            let pixel = match self.camera.projection() {
                Projection::Perspective { vertical_fov: fov }
                | Projection::PerspectiveShorter { fov } => {
                    2.0 * distance * (0.5 * fov).tan() / rows
                }
                Projection::Orthographic { extent } => extent / rows,
                // As in a picture of the shape of the window.
                Projection::OrthographicWindow { size } => size.y / rows,
            };
            let own = &mut tolerances[id.index()];
            *own = own.min((self.pixels * pixel).max(least));
        }
        tolerances
    }
}

/// The largest factor by which a map lengthens anything, or a little more.
pub(crate) fn stretch(map: &DAffine3) -> f64 {
    let m = map.matrix3;
    let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
    let lengths = [a, b, c].map(|x| x.length_squared());
    let most = lengths.iter().copied().fold(0.0, f64::max);
    // Columns that are not perpendicular add up: Gershgorin's bound of the squares.
    let mixed = [a.dot(b).abs(), b.dot(c).abs(), c.dot(a).abs()];
    let rows = [
        mixed[0] + mixed[2],
        mixed[0] + mixed[1],
        mixed[1] + mixed[2],
    ];
    let bound = lengths
        .iter()
        .zip(rows)
        .map(|(l, r)| l + r)
        .fold(most, f64::max);
    bound.sqrt()
}
