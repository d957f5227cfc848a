//! Plain triangle formats: STL, PLY and OBJ. Everything stands where the scene shows it, in
//! the units of the scene.

use std::fmt::Write as _;

use formats::Export;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use kernel::{Mesh, Placement, Scene, Shape};

use crate::tessellate::Tessellation;

/// The triangles of a placement.
fn mesh<'a>(scene: &'a Scene, triangles: &'a Tessellation, at: &Placement) -> Option<&'a Mesh> {
    match at.shape {
        Shape::Patch(id) => triangles.faces[id.index()].as_ref().map(|face| &face.mesh),
        Shape::Mesh(id) => Some(scene.mesh(id)),
    }
}

/// The corners of a triangle in the order that a map leaves counter-clockwise.
fn turned([a, b, c]: [u32; 3], map: &DAffine3) -> [u32; 3] {
    if map.matrix3.determinant() < 0.0 {
        [a, c, b]
    } else {
        [a, b, c]
    }
}

/// The map of normals: inverse and transposed.
fn of_normals(map: &DAffine3) -> DMat3 {
    map.matrix3.inverse().transpose()
}

/// Binary STL.
pub(crate) fn stl(scene: &Scene, triangles: &Tessellation) -> Export {
    let mut body = Vec::new();
    let mut count: u32 = 0;
    for at in scene.placements() {
        let Some(mesh) = mesh(scene, triangles, &at) else {
            continue;
        };
        let map = &at.world_from_object;
        for &triangle in mesh.triangles() {
            let point = |k: u32| map.transform_point3(mesh.positions()[k as usize]);
            let corners = turned(triangle, map).map(point);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let vectors = [
                normal.normalize_or_zero(),
                corners[0],
                corners[1],
                corners[2],
            ];
            for number in vectors.iter().flat_map(|v| v.as_vec3().to_array()) {
                body.extend(number.to_le_bytes());
            }
            body.extend([0; 2]);
            count = count.saturating_add(1);
        }
    }
    let mut bytes = vec![b' '; 80];
    bytes[..7].copy_from_slice(b"nurbray");
    bytes.extend(count.to_le_bytes());
    bytes.extend(body);
    Export {
        bytes,
        ..Export::default()
    }
}

/// Binary PLY with normals and texture coordinates, zero where there are none.
#[expect(
    clippy::cast_possible_truncation,
    reason = "files hold single precision"
)]
pub(crate) fn ply(scene: &Scene, triangles: &Tessellation) -> Export {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let (mut first, mut count): (u32, u32) = (0, 0);
    for at in scene.placements() {
        let Some(mesh) = mesh(scene, triangles, &at) else {
            continue;
        };
        let map = &at.world_from_object;
        let normals = of_normals(map);
        for (k, &p) in mesh.positions().iter().enumerate() {
            let normal = mesh.normals().get(k).map_or(DVec3::ZERO, |n| normals * *n);
            let uv = mesh.uvs().get(k).copied().unwrap_or(DVec2::ZERO);
            let vectors = [map.transform_point3(p), normal.normalize_or_zero()];
            let numbers = vectors.iter().flat_map(|v| v.as_vec3().to_array());
            for number in numbers.chain([uv.x as f32, uv.y as f32]) {
                vertices.extend(number.to_le_bytes());
            }
        }
        for &triangle in mesh.triangles() {
            faces.push(3);
            for k in turned(triangle, map) {
                faces.extend((first + k).to_le_bytes());
            }
            count += 1;
        }
        first += u32::try_from(mesh.positions().len()).unwrap_or(u32::MAX);
    }
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {first}\n");
    for name in ["x", "y", "z", "nx", "ny", "nz", "s", "t"] {
        let _ = writeln!(header, "property float {name}");
    }
    let _ = writeln!(header, "element face {count}");
    header += "property list uchar uint vertex_indices\nend_header\n";
    let mut bytes = header.into_bytes();
    bytes.extend(vertices);
    bytes.extend(faces);
    Export {
        bytes,
        ..Export::default()
    }
}

/// OBJ with a group for each placement.
pub(crate) fn obj(scene: &Scene, triangles: &Tessellation) -> Export {
    let mut text = String::from("# triangles by nurbray\n");
    let (mut point, mut normal, mut texture) = (1_usize, 1_usize, 1_usize);
    for (number, at) in scene.placements().iter().enumerate() {
        let Some(mesh) = mesh(scene, triangles, at) else {
            continue;
        };
        let map = &at.world_from_object;
        let normals = of_normals(map);
        let name: String = mesh.name.split_whitespace().collect::<Vec<_>>().join("_");
        // Writing into a string cannot fail.
        let _ = writeln!(text, "g {name}#{number}");
        for &p in mesh.positions() {
            let p = map.transform_point3(p);
            let _ = writeln!(text, "v {:?} {:?} {:?}", p.x, p.y, p.z);
        }
        for uv in mesh.uvs() {
            let _ = writeln!(text, "vt {:?} {:?}", uv.x, uv.y);
        }
        for &n in mesh.normals() {
            let n = (normals * n).normalize_or_zero().as_vec3();
            let _ = writeln!(text, "vn {:?} {:?} {:?}", n.x, n.y, n.z);
        }
        for &triangle in mesh.triangles() {
            text.push('f');
            for k in turned(triangle, map).map(|k| k as usize) {
                let _ = match (mesh.uvs().is_empty(), mesh.normals().is_empty()) {
                    (true, true) => write!(text, " {}", point + k),
                    (false, true) => write!(text, " {}/{}", point + k, texture + k),
                    (true, false) => write!(text, " {}//{}", point + k, normal + k),
                    (false, false) => {
                        write!(text, " {}/{}/{}", point + k, texture + k, normal + k)
                    }
                };
            }
            text.push('\n');
        }
        point += mesh.positions().len();
        texture += mesh.uvs().len();
        normal += mesh.normals().len();
    }
    Export {
        bytes: text.into_bytes(),
        ..Export::default()
    }
}
