//! Plain formats of polygons: STL, PLY and OBJ. Everything stands where the scene shows it, in
//! the units of the scene.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::io;

use formats::Export;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use kernel::{Mesh, Scene, Shape, WireId};

use crate::accuracy::SINGLE;
use crate::tessellate::Tessellation;

/// Triangles, and where they stand.
type Placed<'a> = (Shape, &'a Mesh, DAffine3);

/// Triangles, once for each place.
fn placed<'a>(scene: &'a Scene, triangles: &'a Tessellation) -> Vec<Placed<'a>> {
    let meshes = scene.placements().into_iter().map(|at| {
        let mesh = match at.shape {
            Shape::Patch(id) => &triangles.faces[id.index()].as_ref()?.mesh,
            Shape::Mesh(id) => scene.mesh(id),
        };
        Some((at.shape, mesh, at.world_from_object))
    });
    meshes.flatten().collect()
}

/// How much there is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Amount {
    /// Corners of triangles, each once in its mesh, and ends of lines.
    pub points: u64,
    /// Triangles.
    pub triangles: u64,
}

impl Amount {
    /// All that a scene shows: each mesh once, and once for each place; with the points of lines if
    /// `lines` are shown.
    ///
    /// # Panics
    /// If the triangles are not those of the scene as it is.
    pub fn of(scene: &Scene, triangles: &Tessellation, lines: bool) -> [Self; 2] {
        assert!(triangles.is_of(scene), "{}", Tessellation::FOREIGN);
        let placed = placed(scene, triangles);
        let mut known = HashSet::new();
        let stored = placed.iter().filter(|(shape, ..)| known.insert(*shape));
        let mut sums = [Self::sum(stored), Self::sum(&placed)];
        if lines {
            let count = |wire: WireId| {
                let strip = triangles.strips[wire.index()].as_ref();
                strip.map_or(0, |strip| strip.points.len() as u64)
            };
            let placed = scene.wire_placements();
            let mut known = HashSet::new();
            let stored = placed.iter().filter(|at| known.insert(at.wire));
            sums[0].points += stored.map(|at| count(at.wire)).sum::<u64>();
            sums[1].points += placed.iter().map(|at| count(at.wire)).sum::<u64>();
        }
        sums
    }

    fn sum<'a>(placed: impl IntoIterator<Item = &'a Placed<'a>>) -> Self {
        let mut sum = Self::default();
        for (_, mesh, _) in placed {
            sum.points += mesh.positions().len() as u64;
            sum.triangles += mesh.triangles().len() as u64;
        }
        sum
    }
}

/// How far single precision moves a point of a scene at most.
pub(crate) fn rounding(scene: &Scene) -> f64 {
    let bounds = scene.extent();
    SINGLE * bounds.min.abs().max(bounds.max.abs()).length()
}

/// A number as binary files count.
fn count(number: u64, what: &str) -> io::Result<u32> {
    u32::try_from(number).map_err(|_| {
        let text = format!("{number} {what} are more than the format can count");
        io::Error::new(io::ErrorKind::FileTooLarge, text)
    })
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
///
/// # Errors
/// If there are too many triangles.
pub(crate) fn stl(scene: &Scene, triangles: &Tessellation) -> io::Result<Export> {
    let placed = placed(scene, triangles);
    let shown = Amount::sum(&placed);
    let mut bytes = vec![b' '; 80];
    bytes[..7].copy_from_slice(b"nurbray");
    bytes.extend(count(shown.triangles, "triangles")?.to_le_bytes());
    for (_, mesh, map) in &placed {
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
                bytes.extend(number.to_le_bytes());
            }
            bytes.extend([0; 2]);
        }
    }
    Ok(Export {
        bytes,
        ..Export::default()
    })
}

/// Binary PLY with normals and texture coordinates, zero where there are none.
///
/// # Errors
/// If there are too many points.
#[expect(
    clippy::cast_possible_truncation,
    reason = "files hold single precision"
)]
pub(crate) fn ply(scene: &Scene, triangles: &Tessellation) -> io::Result<Export> {
    let placed = placed(scene, triangles);
    let shown = Amount::sum(&placed);
    let (points, faces) = (
        count(shown.points, "points")?,
        count(shown.triangles, "triangles")?,
    );
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {points}\n");
    for name in ["x", "y", "z", "nx", "ny", "nz", "s", "t"] {
        let _ = writeln!(header, "property float {name}");
    }
    let _ = writeln!(header, "element face {faces}");
    header += "property list uchar uint vertex_indices\nend_header\n";
    let mut bytes = header.into_bytes();
    for (_, mesh, map) in &placed {
        let normals = of_normals(map);
        for (k, &p) in mesh.positions().iter().enumerate() {
            let normal = mesh.normals().get(k).map_or(DVec3::ZERO, |n| normals * *n);
            let uv = mesh.uvs().get(k).copied().unwrap_or(DVec2::ZERO);
            let vectors = [map.transform_point3(p), normal.normalize_or_zero()];
            let numbers = vectors.iter().flat_map(|v| v.as_vec3().to_array());
            for number in numbers.chain([uv.x as f32, uv.y as f32]) {
                bytes.extend(number.to_le_bytes());
            }
        }
    }
    let mut first: u32 = 0;
    for (_, mesh, map) in &placed {
        for &triangle in mesh.triangles() {
            bytes.push(3);
            for k in turned(triangle, map) {
                bytes.extend((first + k).to_le_bytes());
            }
        }
        // All together fit: they have been counted.
        first += mesh.positions().len() as u32;
    }
    Ok(Export {
        bytes,
        ..Export::default()
    })
}

/// OBJ with a group for each placement: triangles first, then lines and points.
pub(crate) fn obj(scene: &Scene, triangles: &Tessellation) -> Export {
    let mut text = String::from("# triangles by nurbray\n");
    let (mut point, mut normal, mut texture) = (1_usize, 1_usize, 1_usize);
    let placed = placed(scene, triangles);
    for (number, (_, mesh, map)) in placed.iter().enumerate() {
        let normals = of_normals(map);
        group(&mut text, (&mesh.name, number), mesh.positions(), map);
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
    for (number, at) in (placed.len()..).zip(scene.wire_placements()) {
        let wire = scene.wire(at.wire);
        let Some((points, has_lines)) = triangles.thread(scene, at.wire) else {
            continue;
        };
        group(
            &mut text,
            (&wire.name, number),
            points,
            &at.world_from_object,
        );
        text.push(if has_lines { 'l' } else { 'p' });
        for _ in points {
            let _ = write!(text, " {point}");
            point += 1;
        }
        text.push('\n');
    }
    Export {
        bytes: text.into_bytes(),
        ..Export::default()
    }
}

/// Begins a group with its points.
fn group(text: &mut String, (name, number): (&str, usize), points: &[DVec3], map: &DAffine3) {
    let name: String = name.split_whitespace().collect::<Vec<_>>().join("_");
    // Writing into a string cannot fail.
    let _ = writeln!(text, "g {name}#{number}");
    for &p in points {
        let p = map.transform_point3(p);
        let _ = writeln!(text, "v {:?} {:?} {:?}", p.x, p.y, p.z);
    }
}
