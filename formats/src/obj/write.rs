//! From scene to OBJ: free-form surfaces as they are, polygons, and materials beside them.
//!
//! OBJ has no nodes: everything is written in the coordinates of the world, once for each place
//! where it stands, in a group with the innermost name around it.

use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DMat3, DVec2, DVec3};
use kernel::{
    Curve, KnotVector, MaterialId, Mesh, NodeId, Patch, Placement, Scene, Seam, SeamSide, Shape,
    TrimLoop, UpAxis, WireShape, nesting, srgb_from_linear,
};

mod materials;

use super::FORMAT;
use crate::write::{
    Export, Writer, has_weights, lost_patches, push_number, tell_clear_vertices, tell_voids, turn,
};
use crate::{Error, Place, Warnings};

/// The row of this format.
pub(crate) const WRITER: Writer = Writer {
    name: FORMAT.name,
    extensions: FORMAT.extensions,
    write,
};

fn write(scene: &Scene, stem: &str) -> Result<Export, Error> {
    let mut writer = Text {
        text: format!("# nurbray {}: {stem}\n", env!("CARGO_PKG_VERSION")),
        ..Text::default()
    };
    let library = format!("{}.mtl", legal(stem));
    let placements = scene.placements();
    let wires = scene.wire_placements();
    let materials = materials::names(scene, &placements, &wires);
    if !materials.is_empty() {
        writer.text += &format!("mtllib {library}\n");
    }
    let turn = DAffine3::from_mat3(turn(scene.up, UpAxis::Y));
    let mut state = (String::new(), None);
    let mut surfaces = HashMap::new();
    let lost = lost_patches(scene, &mut writer.warnings);
    for placement in placements.iter().filter(|p| !lost.contains(&p.shape)) {
        let own = match placement.shape {
            Shape::Patch(id) => &scene.patch(id).name,
            Shape::Mesh(id) => &scene.mesh(id).name,
        };
        let name = name(scene, &placement.path, own, &mut writer.warnings);
        let material = placement.material.map_or("", |id| materials[&id].as_str());
        writer.state(&mut state, name, placement.material, material);
        let world = turn * placement.world_from_object;
        match placement.shape {
            Shape::Patch(id) => {
                let patch = scene.patch(id);
                let has_maps = |id| !scene.material(id).maps.is_empty();
                let is_textured = placement.material.is_some_and(has_maps);
                let texture = materials::coordinates(patch, is_textured);
                let texture = texture.unwrap_or_else(|what| {
                    let text = format!("{what}: not written");
                    writer
                        .warnings
                        .unsupported(Place::item(0, format!("\"{}\"", patch.name)), text);
                    None
                });
                writer.patch(patch, texture.as_deref(), &world);
                // What stands twice cannot be named by one number.
                let known = surfaces.insert(id, Some(writer.surfaces));
                if known.is_some() {
                    surfaces.insert(id, None);
                }
            }
            Shape::Mesh(id) => writer.mesh(scene.mesh(id), &world),
        }
    }
    for placement in &wires {
        let wire = scene.wire(placement.wire);
        let name = name(scene, &placement.path, &wire.name, &mut writer.warnings);
        let material = wire.material.map_or("", |id| materials[&id].as_str());
        writer.state(&mut state, name, wire.material, material);
        writer.wire(&wire.shape, &(turn * placement.world_from_object));
    }
    for seam in scene.seams() {
        let number = |side: &SeamSide| surfaces.get(&side.patch).copied().flatten();
        if let [Some(a), Some(b)] = seam.sides.each_ref().map(number) {
            writer.seam(seam, [a, b]);
        }
    }
    tell_losses(scene, &placements, &mut writer.warnings);
    let mut beside = Vec::new();
    if !materials.is_empty() {
        let text = materials::file(scene, &materials, &mut writer.warnings);
        beside.push((library, text.into_bytes()));
    }
    Ok(Export {
        bytes: writer.text.into_bytes(),
        beside,
        warnings: writer.warnings,
    })
}

/// Notes what the format cannot hold.
fn tell_losses(scene: &Scene, placements: &[Placement], warnings: &mut Warnings) {
    let what = [
        (scene.cameras.len(), "cameras"),
        (scene.lights.len(), "lights"),
        (
            usize::from(scene.background.is_some() || scene.sky.is_some()),
            "the background",
        ),
    ];
    for (_, what) in what.into_iter().filter(|(count, _)| *count > 0) {
        let text = "OBJ files hold no cameras, lights and backgrounds; they are left out";
        warnings.unsupported(Place::item(0, what), text);
    }
    if let Some(unit) = &scene.unit {
        let text = "OBJ files have no unit of length; their numbers stay as they are";
        warnings.unsupported(Place::item(0, format!("the unit {}", unit.name)), text);
    }
    tell_voids(scene, warnings);
    tell_clear_vertices(scene, warnings);
    let mut shown = HashSet::new();
    for placement in placements.iter().filter(|p| !shown.insert(p.shape)) {
        let text = "OBJ files hold no instances; it is written again for every further place";
        let name = scene.name_at(placement);
        warnings.unsupported(Place::item(0, format!("\"{name}\"")), text);
    }
}

