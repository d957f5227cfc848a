//! Exact against tessellated: how far a mesh is from the surfaces that it stands for, in
//! numbers, words and pictures.
//!
//! Distances are looked for both ways by dividing what may hold a larger one, so that what is
//! found and what is proven come together; means, normals and faults come from points all over
//! the surfaces; pictures from the same camera, light and colours.

mod align;
mod deviation;
mod draw;
mod exact;
mod faults;
mod images;
pub mod read;
mod report;
mod sampling;
mod soup;
mod supremum;
pub(crate) mod triangles;
mod views;

use glam::DAffine3;
use kernel::{Patch, Scene};

pub use align::{Fit, Frame, from_metadata};
pub use deviation::{Reach, Worst};
use exact::Exact;
pub use faults::{Fault, FaultKind};
pub use images::{PIXELS_PER_DEGREE, flip, flip_map, psnr, psnr_linear, ssim};
pub use report::{Candidate, Compared, Made, Report, compare, remove_earlier};
use sampling::Sample;
pub use sampling::Statistics;
use soup::Soup;
use supremum::Effort;
pub use views::{ImageDifference, View};

use crate::tessellate::Tessellation;

/// The distances between surfaces and mesh, in units of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deviation {
    /// From the surfaces to the nearest triangles.
    pub surface_to_mesh: Reach,
    /// From the triangles to the nearest points of the surfaces.
    pub mesh_to_surface: Reach,
    /// Distances from the surfaces, over their area; `None` if there is nothing to measure.
    pub distance: Option<Statistics>,
    /// Angles between the normals of surfaces and triangles, in degrees, over the area.
    pub flat_normals: Option<Statistics>,
    /// The same with the normals that a renderer would use.
    pub smooth_normals: Option<Statistics>,
}

impl Deviation {
    /// The Hausdorff distance that is proven: no point of either side is farther away from
    /// the other.
    ///
    /// No more than some hundred thousand cells are divided for the proof. Where there are many
    /// triangles this may end far above what is [found](Self::found), a hundred times or more.
    pub fn bound(&self) -> f64 {
        self.surface_to_mesh.bound.max(self.mesh_to_surface.bound)
    }

    /// The Hausdorff distance that has been found.
    pub fn found(&self) -> f64 {
        self.surface_to_mesh.found.max(self.mesh_to_surface.found)
    }
}

/// Cells divided for each direction beyond the first ones, to prove what is found.
const BUDGET: usize = 250_000;

/// The same for meshes of which there is a proof already.
const PROVEN_BUDGET: usize = 30_000;

/// The same for a mesh that stands elsewhere, which no proof makes better.
const FAULTY_BUDGET: usize = 2_000;

/// A mesh without the polygons that are in the exact file, which are exact by themselves; `None`
/// if there are none.
fn of_surfaces(exact: &Exact<'_>, soup: &Soup) -> Option<Soup> {
    soup.without(|corners| exact.is_polygon(corners))
}

