//! What scenes can be written as, and which of these a file name asks for.

use std::io;
use std::path::Path;

use formats::Export;
use kernel::Scene;

use crate::gltf::{self, Container, Packing, Source};
use crate::polygons;
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
    /// Name in messages and on the command line.
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Scene and triangles to bytes; the name is that of the file without its ending.
    pub write: fn(&Scene, &Tessellation, &Source, Packing, &str) -> io::Result<Export>,
    /// Whether [`Packing`] makes its files smaller.
    pub packs: bool,
}

/// All formats of triangles.
pub const MESH_WRITERS: &[MeshWriter] = &[
    MeshWriter {
        name: "glTF binary",
        extensions: &["glb"],
        write: |scene, mesh, source, packing, stem| {
            gltf::write(scene, mesh, source, (Container::Binary, packing), stem)
        },
        packs: true,
    },
    MeshWriter {
        name: "glTF",
        extensions: &["gltf"],
        write: |scene, mesh, source, packing, stem| {
            gltf::write(scene, mesh, source, (Container::Separate, packing), stem)
        },
        packs: true,
    },
    MeshWriter {
        name: "STL",
        extensions: &["stl"],
        write: |scene, mesh, _, _, _| Ok(polygons::stl(scene, mesh)),
        packs: false,
    },
    MeshWriter {
        name: "PLY",
        extensions: &["ply"],
        write: |scene, mesh, _, _, _| Ok(polygons::ply(scene, mesh)),
        packs: false,
    },
    MeshWriter {
        name: "OBJ polygons",
        extensions: &["obj"],
        write: |scene, mesh, _, _, _| Ok(polygons::obj(scene, mesh)),
        packs: false,
    },
];

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

    /// Whether surfaces become triangles.
    pub fn has_triangles(self) -> bool {
        matches!(self, Self::Triangles(_))
    }

    /// Whether curves and points without a surface are written.
    pub fn has_curves(self) -> bool {
        matches!(self, Self::Surfaces(writer) if writer.has_curves)
    }

    /// Name in messages and on the command line.
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
