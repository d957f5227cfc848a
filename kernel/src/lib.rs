//! What a scene *is*: NURBS curves and surfaces, their Bézier pieces, trim loops, and the
//! tree of nodes, materials, lights and cameras around them.
//!
//! No input or output, no threads, no logging. Whatever exists is valid: constructors check,
//! and fields that could break an invariant are private. Vectors and maps are those of [`glam`].
//!
//! ```
//! use nurbray_kernel::glam::{DVec2, DVec3};
//! use nurbray_kernel::{KnotVector, Surface};
//!
//! let knots = KnotVector::bezier(1, 0.0..1.0)?;
//! let corners = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::new(1.0, 1.0, 1.0)];
//! let saddle = Surface::new(knots.clone(), knots, &corners, None)?;
//! assert_eq!(saddle.evaluate(DVec2::splat(0.5)), DVec3::new(0.5, 0.5, 0.25));
//! # Ok::<(), nurbray_kernel::Error>(())
//! ```
#![forbid(unsafe_code)]

mod bernstein;
mod bezier;
pub mod boolean;
mod bounds;
mod box_tree;
mod camera;
mod curve;
mod error;
mod interval;
mod knots;
mod material;
mod measure;
mod mesh;
pub mod modelling;
pub mod nearest;
mod normal;
mod patch;
mod ray;
mod scene;
mod sets;
mod sky;
mod spline;
mod surface;
mod texture;
mod trim;
mod unit;

pub use bernstein::binomials;
pub use bezier::BezierSurface;
pub use bounds::Aabb;
pub use box_tree::BoxTree;
pub use camera::{Camera, Lens, Projection};
pub use curve::{Curve, CurveDerivatives, FARTHEST, check_points};
pub use error::Error;
pub use glam;
pub use interval::Interval;
pub use knots::{KnotVector, MAX_DEGREE};
pub use material::{
    Falloff, Light, LightKind, Material, MetallicRoughness, linear_from_srgb, srgb_from_linear,
};
pub use measure::{Integrals, VolumeRule};
pub use mesh::Mesh;
pub use normal::{moved as moved_normal, regular as regular_normal};
pub use patch::Patch;
pub use ray::Ray;
pub use scene::{
    Child, Item, MaterialId, MeshId, Node, NodeId, PatchId, Placement, Scene, Seam, SeamSide,
    Shape, UpAxis, Wire, WireId, WirePlacement, WireShape,
};
pub use sets::Sets;
pub use sky::Sky;
pub use spline::{Linear, Point};
pub use surface::{Surface, SurfaceDerivatives};
pub use texture::{
    Channel, Filter, Image, Maps, ShareTexture, Texels, Texture, Wrap, bytes_from_linear,
};
pub use trim::{
    ClosedLoops, Cover, Nest, Orientation, TrimLoop, TrimRegion, close as close_loops, nesting,
    oriented,
};
pub use unit::Unit;
