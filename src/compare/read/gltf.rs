//! glTF 2.0 and GLB, as far as triangles go.
//!
//! The crate `gltf` takes the file apart. Its own checks run out of the lists of files with
//! wrong numbers, so each is looked up where it is used, and counts and offsets are checked
//! against the bytes that are there. It keeps places in single precision; they are read beside
//! it with all their digits.

use std::collections::BTreeMap;

use ::gltf::json::mesh::{Mode, Semantic};
use ::gltf::json::validation::Checked;
use ::gltf::json::{self, Root};
use formats::{Error, Limits, Place, Problem, Resolver, Warnings};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use kernel::{Child, Mesh, Node, NodeId, Scene, UpAxis};
use serde_json::Value;

use super::accessor::Numbers;
use super::container::{buffer_bytes, parts};
use super::{MeshFile, add_meshes, error};
use crate::compare::align::Frame;
use crate::gltf::meshopt::COMPRESSION;

pub(super) const NAME: &str = "glTF";

const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Extensions that may be required: those that are read, and those that change no shape.
const KNOWN: &[&str] = &[
    COMPRESSION,
    INSTANCING,
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

pub(super) fn invalid(what: impl Into<String>, text: impl Into<String>) -> Error {
    error(NAME, what, Problem::Invalid(text.into()))
}

/// Reads a file; `files` fetches the buffers beside it.
pub(super) fn read(bytes: &[u8], files: &dyn Resolver, limits: &Limits) -> Result<MeshFile, Error> {
    let (text, chunk) = parts(bytes)?;
    let wrong = |e: serde_json::Error| Error {
        format: NAME,
        place: Place::line(e.line()),
        problem: Problem::Invalid(e.to_string()),
    };
    let mut exact: Value = serde_json::from_slice(&text).map_err(wrong)?;
    let root = if add_missing_nodes(&mut exact) {
        serde_json::from_value(exact.clone())
    } else {
        Root::from_slice(&text)
    };
    let root = root.map_err(wrong)?;
    for name in &root.extensions_required {
        if !KNOWN.contains(&name.as_str()) {
            let text = format!("the extension {name}, which the file requires, is not read");
            return Err(error(
                NAME,
                "extensionsRequired",
                Problem::Unsupported(text),
            ));
        }
    }
    let mut reader = Reader {
        root: &root,
        places: list(&exact, "nodes"),
        numbers: Numbers {
            root: &root,
            buffers: Vec::new(),
            unpacked: BTreeMap::new(),
            limits,
        },
        scene: Scene::default(),
        warnings: Warnings::default(),
        points: 0,
        placed: 0,
        limits,
    };
    let mut size = bytes.len() as u64;
    for (number, buffer) in root.buffers.iter().enumerate() {
        let uri = buffer.uri.as_deref();
        let extensions = buffer.extensions.as_ref();
        let compression = extensions.and_then(|e| e.others.get(COMPRESSION));
        // Holds nothing but what compressed views would be.
        if uri.is_none() && compression.is_some_and(|c| c["fallback"] == true) {
            reader.numbers.buffers.push(Vec::new());
            continue;
        }
        let data = buffer_bytes(uri, number, chunk.as_deref(), files)?;
        if uri.is_some_and(|uri| !uri.starts_with("data:")) {
            size += data.len() as u64;
        }
        reader.numbers.buffers.push(data);
    }
    reader.numbers.unpack()?;
    reader.tree()?;
    let extras = &exact["asset"]["extras"];
    let claims = ["proven_deviation_m", "sampled_deviation_m"].map(|key| extras[key].as_f64());
    Ok(MeshFile {
        format: NAME,
        scene: reader.scene,
        frame: Frame {
            metres: Some(1.0),
            up: Some(UpAxis::Y),
        },
        bytes: size,
        claim: claims[0]
            .zip(claims[1])
            .map(|(proven, sampled)| [proven, sampled]),
        warnings: reader.warnings,
    })
}

/// Gives an empty list of nodes to scenes without one, which the crate asks for and the format
/// does not; tells whether there were such scenes.
fn add_missing_nodes(file: &mut Value) -> bool {
    let scenes = file.get_mut("scenes").and_then(Value::as_array_mut);
    let scenes = scenes
        .into_iter()
        .flatten()
        .filter_map(Value::as_object_mut);
    let bare = scenes.filter(|scene| !scene.contains_key("nodes"));
    let none = || Value::Array(Vec::new());
    bare.map(|scene| scene.insert("nodes".to_owned(), none()))
        .count()
        > 0
}

fn list<'v>(value: &'v Value, key: &str) -> &'v [Value] {
    value[key].as_array().map_or(&[], Vec::as_slice)
}

