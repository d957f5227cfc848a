//! What scenes can be written as, and which of these a file name asks for.

use std::io;
use std::path::Path;

use formats::Export;
use kernel::Scene;

use crate::gltf::{self, Container, Packing, Source};
use crate::losses::{self, LACKED_BY_GLTF, LACKED_BY_GROUPS, LACKED_BY_SHAPES, Part};
use crate::polygons;
pub use crate::polygons::Amount;
use crate::tessellate::Tessellation;

/// A kind of file that scenes are written to.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// With surfaces as they are.
    Surfaces(&'static formats::Writer),
    /// As triangles.
    Triangles(&'static MeshWriter),
}

/// A format that holds triangles: one row each.
#[derive(Clone, Copy, Debug)]
pub struct MeshWriter {
    /// Name in messages.
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Whether [`Packing`] makes its files smaller.
    pub packs: bool,
    /// Whether a mesh is stored once, wherever it stands.
    pub has_places: bool,
    /// Whether curves and points that stand for themselves are written, curves as lines.
    pub has_lines: bool,
    /// Scene and triangles to bytes; the name is that of the file without its ending.
    write: fn(&Scene, &Tessellation, &Source, Packing, &str) -> io::Result<Export>,
    rounding: fn(&Scene, Packing) -> f64,
    /// What it does not hold.
    lacks: &'static [Part],
}

/// All formats of triangles.
pub const MESH_WRITERS: &[MeshWriter] = &[
    MeshWriter {
        name: "glTF binary",
        extensions: &["glb"],
        packs: true,
        has_places: true,
        has_lines: true,
        write: |scene, mesh, source, packing, stem| {
            gltf::write(scene, mesh, source, (Container::Binary, packing), stem)
        },
        rounding: gltf::rounding,
        lacks: LACKED_BY_GLTF,
    },
    MeshWriter {
        name: "glTF",
        extensions: &["gltf"],
        packs: true,
        has_places: true,
        has_lines: true,
        write: |scene, mesh, source, packing, stem| {
            gltf::write(scene, mesh, source, (Container::Separate, packing), stem)
        },
        rounding: gltf::rounding,
        lacks: LACKED_BY_GLTF,
    },
    MeshWriter {
        name: "STL",
        extensions: &["stl"],
        packs: false,
        has_places: false,
        has_lines: false,
        write: |scene, mesh, _, _, _| polygons::stl(scene, mesh),
        rounding: |scene, _| polygons::rounding(scene),
        lacks: LACKED_BY_SHAPES,
    },
    MeshWriter {
        name: "PLY",
        extensions: &["ply"],
        packs: false,
        has_places: false,
        has_lines: false,
        write: |scene, mesh, _, _, _| polygons::ply(scene, mesh),
        rounding: |scene, _| polygons::rounding(scene),
        lacks: LACKED_BY_SHAPES,
    },
    MeshWriter {
        name: "OBJ polygons",
        extensions: &["obj"],
        packs: false,
        has_places: false,
        has_lines: true,
        write: |scene, mesh, _, _, _| Ok(polygons::obj(scene, mesh)),
        // Its numbers are those of the triangles, to the last digit.
        rounding: |_, _| 0.0,
        lacks: LACKED_BY_GROUPS,
    },
];

impl MeshWriter {
    /// The content of a file; `stem` is its name without its ending.
    ///
    /// # Errors
    /// If there is nothing to write, or more than the format can hold, or the triangles are not
    /// those of the scene as it is.
    pub fn write(
        &self,
        scene: &Scene,
        triangles: &Tessellation,
        source: &Source,
        packing: Packing,
        stem: &str,
    ) -> io::Result<Export> {
        triangles.check(scene)?;
        let mut export = (self.write)(scene, triangles, source, packing, stem)?;
        losses::tell(self.lacks, scene, &mut export.warnings);
        Ok(export)
    }

    /// How far points move at most when they are written, in units of the scene.
    pub fn rounding(&self, scene: &Scene, packing: Packing) -> f64 {
        (self.rounding)(scene, packing)
    }
}

impl Target {
    /// All kinds; of those with the same file name ending the first one is meant.
    pub fn all() -> impl Iterator<Item = Self> {
        let surfaces = formats::WRITERS.iter().map(Self::Surfaces);
        surfaces.chain(MESH_WRITERS.iter().map(Self::Triangles))
    }

    /// The kind that the ending of a file name asks for.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_lowercase();
        Self::all().find(|target| target.extensions().contains(&extension.as_str()))
    }

    /// The kind of triangles that the ending of a file name asks for.
    pub fn of_triangles(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_lowercase();
        let mut writers = MESH_WRITERS.iter();
        let found = writers.find(|writer| writer.extensions.contains(&extension.as_str()));
        found.map(Self::Triangles)
    }

    /// Whether curves and points that stand for themselves are written.
    pub fn has_lines(self) -> bool {
        match self {
            Self::Surfaces(_) => true,
            Self::Triangles(writer) => writer.has_lines,
        }
    }

    /// Whether surfaces become triangles.
    pub fn has_triangles(self) -> bool {
        matches!(self, Self::Triangles(_))
    }

    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surfaces(writer) => writer.name,
            Self::Triangles(writer) => writer.name,
        }
    }

    /// File name endings, lower case, without the dot.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Surfaces(writer) => writer.extensions,
            Self::Triangles(writer) => writer.extensions,
        }
    }
}
