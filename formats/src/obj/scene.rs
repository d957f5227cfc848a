//! From all that has been read to the scene: materials, groups, and what to say if nothing
//! is left.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;
use kernel::{
    Child, Item, KnotVector, Material, MaterialId, Node, Patch, Scene, Seam, SeamSide, Shape,
    Surface, Wire,
};

use super::materials::Source;
use super::polygons::MeshPart;
use super::{FORMAT, Reader, materials};
use crate::{Error, Import, Place, Problem};

impl Reader<'_> {
    /// The scene of this text, or the first problem if nothing useful was found.
    pub(super) fn finish(mut self, text: &str) -> Result<Import, Error> {
        let faces = std::mem::take(&mut self.faces);
        let mut lists = std::mem::take(&mut self.lists);
        lists.settle_colors();
        let points = lists.positions.len();
        let (meshes, lines) = faces.read(text, lists, &mut self.warnings);
        self.wires.extend(lines);
        self.wires.sort_by_key(|part| part.line);
        if self.surfaces.is_empty() && meshes.is_empty() {
            if self.wires.is_empty() {
                return self.without_shapes(points);
            }
            let text = "there is no surface to show, only curves and points";
            self.warnings.unsupported(Place::default(), text);
        }
        self.merge();
        let scene = self.scene(meshes).map_err(|problem| Error {
            format: FORMAT.name,
            place: Place::default(),
            problem: Problem::Geometry(problem),
        })?;
        let warnings = self.warnings;
        Ok(Import {
            scene,
            warnings,
            ..Import::default()
        })
    }

    /// Nothing can be shown: fine if the file just holds nothing else than curves or points.
    fn without_shapes(self, points: usize) -> Result<Import, Error> {
        let curves = self.trim_curves.iter().flatten().count();
        let error = |place, problem| Error {
            format: FORMAT.name,
            place,
            problem,
        };
        match self.failure {
            Some((place, problem)) if curves == 0 => Err(error(place, problem)),
            None if curves == 0 && points == 0 => {
                let text = "no surfaces, no polygons, no curves and no points";
                let nothing = (Place::default(), Problem::Invalid(text.into()));
                // What was passed over says more than that nothing is there.
                let first = self.warnings.as_slice().first();
                let first =
                    first.and_then(|w| Some((w.places.first()?.clone(), w.problem.clone())));
                let (place, problem) = first.unwrap_or(nothing);
                Err(error(place, problem))
            }
            _ => {
                let mut warnings = self.warnings;
                let text = format!("{points} vertices, no surface and no polygon to show");
                warnings.unsupported(Place::default(), text);
                let scene = Scene::default();
                Ok(Import {
                    scene,
                    warnings,
                    ..Import::default()
                })
            }
        }
    }

    /// Puts surfaces, meshes and wires under a node for each group, in the order of the file.
    fn scene(&mut self, meshes: Vec<MeshPart>) -> Result<Scene, kernel::Error> {
        let mut scene = Scene::default();
        let materials = self.used_materials(&meshes, &mut scene);
        let material = |tag: Option<usize>| tag.and_then(|m| materials.get(&m).copied());
        let mut shapes: Vec<(usize, Option<usize>, Shape)> = Vec::new();
        let mut patches = Vec::new();
        for part in std::mem::take(&mut self.surfaces) {
            let mut patch = Patch::from(part.surface);
            patch.name = self.group(part.tag.0);
            patch.source = format!("line {}, {}", part.line, part.what);
            patch.loops = part.loops;
            patch.material = material(part.tag.1);
            patch.texture = part.texture.map(Arc::new);
            let has_maps = |id| !scene.material(id).maps.is_empty();
            if patch.texture.is_none() && patch.material.is_some_and(has_maps) {
                patch.texture = Some(Arc::new(own_parameters(&patch.surface)?));
            }
            let id = scene.add_patch(patch)?;
            patches.push(id);
            shapes.push((part.line, part.tag.0, Shape::Patch(id)));
        }
        // What has colours of its own and no material.
        let mut white = None;
        for part in meshes {
            let mut mesh = part.mesh;
            mesh.name = self.group(part.tag.0);
            mesh.source = format!("line {}, f", part.line);
            mesh.material = material(part.tag.1);
            if mesh.material.is_none() && !mesh.colors().is_empty() {
                mesh.material = Some(*white.get_or_insert_with(|| {
                    scene.add_material(Material {
                        ambient: DVec3::ONE,
                        diffuse: DVec3::ONE,
                        ..Material::default()
                    })
                }));
            }
            let id = scene.add_mesh(mesh)?;
            shapes.push((part.line, part.tag.0, Shape::Mesh(id)));
        }
        shapes.sort_by_key(|shape| shape.0);
        for part in std::mem::take(&mut self.seams) {
            let [a, b] = part.sides;
            let side = |(part, curve): (usize, _)| SeamSide {
                patch: patches[part],
                curve,
            };
            scene.add_seam(Seam {
                sides: [side(a), side(b)],
                gap: part.gap,
            })?;
        }

        self.tree(&mut scene, shapes, material)?;
        Ok(scene)
    }

    /// Puts shapes, each with its group, and wires under a node for each group.
    fn tree(
        &mut self,
        scene: &mut Scene,
        shapes: Vec<(usize, Option<usize>, Shape)>,
        material: impl Fn(Option<usize>) -> Option<MaterialId>,
    ) -> Result<(), kernel::Error> {
        // What is in each group and in none; then the children of the root, groups by number.
        let mut groups = vec![Node::default(); self.groups.list.len()];
        let mut root = Node::default();
        let mut order: Vec<Result<Child, usize>> = Vec::new();
        for part in std::mem::take(&mut self.wires) {
            let id = scene.add_wire(Wire {
                name: self.group(part.tag.0),
                source: format!("line {}, {}", part.line, part.what),
                shape: part.shape,
                material: material(part.tag.1),
            })?;
            let node = part.tag.0.map_or(&mut root, |group| &mut groups[group]);
            node.wires.push(id);
        }
        for (_, group, shape) in shapes {
            let item = Child::Item(Item {
                shape,
                material: None,
            });
            match group {
                None => order.push(Ok(item)),
                Some(group) => {
                    if groups[group].children.is_empty() {
                        order.push(Err(group));
                    }
                    groups[group].children.push(item);
                }
            }
        }
        let only_wires = |node: &Node| node.children.is_empty() && !node.wires.is_empty();
        let rest = (0..groups.len()).filter(|&group| only_wires(&groups[group]));
        order.extend(rest.map(Err));
        for child in order {
            root.children.push(match child {
                Ok(item) => item,
                Err(group) => Child::Node(scene.add_node(Node {
                    name: self.groups.list[group].clone(),
                    ..std::mem::take(&mut groups[group])
                })?),
            });
        }
        let root = scene.add_node(root)?;
        scene.set_root(root)
    }

    /// The name of a group; empty for none.
    fn group(&self, group: Option<usize>) -> String {
        group.map_or_else(String::new, |group| self.groups.list[group].clone())
    }

    /// Adds the materials that something is shown with, by their position among the names.
    fn used_materials(
        &mut self,
        meshes: &[MeshPart],
        scene: &mut Scene,
    ) -> HashMap<usize, MaterialId> {
        let mut known: HashMap<String, Material> = HashMap::new();
        let mut source = Source::new(self.options);
        for (names, &line) in self.material_files.list.iter().zip(&self.material_lines) {
            materials::load(names, line, &mut source, &mut self.warnings, &mut known);
        }
        let surfaces = self.surfaces.iter().map(|part| (part.tag.1, part.line));
        let meshes = meshes.iter().map(|part| (part.tag.1, part.line));
        let wires = self.wires.iter().map(|part| (part.tag.1, part.line));
        let mut ids = HashMap::new();
        for (material, line) in surfaces.chain(meshes).chain(wires) {
            let Some(position) = material.filter(|m| !ids.contains_key(m)) else {
                continue;
            };
            let name = &self.material_names.list[position];
            match materials::named(&known, name).cloned() {
                Some(material) => {
                    ids.insert(position, scene.add_material(material));
                }
                None => {
                    let text = format!("material \"{name}\" is not defined");
                    self.warnings.invalid(Place::item(line, "usemtl"), text);
                }
            }
        }
        ids
    }
}

/// Texture coordinates that are the parameters themselves.
fn own_parameters(surface: &Surface) -> Result<Surface, kernel::Error> {
    let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
    let corner = |u, v| DVec3::new(u, v, 0.0);
    let corners = [
        corner(u.start, v.start),
        corner(u.start, v.end),
        corner(u.end, v.start),
        corner(u.end, v.end),
    ];
    let knots = [KnotVector::bezier(1, u)?, KnotVector::bezier(1, v)?];
    let [knots_u, knots_v] = knots;
    Surface::new(knots_u, knots_v, &corners, None)
}
