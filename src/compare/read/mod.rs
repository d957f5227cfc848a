//! Meshes of other tools: glTF, STL, PLY, and what the readers of surfaces know of triangles.

mod accessor;
mod container;
mod gltf;
mod ply;
mod stl;

use std::fs;
use std::io::Read as _;
use std::path::Path;

use formats::{Error, Folder, Limits, OpenError, Place, Problem, Warnings};
use kernel::{Child, Item, Mesh, Node, Scene, Shape};

use super::align::Frame;

/// A file of triangles.
#[derive(Clone, Debug, Default)]
pub struct MeshFile {
    /// Name of the format.
    pub format: &'static str,
    /// The triangles, each part at its place, in the coordinates of the file.
    pub scene: Scene,
    /// What the file says about these coordinates.
    pub frame: Frame,
    /// Size of the file, and of the files that it names.
    pub bytes: u64,
    /// What a file of our own says of its distance from the surfaces, in metres: what is
    /// proven, and the largest one found.
    pub claim: Option<[f64; 2]>,
    /// What was not used.
    pub warnings: Warnings,
}

/// Opens a file of triangles: `.glb`, `.gltf`, `.stl`, `.ply`, or one of the formats of
/// surfaces that has polygons in it. Files that it names must lie in its folder or below.
///
/// # Errors
/// If the file cannot be read or breaks the rules of its format. A file without a triangle is
/// no error.
pub fn open(path: &Path, limits: &Limits) -> Result<MeshFile, OpenError> {
    type Reader = fn(&[u8], &Folder<'_>, &Limits) -> Result<MeshFile, Error>;
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let read: Reader = match extension.as_deref() {
        Some("glb" | "gltf") => |bytes, folder, limits| gltf::read(bytes, folder, limits),
        Some("stl") => |bytes, _, limits| stl::read(bytes, limits),
        Some("ply") => |bytes, _, limits| ply::read(bytes, limits),
        _ => return with_surfaces(path, limits),
    };
    let mut bytes = Vec::new();
    let file = fs::File::open(path)?;
    file.take(limits.bytes as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > limits.bytes {
        let text = format!("larger than the limit of {} bytes", limits.bytes);
        return Err(error("", "", Problem::TooLarge(text)).into());
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    Ok(read(&bytes, &Folder::new(folder, folder, limits), limits)?)
}

/// The polygons of a file that may have surfaces, too.
fn with_surfaces(path: &Path, limits: &Limits) -> Result<MeshFile, OpenError> {
    let import = formats::open(path, limits).map_err(|mut error| {
        if let OpenError::Format(Error {
            format: "",
            problem: Problem::Unsupported(text),
            ..
        }) = &mut error
        {
            *text += ", and meshes of glTF, STL and PLY";
        }
        error
    })?;
    let mut warnings = import.warnings;
    for patch in import.scene.patches() {
        let place = Place::item(0, format!("\"{}\", {}", patch.name, patch.source));
        warnings.unsupported(place, "surfaces are not a part of the mesh");
    }
    // OBJ tells neither unit nor axis.
    let telling = import.format != "OBJ";
    Ok(MeshFile {
        format: import.format,
        frame: Frame {
            metres: import.scene.unit.as_ref().map(|unit| unit.metres),
            up: telling.then_some(import.scene.up),
        },
        scene: import.scene,
        bytes: fs::metadata(path)?.len(),
        claim: None,
        warnings,
    })
}

fn error(format: &'static str, what: impl Into<String>, problem: Problem) -> Error {
    Error {
        format,
        place: Place::item(0, what),
        problem,
    }
}

/// Adds a node that shows these meshes.
fn add_meshes(scene: &mut Scene, node: Node, meshes: Vec<Mesh>) -> Result<Node, kernel::Error> {
    let mut node = node;
    for mesh in meshes {
        let (shape, material) = (Shape::Mesh(scene.add_mesh(mesh)?), None);
        node.children.push(Child::Item(Item { shape, material }));
    }
    Ok(node)
}

/// A file that holds one mesh, and tells nothing about its coordinates.
fn of_one(
    format: &'static str,
    mesh: Result<Mesh, kernel::Error>,
    bytes: &[u8],
    warnings: Warnings,
) -> Result<MeshFile, Error> {
    let geometry = |e| error(format, "", Problem::Geometry(e));
    let mesh = mesh.map_err(geometry)?;
    let mut scene = Scene::default();
    let root = add_meshes(&mut scene, Node::default(), vec![mesh]).map_err(geometry)?;
    let root = scene.add_node(root).map_err(geometry)?;
    scene.set_root(root).map_err(geometry)?;
    Ok(MeshFile {
        format,
        scene,
        bytes: bytes.len() as u64,
        warnings,
        ..MeshFile::default()
    })
}