/// The name of a shape, or of the innermost node around it that has one.
fn name(scene: &Scene, path: &[NodeId], own: &str, warnings: &mut Warnings) -> String {
    let nodes = path.iter().map(|&id| scene.node(id).name.as_str());
    let mut names: Vec<_> = nodes.chain([own]).filter(|name| !name.is_empty()).collect();
    names.dedup();
    if let [.., outer, _] = names[..] {
        let place = Place::item(0, format!("node \"{outer}\""));
        let text = "OBJ files have one name for a surface; those of the nodes around are left out";
        warnings.unsupported(place, text);
    }
    legal(names.last().unwrap_or(&""))
}

/// A name without what ends or continues a line.
fn legal(name: &str) -> String {
    let is_bad = |c: char| c.is_control() || matches!(c, '#' | '\\');
    name.trim().replace(is_bad, "_")
}

/// Appends a statement with numbers.
fn push_line(text: &mut String, keyword: &str, values: impl IntoIterator<Item = f64>) {
    *text += keyword;
    for value in values {
        text.push(' ');
        push_number(text, value);
    }
    text.push('\n');
}

/// How many words of a long statement stand on a line.
const WORDS: usize = 16;

/// The statements so far, and how many of each kind that has numbers.
#[derive(Clone, Debug, Default)]
struct Text {
    text: String,
    warnings: Warnings,
    vertices: usize,
    parameters: usize,
    texture: usize,
    normals: usize,
    curves: usize,
    surfaces: usize,
}

impl Text {
    /// Appends a statement of any length, in several lines if need be.
    fn statement(&mut self, keyword: &str, words: &[String]) {
        self.text += keyword;
        for (index, word) in words.iter().enumerate() {
            if index > 0 && index % WORDS == 0 {
                self.text += " \\\n ";
            }
            self.text.push(' ');
            self.text += word;
        }
        self.text.push('\n');
    }

    /// Appends group and material where they are not those of what came before.
    fn state(
        &mut self,
        before: &mut (String, Option<MaterialId>),
        group: String,
        id: Option<MaterialId>,
        material: &str,
    ) {
        if before.0 != group {
            self.text += format!("g {group}").trim_end();
            self.text.push('\n');
            before.0 = group;
        }
        if before.1 != id {
            self.text += format!("usemtl {material}").trim_end();
            self.text.push('\n');
            before.1 = id;
        }
    }

    /// Appends type and degrees of what follows.
    fn kind(&mut self, is_rational: bool, degrees: &[usize]) {
        self.text += if is_rational {
            "cstype rat bspline\n"
        } else {
            "cstype bspline\n"
        };
        self.statement("deg", &texts(degrees));
    }

    /// Appends the knots of one direction.
    fn knots(&mut self, direction: &str, knots: &KnotVector) {
        let words = [vec![direction.to_owned()], numbers(knots.as_slice())].concat();
        self.statement("parm", &words);
    }

    /// A surface with its loops.
    fn patch(&mut self, patch: &Patch, texture: Option<&[DVec2]>, world: &DAffine3) {
        let mut loops = Vec::new();
        for nest in nesting(&patch.loops, patch.surface.periods()) {
            loops.push(("trim", self.curves(&patch.loops[nest.outer])));
            for hole in nest.holes {
                loops.push(("hole", self.curves(&patch.loops[hole])));
            }
        }
        let surface = patch.surface.transformed(world);
        let (u, v) = (surface.knots_u(), surface.knots_v());
        let is_rational = has_weights(surface.weights());
        let (points, weights): (Vec<_>, Vec<_>) = surface.points().zip(surface.weights()).unzip();
        let mut words = numbers(&[
            u.domain().start,
            u.domain().end,
            v.domain().start,
            v.domain().end,
        ]);
        for j in 0..v.count() {
            for k in (j..points.len()).step_by(v.count()) {
                self.vertex(points[k], is_rational.then_some(weights[k]));
                let mut word = self.vertices.to_string();
                if let Some(texture) = texture {
                    push_line(&mut self.text, "vt", texture[k].to_array());
                    self.texture += 1;
                    word += &format!("/{}", self.texture);
                }
                words.push(word);
            }
        }
        self.kind(is_rational, &[u.degree(), v.degree()]);
        self.statement("surf", &words);
        self.knots("u", u);
        self.knots("v", v);
        for (keyword, words) in loops {
            self.statement(keyword, &words);
        }
        self.text += "end\n";
        self.surfaces += 1;
    }