struct Reader<'a> {
    root: &'a Root,
    /// The nodes, with all digits.
    places: &'a [Value],
    numbers: Numbers<'a>,
    scene: Scene,
    warnings: Warnings,
    points: usize,
    placed: u64,
    limits: &'a Limits,
}

/// A node of the file of which not all children are made.
struct Open {
    index: usize,
    depth: usize,
    /// What is left of them, the last one first.
    children: Vec<usize>,
    node: Node,
}

impl Reader<'_> {
    /// Builds the tree of the scene that is shown; without one all nodes without a parent.
    fn tree(&mut self) -> Result<(), Error> {
        let nodes = &self.root.nodes;
        let shown = self.root.scene.map_or(0, |scene| scene.value());
        let children = |node: &json::Node| -> Vec<usize> {
            let children = node.children.iter().flatten();
            children.map(json::Index::value).collect()
        };
        let tops: Vec<usize> = match self.root.scenes.get(shown) {
            Some(scene) => scene.nodes.iter().map(json::Index::value).collect(),
            None => {
                let mut tops = vec![true; nodes.len()];
                for below in nodes.iter().flat_map(children) {
                    if let Some(top) = tops.get_mut(below) {
                        *top = false;
                    }
                }
                (0..nodes.len()).filter(|&k| tops[k]).collect()
            }
        };
        let mut meshes: Vec<Option<NodeId>> = vec![None; self.root.meshes.len()];
        let geometry = |e| error(NAME, "nodes", Problem::Geometry(e));
        let mut open = vec![Open {
            index: usize::MAX,
            depth: 0,
            children: tops.into_iter().rev().collect(),
            node: Node::default(),
        }];
        // A tree has no more nodes than there are; what passes that is no tree.
        let mut visited = 0;
        while let Some(top) = open.last_mut() {
            if let Some(index) = top.children.pop() {
                let depth = top.depth + 1;
                visited += 1;
                let value = nodes.get(index).filter(|_| visited <= nodes.len());
                let value = value.filter(|_| depth <= self.limits.nesting.max(1));
                let place = || format!("node {index}");
                let value = value
                    .ok_or_else(|| invalid(place(), "it is not there, or the nodes are no tree"))?;
                let node = self.node(value, index, &mut meshes)?;
                open.push(Open {
                    index,
                    depth,
                    children: children(value).into_iter().rev().collect(),
                    node,
                });
                continue;
            }
            let Some(Open { index, node, .. }) = open.pop() else {
                break;
            };
            match self.scene.add_node(node) {
                Ok(id) => match open.last_mut() {
                    Some(parent) => parent.node.children.push(Child::Node(id)),
                    None => self.scene.set_root(id).map_err(geometry)?,
                },
                // Nothing can be seen of what has no extent.
                Err(problem) => {
                    let place = Place::item(0, format!("node {index}"));
                    self.warnings.invalid(place, problem.to_string());
                }
            }
        }
        Ok(())
    }

    /// A node without its children.
    fn node(
        &mut self,
        value: &json::Node,
        index: usize,
        meshes: &mut [Option<NodeId>],
    ) -> Result<Node, Error> {
        let mut node = Node {
            name: value.name.clone().unwrap_or_default(),
            parent_from_node: self.places.get(index).map_or(DAffine3::IDENTITY, place),
            ..Node::default()
        };
        let Some(mesh) = value.mesh else {
            return Ok(node);
        };
        let mesh = mesh.value();
        let place = format!("node {index}");
        let known = meshes
            .get(mesh)
            .ok_or_else(|| invalid(&place, format!("mesh {mesh} is not there")))?;
        let geometry = |e| error(NAME, &place, Problem::Geometry(e));
        let id = match known {
            Some(id) => *id,
            None => {
                let parts = self.mesh(mesh)?;
                let holder = add_meshes(&mut self.scene, Node::default(), parts);
                let id = self
                    .scene
                    .add_node(holder.map_err(geometry)?)
                    .map_err(geometry)?;
                meshes[mesh] = Some(id);
                id
            }
        };
        let extensions = value.extensions.as_ref();
        let instances = extensions.and_then(|e| e.others.get(INSTANCING)?.get("attributes"));
        let Some(instances) = instances else {
            self.count(1)?;
            node.children.push(Child::Node(id));
            return Ok(node);
        };
        for parent_from_node in self.instances(instances, &place)? {
            let children = vec![Child::Node(id)];
            let at = Node {
                parent_from_node,
                children,
                ..Node::default()
            };
            node.children
                .push(Child::Node(self.scene.add_node(at).map_err(geometry)?));
        }
        Ok(node)
    }

    fn count(&mut self, more: u64) -> Result<(), Error> {
        self.placed = self.placed.saturating_add(more);
        if self.placed > self.limits.placements {
            let text = format!("more than {} meshes are shown", self.limits.placements);
            return Err(error(NAME, "nodes", Problem::TooLarge(text)));
        }
        Ok(())
    }

    /// The places of a mesh that is shown many times.
    fn instances(&mut self, attributes: &Value, place: &str) -> Result<Vec<DAffine3>, Error> {
        let mut lists = Vec::new();
        for (name, width) in [("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3)] {
            let index = attributes[name].as_u64();
            let index = index.map(|k| usize::try_from(k).unwrap_or(usize::MAX));
            let numbers = index.map(|k| self.numbers.of(k, width, place));
            lists.push(numbers.transpose()?);
        }
        let [moves, turns, scales] = [0, 1, 2].map(|k| lists[k].as_deref());
        let counts = [(moves, 3), (turns, 4), (scales, 3)];
        let counts = counts
            .iter()
            .filter_map(|(l, n)| Some(l.as_ref()?.len() / n));
        let count = counts.min().unwrap_or(0);
        self.count(count as u64)?;
        let vector = |list: Option<&[f64]>, k: usize, other: DVec3| {
            list.map_or(other, |l| DVec3::from_slice(&l[3 * k..]))
        };
        let map = |k: usize| {
            let turn = turns.map_or(DQuat::IDENTITY, |l| DQuat::from_slice(&l[4 * k..]));
            DAffine3::from_scale_rotation_translation(
                vector(scales, k, DVec3::ONE),
                turn.normalize(),
                vector(moves, k, DVec3::ZERO),
            )
        };
        Ok((0..count).map(map).collect())
    }

    /// The primitives of a mesh that are triangles.
    fn mesh(&mut self, number: usize) -> Result<Vec<Mesh>, Error> {
        let Some(mesh) = self.root.meshes.get(number) else {
            return Ok(Vec::new());
        };
        let mut parts = Vec::new();
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("mesh {number}, primitive {k}");
            let mode = match primitive.mode {
                Checked::Valid(mode) if is_area(mode) => mode,
                _ => {
                    let text = "points and lines are not a part of the mesh";
                    self.warnings.unsupported(Place::item(0, place), text);
                    continue;
                }
            };
            if primitive.targets.is_some() {
                let text = "the mesh is taken as it is before it is morphed";
                self.warnings
                    .unsupported(Place::item(0, place.clone()), text);
            }
            let attribute = |semantic| {
                let index = primitive.attributes.get(&Checked::Valid(semantic));
                index.map(json::Index::value)
            };
            let vectors = |numbers: Vec<f64>| -> Vec<DVec3> {
                numbers.chunks_exact(3).map(DVec3::from_slice).collect()
            };
            let positions = attribute(Semantic::Positions)
                .ok_or_else(|| invalid(&place, "it has no POSITION"))?;
            let positions = vectors(self.numbers.of(positions, 3, &place)?);
            let normals = match attribute(Semantic::Normals) {
                None => Vec::new(),
                Some(index) => vectors(self.numbers.of(index, 3, &place)?),
            };
            self.points += positions.len();
            if self.points > self.limits.points {
                let text = format!("more than {} vertices", self.limits.points);
                return Err(error(NAME, place, Problem::TooLarge(text)));
            }
            let indices: Vec<u32> = match primitive.indices {
                None => (0..).take(positions.len()).collect(),
                Some(index) => {
                    let numbers = self.numbers.of(index.value(), 1, &place)?;
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "what is no vertex is refused with the mesh"
                    )]
                    numbers.into_iter().map(|k| k as u32).collect()
                }
            };
            let triangles = triangles(mode, &indices);
            let made = Mesh::new(positions, normals, Vec::new(), triangles);
            let mut made = made.map_err(|e| error(NAME, &place, Problem::Geometry(e)))?;
            made.name = mesh.name.clone().unwrap_or_default();
            made.source = place;
            parts.push(made);
        }
        Ok(parts)
    }
}