/// Measures a mesh; beside the result what is wrong with the mesh as a whole. The surfaces are
/// known to be no farther from it than `proven`, which is infinite where nothing is known; more is
/// done to know whether it is within `limit`.
fn measure(
    exact: &Exact<'_>,
    soup: &Soup,
    proven: f64,
    limit: Option<f64>,
) -> (Deviation, Vec<Fault>) {
    let pose = faults::pose(exact, soup);
    let budget = match pose {
        Some(_) => FAULTY_BUDGET,
        None if proven.is_finite() => PROVEN_BUDGET,
        None => BUDGET,
    };
    let effort = Effort {
        budget,
        limit: limit.filter(|limit| pose.is_none() && proven > *limit),
    };
    let size = exact.bounds().union(soup.bounds()).diagonal();
    let feet = deviation::feet(exact, soup);
    let mesh_to_surface = if !feet.is_empty() && feet.len() == soup.points.len() {
        deviation::from_mesh(exact, soup, &feet, size, effort)
    } else {
        Reach::ENDLESS
    };
    let strays = faults::strays(exact, mesh_to_surface.found);
    let samples = sampling::sample(exact, soup, strays);
    let degrees = |value: fn(&Sample) -> f64| {
        sampling::statistics(&samples, |sample| value(sample).to_degrees())
    };
    let mut deviation = Deviation {
        surface_to_mesh: deviation::from_surface(exact, soup, size, effort),
        mesh_to_surface,
        distance: sampling::statistics(&samples, |sample| sample.distance),
        flat_normals: degrees(|sample| sample.flat),
        smooth_normals: degrees(|sample| sample.smooth),
    };
    for way in [
        &mut deviation.surface_to_mesh,
        &mut deviation.mesh_to_surface,
    ] {
        for place in &mut way.worst {
            place.triangle = soup.numbers[place.triangle as usize];
        }
    }
    let coarse = if proven.is_finite() {
        proven
    } else {
        strays.max(faults::typical(exact, &samples))
    };
    let faults = faults::faults(exact, soup, (&samples, &feet), coarse, pose);
    (deviation, faults)
}

/// The surfaces of a scene, where they stand, and triangles of them: what meshes are measured
/// against.
#[derive(Debug)]
pub struct Subject<'a> {
    scene: &'a Scene,
    patches: Vec<Patch>,
    triangles: Tessellation,
}

impl<'a> Subject<'a> {
    /// The surfaces of a scene. The finer `triangles` are, the nearer proofs come to what is
    /// found; a quarter of the deviation that is to be measured is a good tolerance.
    ///
    /// Meshes tell no groups: where pictures are compared, lights should have no
    /// [`scope`](kernel::Light::scope), which only the exact picture heeds.
    ///
    /// # Panics
    /// If the triangles are not those of the scene as it is.
    pub fn new(scene: &'a Scene, triangles: Tessellation) -> Self {
        assert!(triangles.is_of(scene), "{}", Tessellation::FOREIGN);
        let patches = exact::placed_patches(scene);
        Self {
            scene,
            patches,
            triangles,
        }
    }

    fn exact(&self) -> Exact<'_> {
        Exact::new(self.scene, &self.patches, &self.triangles)
    }

    /// Measures the meshes of another scene, which stand in this one by `scene_from_mesh`; what
    /// is of the meshes of this scene is left out.
    pub fn measure(&self, mesh: &Scene, scene_from_mesh: &DAffine3) -> Deviation {
        let (exact, soup) = (self.exact(), Soup::new(mesh, scene_from_mesh));
        let part = of_surfaces(&exact, &soup);
        measure(&exact, part.as_ref().unwrap_or(&soup), f64::INFINITY, None).0
    }

    /// Whether a mesh is found to be farther away than `limit` without looking closely.
    pub fn is_exceeded(&self, mesh: &Scene, scene_from_mesh: &DAffine3, limit: f64) -> bool {
        let (exact, soup) = (self.exact(), Soup::new(mesh, scene_from_mesh));
        let part = of_surfaces(&exact, &soup);
        deviation::exceeds(&exact, part.as_ref().unwrap_or(&soup), limit)
    }

    /// Fits the meshes of another scene onto the surfaces; nothing if they are in another unit, which
    /// no turn and way mends.
    pub fn fit(&self, mesh: &Scene, scene_from_mesh: &DAffine3) -> Option<Fit> {
        let (exact, soup) = (self.exact(), Soup::new(mesh, scene_from_mesh));
        let part = of_surfaces(&exact, &soup);
        let soup = part.as_ref().unwrap_or(&soup);
        let fault = faults::pose(&exact, soup);
        let is_scaled = fault.is_some_and(|fault| fault.kind == FaultKind::Units);
        (!is_scaled).then(|| align::fit(&exact, soup))
    }
}
