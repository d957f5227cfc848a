//! glTF 2.0: scenes with triangles for programs that know no surfaces.
//!
//! One node turns and scales everything to metres with Y upwards, so that all below has the
//! numbers of the source. Each mesh is stored once.

mod buffer;
mod look;
pub(crate) mod meshopt;
mod pictures;
mod place;
mod rounding;
mod shapes;
mod tree;

use formats::Export;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::json::validation::USize64;
use gltf::json::{Buffer, Index, Node};
use kernel::{Scene, UpAxis};
use serde_json::{Map, Value, json};

use crate::accuracy::Accuracy;
use crate::html::address;
use crate::tessellate::Tessellation;
use buffer::{Contents, extras, number};
use meshopt::COMPRESSION;
use place::Place;
pub use rounding::rounding;
use shapes::Shapes;

/// How the parts of a file are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Container {
    /// All in one file: `.glb`.
    Binary,
    /// Text and numbers apart: `.gltf` and `.bin`.
    Separate,
}

/// What makes files smaller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Packing {
    /// Positions on a grid of 65535 steps along the longest side of a mesh, normals in bytes
    /// (`KHR_mesh_quantization`).
    pub quantize: bool,
    /// Compressed views (`EXT_meshopt_compression`).
    pub meshopt: bool,
}

/// Where a scene comes from, as files tell it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// Name of the file.
    pub name: String,
    /// SHA-256 of its bytes, in hexadecimal digits.
    pub sha256: String,
}

/// The content of a glTF file; `stem` names the file beside it.
///
/// # Errors
/// If there is nothing to write, more than a binary file can hold, compression fails, or the
/// triangles are not those of the scene as it is.
pub fn write(
    scene: &Scene,
    triangles: &Tessellation,
    source: &Source,
    (container, packing): (Container, Packing),
    stem: &str,
) -> std::io::Result<Export> {
    triangles.check(scene)?;
    let mut root = gltf::json::Root::default();
    root.asset.generator = Some(format!("nurbray {}", env!("CARGO_PKG_VERSION")));
    let metres = scene.unit.as_ref().map_or(1.0, |unit| unit.metres);
    let rotation = match scene.up {
        UpAxis::Y => DQuat::IDENTITY,
        UpAxis::Z => DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2),
    };
    let place = Place {
        translation: DVec3::ZERO,
        rotation,
        scale: DVec3::splat(metres),
    };
    let mut top = Node::default();
    place.apply_to(&mut top);
    root.nodes.push(top);
    let top = Index::new(0);
    let mut shapes = Shapes::new(scene, triangles, packing.quantize);
    tree::add(scene, &mut shapes, top, &mut root)?;
    let mut roots = vec![top];
    if root.nodes[0].children.is_none() {
        let text = "there is no triangle, line or point in the scene";
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, text));
    }
    let world = DAffine3::from_mat3(DMat3::from_quat(rotation) * metres);
    add_views(scene, &world, metres, &mut root, &mut roots);
    let moved = rounding(scene, packing);
    let accuracy = Accuracy::of(triangles, moved);
    root.asset.extras = extras(&json!({
        "source": source.name,
        "sha256": source.sha256,
        "unit_m": metres,
        "tolerance_m": (triangles.tolerance + moved) * metres,
        "proven_deviation_m": accuracy.proven * metres,
        "sampled_deviation_m": accuracy.sampled * metres,
    }));
    root.scenes.push(gltf::json::Scene {
        extensions: None,
        extras: None,
        name: None,
        nodes: roots,
    });
    root.scene = Some(Index::new(0));
    let Contents { buffer, unpacked } = shapes.data.finish(&mut root, packing.meshopt)?;
    let uri = format!("{stem}.bin");
    // There is no buffer without content.
    if !buffer.is_empty() {
        let uri = (container == Container::Separate).then(|| address(&uri));
        root.buffers.push(of_bytes(buffer.len(), uri));
    }
    if packing.quantize {
        require(&mut root, QUANTIZATION);
    }
    if unpacked > 0 {
        require(&mut root, COMPRESSION);
        let content = json!({ "fallback": true });
        root.buffers.push(Buffer {
            extensions: Some(gltf::json::extensions::buffer::Buffer {
                others: Map::from_iter([(COMPRESSION.to_owned(), content)]),
            }),
            ..of_bytes(unpacked, None)
        });
    }
    // Through a value: keys in the order of their names, and the place of all in full digits.
    let mut value = serde_json::to_value(&root)?;
    place.write_in_full(&mut value["nodes"][0]);
    let text = serde_json::to_vec(&compact(value))?;
    Ok(match container {
        Container::Binary => Export {
            bytes: binary(text, buffer)?,
            ..Export::default()
        },
        Container::Separate => Export {
            bytes: text,
            beside: Vec::from_iter((!buffer.is_empty()).then_some((uri, buffer))),
            ..Export::default()
        },
    })
}