/// Whether such primitives are triangles.
fn is_area(mode: Mode) -> bool {
    matches!(
        mode,
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
    )
}

/// Where a node stands in its parent.
fn place(value: &Value) -> DAffine3 {
    let numbers =
        |key: &str| -> Vec<f64> { list(value, key).iter().filter_map(Value::as_f64).collect() };
    let matrix = numbers("matrix");
    if let Ok(columns) = <[f64; 16]>::try_from(matrix) {
        return DAffine3::from_mat4(DMat4::from_cols_array(&columns));
    }
    let vector = |key: &str, other: DVec3| match numbers(key)[..] {
        [x, y, z] => DVec3::new(x, y, z),
        _ => other,
    };
    let turn = match numbers("rotation")[..] {
        [x, y, z, w] => DQuat::from_xyzw(x, y, z, w).normalize(),
        _ => DQuat::IDENTITY,
    };
    DAffine3::from_scale_rotation_translation(
        vector("scale", DVec3::ONE),
        turn,
        vector("translation", DVec3::ZERO),
    )
}

/// The corners of triangles, strips and fans.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    let windows = || indices.windows(3).map(|w| [w[0], w[1], w[2]]);
    match mode {
        Mode::TriangleStrip => {
            let turned =
                |(k, [a, b, c]): (usize, [u32; 3])| if k % 2 == 0 { [a, b, c] } else { [b, a, c] };
            windows().enumerate().map(turned).collect()
        }
        Mode::TriangleFan => {
            let rest = indices.get(1..).unwrap_or_default().windows(2);
            rest.map(|w| [indices[0], w[0], w[1]]).collect()
        }
        _ => indices
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use base64::Engine as _;
    use formats::NoFiles;
    use serde_json::json;

    use super::*;
    use crate::gltf::meshopt;

    /// A triangle, in metres with Y upwards.
    fn file() -> Value {
        let numbers = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let coded = base64::engine::general_purpose::STANDARD.encode(bytes);
        json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "children": [1], "scale": [2, 2, 2] }, { "mesh": 0, "translation": [1, 0, 0] }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
            "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
            "buffers": [{ "byteLength": 36, "uri": format!("data:application/octet-stream;base64,{coded}") }],
        })
    }

    fn parsed(file: &Value) -> Result<MeshFile, String> {
        read(file.to_string().as_bytes(), &NoFiles, &Limits::default()).map_err(|e| e.to_string())
    }

    #[test]
    fn triangles_stand_where_the_nodes_place_them() {
        let scene = parsed(&file()).unwrap().scene;
        let bounds = scene.hull_bounds();
        assert_eq!(
            (bounds.min, bounds.max),
            (DVec3::X * 2.0, DVec3::new(4.0, 2.0, 0.0))
        );
        assert_eq!(scene.meshes()[0].triangles(), [[0, 1, 2]]);
        assert_eq!(
            triangles(Mode::TriangleStrip, &[0, 1, 2, 3]),
            [[0, 1, 2], [2, 1, 3]]
        );
        assert_eq!(
            triangles(Mode::TriangleFan, &[0, 1, 2, 3]),
            [[0, 1, 2], [0, 2, 3]]
        );
    }

    #[test]
    fn compressed_views_are_unpacked() {
        let numbers = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let points = meshopt::vertices(&bytes, 12).unwrap().bytes;
        let corners = meshopt::triangles(&[2, 0, 1]).unwrap().bytes;
        let coded =
            base64::engine::general_purpose::STANDARD.encode([&points[..], &corners].concat());
        let mut file = file();
        file["buffers"] = json!([
            { "byteLength": points.len() + corners.len(),
              "uri": format!("data:application/octet-stream;base64,{coded}") },
            { "byteLength": 48, "extensions": { COMPRESSION: { "fallback": true } } },
        ]);
        file["bufferViews"] = json!([
            { "buffer": 1, "byteLength": 36, "extensions": { COMPRESSION: {
                "buffer": 0, "byteLength": points.len(), "byteStride": 12, "count": 3,
                "mode": "ATTRIBUTES" } } },
            { "buffer": 1, "byteOffset": 36, "byteLength": 12, "extensions": { COMPRESSION: {
                "buffer": 0, "byteOffset": points.len(), "byteLength": corners.len(),
                "byteStride": 4, "count": 3, "mode": "TRIANGLES" } } },
        ]);
        let corners =
            json!({ "bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR" });
        file["accessors"].as_array_mut().unwrap().push(corners);
        file["meshes"][0]["primitives"][0]["indices"] = json!(1);
        file["extensionsRequired"] = json!([COMPRESSION]);
        let read = parsed(&file).unwrap().scene;
        let mesh = &read.meshes()[0];
        assert_eq!(mesh.positions(), [DVec3::ZERO, DVec3::X, DVec3::Y]);
        let corners = mesh.triangles()[0];
        assert!([[0, 1, 2], [1, 2, 0], [2, 0, 1]].contains(&corners));
        let wrong = |key: &str, value: Value, text: &str| {
            let mut file = file.clone();
            file["bufferViews"][0]["extensions"][COMPRESSION][key] = value;
            let found = parsed(&file).map(|_| ()).unwrap_err();
            assert!(found.contains(text), "{key}: {found}");
        };
        wrong("byteLength", json!(9999), "lead out of the buffer");
        wrong("byteOffset", json!(1), "its bytes are no ATTRIBUTES");
        wrong("count", json!(u64::MAX), "the limit is");
        wrong("count", json!(999), "its bytes are no ATTRIBUTES");
        wrong("byteStride", json!(13), "ATTRIBUTES of 13 bytes");
        wrong("mode", json!("INDICES"), "INDICES of 12 bytes");
        wrong("filter", json!("QUATERNION"), "the filter QUATERNION");
    }

    #[test]
    fn a_hostile_file_is_refused_with_its_place() {
        let wrong = |pointer: &str, value: Value, text: &str| {
            let mut file = file();
            *file.pointer_mut(pointer).unwrap() = value;
            let found = parsed(&file).map(|_| ()).unwrap_err();
            assert!(found.contains(text), "{pointer}: {found}");
        };
        wrong("/accessors/0/count", json!(4), "4 elements do not fit");
        wrong("/accessors/0/count", json!(u64::MAX), "do not fit");
        wrong("/accessors/0/type", json!("VEC2"), "its type is");
        wrong("/accessors/0/componentType", json!(7), "its componentType");
        wrong(
            "/bufferViews/0/byteLength",
            json!(99),
            "leads out of the buffer",
        );
        wrong("/nodes/1/mesh", json!(3), "mesh 3 is not there");
        wrong("/nodes/0/children", json!([1, 1]), "no tree");
        wrong("/nodes/0/children", json!([0]), "no tree");
        wrong("/scenes/0/nodes", json!([9]), "node 9");
        wrong("/buffers/0/uri", json!("../secret.bin"), "secret.bin");
        wrong("/buffers/0/uri", json!("data:,text"), "not base64");
        wrong(
            "/meshes/0/primitives/0/attributes",
            json!({}),
            "it has no POSITION",
        );
        let huge = b"glTF\x02\0\0\0\xff\xff\xff\xff\xff\xff\xff\x7fJSON";
        assert!(read(huge, &NoFiles, &Limits::default()).is_err());
    }
}