    /// A curve of space, or points.
    fn wire(&mut self, shape: &WireShape, world: &DAffine3) {
        let first = self.vertices;
        let curve = match shape {
            WireShape::Points(points) => {
                for point in points {
                    self.vertex(world.transform_point3(*point), None);
                }
                let words: Vec<_> = (first + 1..=self.vertices).collect();
                return self.statement("p", &texts(&words));
            }
            WireShape::Curve(curve) => curve.transformed(world),
        };
        let is_rational = has_weights(curve.weights());
        for (point, weight) in curve.points().zip(curve.weights()) {
            self.vertex(point, is_rational.then_some(weight));
        }
        let domain = curve.domain();
        let mut words = numbers(&[domain.start, domain.end]);
        words.extend((first + 1..=self.vertices).map(|k| k.to_string()));
        self.kind(is_rational, &[curve.degree()]);
        self.statement("curv", &words);
        self.knots("u", curve.knots());
        self.text += "end\n";
    }

    /// A vertex.
    fn vertex(&mut self, point: DVec3, weight: Option<f64>) {
        push_line(
            &mut self.text,
            "v",
            point.to_array().into_iter().chain(weight),
        );
        self.vertices += 1;
    }

    /// Where two surfaces, given by their numbers, meet.
    fn seam(&mut self, seam: &Seam, surfaces: [usize; 2]) {
        let mut words = Vec::new();
        for (side, surface) in seam.sides.iter().zip(surfaces) {
            self.curve(&side.curve);
            let domain = side.curve.domain();
            words.push(surface.to_string());
            words.extend(numbers(&[domain.start, domain.end]));
            words.push(self.curves.to_string());
        }
        self.statement("con", &words);
    }

    /// The curves of a loop; the result is how the loop names them.
    fn curves(&mut self, trim: &TrimLoop) -> Vec<String> {
        let mut words = Vec::new();
        for segment in trim.segments() {
            self.curve(segment);
            let domain = segment.domain();
            words.extend(numbers(&[domain.start, domain.end]));
            words.push(self.curves.to_string());
        }
        words
    }

    fn curve(&mut self, curve: &Curve<DVec2>) {
        let is_rational = has_weights(curve.weights());
        let mut words = Vec::new();
        for (point, weight) in curve.points().zip(curve.weights()) {
            let weight = is_rational.then_some(weight);
            push_line(
                &mut self.text,
                "vp",
                point.to_array().into_iter().chain(weight),
            );
            self.parameters += 1;
            words.push(self.parameters.to_string());
        }
        self.kind(is_rational, &[curve.degree()]);
        self.statement("curv2", &words);
        self.knots("u", curve.knots());
        self.text += "end\n";
        self.curves += 1;
    }

    /// Triangles; mirrored ones are turned round, so that their fronts stay in front.
    fn mesh(&mut self, mesh: &Mesh, world: &DAffine3) {
        for (k, point) in mesh.positions().iter().enumerate() {
            let point = world.transform_point3(*point).to_array();
            let color = mesh
                .colors()
                .get(k)
                .map(|c| srgb_from_linear(c.truncate()).to_array());
            push_line(
                &mut self.text,
                "v",
                point.into_iter().chain(color.into_iter().flatten()),
            );
            self.vertices += 1;
        }
        for uv in mesh.uvs() {
            push_line(&mut self.text, "vt", uv.to_array());
        }
        let linear = world.matrix3;
        for normal in mesh.normals() {
            push_line(&mut self.text, "vn", across(&linear, *normal).to_array());
        }
        let is_mirrored = linear.determinant() < 0.0;
        let first = self.vertices - mesh.positions().len();
        let corner = |index: u32| {
            let index = index as usize + 1;
            let vertex = first + index;
            match (mesh.uvs().is_empty(), mesh.normals().is_empty()) {
                (true, true) => vertex.to_string(),
                (false, true) => format!("{vertex}/{}", self.texture + index),
                (true, false) => format!("{vertex}//{}", self.normals + index),
                (false, false) => {
                    format!("{vertex}/{}/{}", self.texture + index, self.normals + index)
                }
            }
        };
        for &[a, b, c] in mesh.triangles() {
            let [b, c] = if is_mirrored { [c, b] } else { [b, c] };
            self.text += &format!("f {} {} {}\n", corner(a), corner(b), corner(c));
        }
        self.texture += mesh.uvs().len();
        self.normals += mesh.normals().len();
    }
}

/// A normal where a map takes its surface.
fn across(linear: &DMat3, normal: DVec3) -> DVec3 {
    let image = linear.inverse().transpose() * normal;
    image.try_normalize().unwrap_or(normal)
}

fn numbers(values: &[f64]) -> Vec<String> {
    let text = |&value: &f64| {
        let mut text = String::new();
        push_number(&mut text, value);
        text
    };
    values.iter().map(text).collect()
}

fn texts(values: &[usize]) -> Vec<String> {
    values.iter().map(ToString::to_string).collect()
}
