//! Ray-traces NURBS exactly: from a file to a scene to a picture, never through triangles.
//!
//! The five stations, each one call:
//!
//! ```
//! use nurbray::kernel::Camera;
//! use nurbray::{Accelerator, METHODS, OutputOptions, RenderOptions, formats, output, render};
//!
//! # let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
//! # let target = std::env::temp_dir().join("nurbray-doc.png");
//! let scene = formats::open(folder.join("samples/teapot.obj"), &formats::Limits::default())?.scene;
//! let accelerator = Accelerator::build(&scene, &METHODS[0]);
//! let camera = Camera::framing(&accelerator.outline(), scene.up.direction(), 4.0 / 3.0);
//! let options = RenderOptions { width: 64, height: 48, ..RenderOptions::default() };
//! let (film, _) = render(&accelerator, &camera, &options, &|_| {});
//! output::write(&film, &target, &OutputOptions::default())?;
//! # std::fs::remove_file(&target)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Triangles within a tolerance, for programs that know no surfaces, and what a body measures:
//!
//! ```
//! use nurbray::convert::MESH_WRITERS;
//! use nurbray::gltf::{Packing, Source};
//! use nurbray::{TessellateOptions, Tolerance, formats, measure, tessellate};
//!
//! # let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
//! # let target = std::env::temp_dir().join("nurbray-doc.glb");
//! let import = formats::open(folder.join("samples/goblet.x3d"), &formats::Limits::default())?;
//! import.warnings.as_slice().iter().for_each(|warning| eprintln!("{warning}"));
//! let scene = import.scene;
//! let (writer, packing) = (&MESH_WRITERS[0], Packing::default());
//! // In units of the scene; numbers of 32 bits take a little of it.
//! let tolerance = Tolerance::Length(0.05 - writer.rounding(&scene, packing));
//! let options = TessellateOptions { tolerance, ..TessellateOptions::default() };
//! let triangles = tessellate(&scene, &options)?;
//! let glb = writer.write(&scene, &triangles, &Source::default(), packing, "goblet")?;
//! std::fs::write(&target, &glb.bytes)?;
//! let volume = measure(&scene).total().map(|body| body.volume);
//! # std::fs::remove_file(&target)?;
//! # assert!(volume > Some(1.0) && triangles.faces.iter().flatten().all(|f| f.unproven == 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Unoptimised it is many times slower: `[profile.dev.package."*"]` with `opt-level = 2` in the
//! `Cargo.toml` of a program optimises what it uses, and leaves the program itself to be debugged.
//!
//! `kernel` says what a scene *is*, `formats` how it is *stored*, this crate what we *do*
//! with it. Vectors and maps are those of [`glam`], here in the version that is needed.

pub use formats;
pub use glam;
pub use kernel;

mod accelerator;
mod accuracy;
mod certify;
pub mod compare;
pub mod convert;
mod curves;
mod film;
pub mod gltf;
pub mod html;
mod integrator;
mod intersect;
mod lights;
mod look;
mod losses;
mod measure;
mod memory;
pub mod methods;
mod model;
pub mod output;
mod polygons;
mod random;
mod render;
mod segment;
mod simd;
mod tessellate;
mod volume;

pub use accelerator::{Accelerator, Start, Workspace};
pub use accuracy::Accuracy;
pub use certify::{Ambiguity, Certificate, Certifier, CertifyStats, certify_film};
pub use curves::draw_curves;
pub use film::{Film, Picture, PixelData};
pub use integrator::Shading;
pub use intersect::{Hit, METHODS, Method};
pub use measure::{Body, Measure, Side, measure};
pub use model::{Caps, ModelMethod, ModelOptions, Modelled, Synthetic, model, synthetic};
pub use output::OutputOptions;
pub use render::{RenderOptions, RenderStats, over_sky, render};
pub use simd::Instructions;
pub use tessellate::{
    FaceMesh, Screen, Shell, Strip, TessellateError, TessellateOptions, Tessellation, Tolerance,
    tessellate,
};
pub use volume::{SliceRule, Unsuitable, VolumeMethod, volumes};
