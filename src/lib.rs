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
//! `kernel` says what a scene *is*, `formats` how it is *stored*, this crate what we *do*
//! with it.

pub use formats;
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
mod sets;
mod simd;
mod tessellate;
mod volume;

pub use accelerator::{Accelerator, Workspace};
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
    FaceMesh, Screen, Shell, Strip, TessellateOptions, Tessellation, Tolerance, TooManyPoints,
    tessellate,
};
pub use volume::{SliceRule, Unsuitable, VolumeMethod, volumes};
