//! From all that has been read to the scene: materials, groups, and what to say if nothing
//! is left.

use std::collections::HashMap;

use kernel::{Child, Item, Material, MaterialId, Node, Patch, Scene, Seam, SeamSide, Shape, Wire};

use super::polygons::MeshPart;
use super::{FORMAT, Reader, materials};
use crate::{Error, Import, Place, Problem};

impl Reader<'_> {
    /// The scene, or the first problem if nothing useful was found.
    pub(super) fn finish(mut self) -> Result<Import, Error> {
        let faces = std::mem::take(&mut self.faces);
        let lists = std::mem::take(&mut self.lists);
        let points = lists.positions.len();
        let meshes = faces.meshes(lists, &mut self.warnings);
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
        let name = |group: Option<usize>| match group {
            Some(group) => self.groups.list[group].clone(),
            None => String::new(),
        };
        let mut shapes: Vec<(usize, Option<usize>, Shape)> = Vec::new();
        let mut patches = Vec::new();
        for part in std::mem::take(&mut self.surfaces) {
            let mut patch = Patch::from(part.surface);
            patch.name = name(part.tag.0);
            patch.source = format!("line {}, {}", part.line, part.what);
            patch.loops = part.loops;
            patch.material = material(part.tag.1);
            let id = scene.add_patch(patch)?;
            patches.push(id);
            shapes.push((part.line, part.tag.0, Shape::Patch(id)));
        }
        for part in meshes {
            let mut mesh = part.mesh;
            mesh.name = name(part.tag.0);
            mesh.source = format!("line {}, f", part.line);
            mesh.material = material(part.tag.1);
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

        // What is in each group and in none; then the children of the root, groups by number.
        let mut groups = vec![Node::default(); self.groups.list.len()];
        let mut root = Node::default();
        let mut order: Vec<Result<Child, usize>> = Vec::new();
        for part in std::mem::take(&mut self.wires) {
            let id = scene.add_wire(Wire {
                name: name(part.tag.0),
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
        scene.set_root(root)?;
        Ok(scene)
    }

    /// Adds the materials that something is shown with, by their position among the names.
    fn used_materials(
        &mut self,
        meshes: &[MeshPart],
        scene: &mut Scene,
    ) -> HashMap<usize, MaterialId> {
        let mut known: HashMap<String, Material> = HashMap::new();
        for (names, &line) in self.material_files.list.iter().zip(&self.material_lines) {
            materials::load(names, line, self.options, &mut self.warnings, &mut known);
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
            match known.remove(name) {
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