/// A buffer of so many bytes.
fn of_bytes(count: usize, uri: Option<String>) -> Buffer {
    Buffer {
        byte_length: USize64::from(count),
        name: None,
        uri,
        extensions: None,
        extras: None,
    }
}

/// The extension for positions and normals that are not of single precision.
const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Names an extension without which the file cannot be shown.
fn require(root: &mut gltf::json::Root, extension: &str) {
    root.extensions_used.push(extension.to_owned());
    root.extensions_required.push(extension.to_owned());
}

/// Adds cameras and lights beside the node with the shapes.
fn add_views(
    scene: &Scene,
    world: &DAffine3,
    metres: f64,
    root: &mut gltf::json::Root,
    roots: &mut Vec<Index<Node>>,
) {
    let diagonal = scene.extent().diagonal();
    let mut nodes = Vec::new();
    for camera in &scene.cameras {
        nodes.push(look::add_camera(camera, world, metres, diagonal, root));
    }
    let mut lights = Vec::new();
    for light in &scene.lights {
        nodes.push(look::add_light(light, world, metres, &mut lights));
    }
    for node in nodes {
        roots.push(Index::new(number(root.nodes.len())));
        root.nodes.push(node);
    }
    if !lights.is_empty() {
        root.extensions_used.push("KHR_lights_punctual".to_owned());
        root.extensions = Some(gltf::json::extensions::root::Root {
            khr_lights_punctual: Some(gltf::json::extensions::root::KhrLightsPunctual { lights }),
            ..Default::default()
        });
    }
}

/// The same without empty lists and objects, which files may not have, but for the extension
/// that is one.
fn compact(value: Value) -> Value {
    match value {
        Value::Object(map) => {
            let kept = map.into_iter().map(|(k, v)| (k, compact(v)));
            let is_empty = |k: &str, v: &Value| {
                v.is_null()
                    || v.as_array().is_some_and(Vec::is_empty)
                    || v.as_object().is_some_and(Map::is_empty) && k != look::UNLIT
            };
            Value::Object(kept.filter(|(k, v)| !is_empty(k, v)).collect())
        }
        Value::Array(list) => Value::Array(list.into_iter().map(compact).collect()),
        other => other,
    }
}

/// Text and numbers in one file.
fn binary(mut text: Vec<u8>, mut numbers: Vec<u8>) -> std::io::Result<Vec<u8>> {
    text.resize(text.len().next_multiple_of(4), b' ');
    numbers.resize(numbers.len().next_multiple_of(4), 0);
    let chunk = if numbers.is_empty() { 0 } else { 8 };
    let length = 12 + 8 + text.len() + chunk + numbers.len();
    let size = |bytes: usize| {
        u32::try_from(bytes).map_err(|_| {
            let text = format!("{length} bytes; a .glb file holds less than 4 GiB, use .gltf");
            std::io::Error::new(std::io::ErrorKind::FileTooLarge, text)
        })
    };
    let mut file = Vec::new();
    file.extend(b"glTF");
    file.extend(2_u32.to_le_bytes());
    file.extend(size(length)?.to_le_bytes());
    file.extend(size(text.len())?.to_le_bytes());
    file.extend(b"JSON");
    file.extend(text);
    if !numbers.is_empty() {
        file.extend(size(numbers.len())?.to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(numbers);
    }
    Ok(file)
}
