//! The tree of nodes, with every node written once and used where it stands again.

use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use kernel::{Child, Item, Material, MaterialId, Node, NodeId, Scene, Shape, UpAxis};

use super::Dialect;
use super::look::UNLIT;
use super::spell::{Out, Value, identifier};
use crate::write::{Distinct, NESTING, Uses, lost_patches, outermost, turn};
use crate::{Place, Problem, Warnings};

/// A scene that is being written.
#[derive(Debug)]
pub(super) struct Tree<'a> {
    pub(super) scene: &'a Scene,
    pub(super) dialect: Dialect,
    pub(super) warnings: Warnings,
    /// Whether there is a material that only X3D 4.0 has.
    pub(super) is_physical: bool,
    pub(super) uses: Uses,
    /// Surfaces of which nothing is left.
    lost: HashSet<Shape>,
    /// Lights that shine in a group only, until it is written.
    pub(super) lamps: HashMap<NodeId, Vec<Out>>,
    names: Distinct,
    /// What has been written and has a name: its type and name.
    nodes: HashMap<NodeId, (&'static str, String)>,
    /// Meshes also by the colour that those of their vertices are multiplied by.
    shapes: HashMap<(Shape, [u64; 3]), (&'static str, String)>,
    materials: HashMap<Worn, (&'static str, String)>,
    /// Materials with pictures or another look from behind, by the names of what is around them.
    appearances: HashMap<Worn, String>,
}

/// A material as something wears it.
type Worn = (MaterialId, Wear);

/// What a material is put on, as far as that changes what is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Wear {
    /// Surfaces, and all that shows a material as they do.
    Plain,
    /// Meshes to whose vertices it leaves its emission.
    Colored,
    /// Lines and points, which show its emission alone.
    Thin,
}

/// The metadata that holds a name which no node may have.
pub(in super::super) const NAME: &str = "name";

impl<'a> Tree<'a> {
    pub(super) fn new(scene: &'a Scene, dialect: Dialect) -> Self {
        let mut warnings = Warnings::default();
        Self {
            scene,
            dialect,
            is_physical: false,
            uses: Uses::of(scene),
            lost: lost_patches(scene, &mut warnings),
            warnings,
            lamps: HashMap::new(),
            names: Distinct::default(),
            nodes: HashMap::new(),
            shapes: HashMap::new(),
            materials: HashMap::new(),
            appearances: HashMap::new(),
        }
    }

    /// The nodes of the file, outermost first.
    ///
    /// # Errors
    /// If nodes nest too deep.
    pub(super) fn all(&mut self) -> Result<Vec<Out>, Problem> {
        let metres = self.scene.unit.as_ref().map_or(1.0, |unit| unit.metres);
        let scale = match self.dialect {
            // There are no units but metres.
            Dialect::Vrml97 => metres,
            Dialect::Xml | Dialect::Classic => 1.0,
        };
        let world = turn(self.scene.up, UpAxis::Y) * scale;
        let mut out = self.look();
        // Lights reach no farther than the transform that they stand in.
        let around = match out.is_empty() {
            true => None,
            false => self.transform(&DAffine3::from_mat3(world)),
        };
        let inside = if around.is_some() {
            DMat3::IDENTITY
        } else {
            world
        };
        if let Some((node, id, place)) = outermost(self.scene, inside, |_| false) {
            if node.name.is_empty() && place == DAffine3::IDENTITY {
                for child in &node.children {
                    out.extend(self.child(child, 0)?);
                }
                out.extend(self.wires(node));
            } else {
                out.extend(self.node(id, &place, 0)?);
            }
        }
        Ok(match around {
            Some(mut around) => {
                let inside = out.into_iter();
                inside.for_each(|node| around.child("children", node));
                vec![around]
            }
            None => out,
        })
    }

    fn child(&mut self, child: &Child, depth: usize) -> Result<Option<Out>, Problem> {
        match child {
            Child::Item(item) if self.lost.contains(&item.shape) => Ok(None),
            Child::Item(item) => Ok(Some(self.item(item))),
            Child::Node(id) => self.node(*id, &self.scene.node(*id).parent_from_node, depth),
        }
    }

    /// A node at its place, or a reference to it; nothing if there is nothing in it.
    fn node(&mut self, id: NodeId, place: &DAffine3, depth: usize) -> Result<Option<Out>, Problem> {
        if depth > NESTING {
            let text = format!("nodes nest more than {NESTING} deep");
            return Err(Problem::TooLarge(text));
        }
        if let Some((kind, def)) = self.nodes.get(&id) {
            return Ok(Some(Out::reference(kind, def)));
        }
        let node = self.scene.node(id);
        let (kind, mut out) = match self.transform(place) {
            Some(out) => ("Transform", out),
            None => ("Group", Out::new("Group")),
        };
        let is_used = self.uses.nodes.get(&id).copied() > Some(1);
        if let Some(def) = self.define(&mut out, &node.name, is_used.then_some("node")) {
            self.nodes.insert(id, (kind, def));
        }
        for lamp in self.lamps.remove(&id).unwrap_or_default() {
            out.child("children", lamp);
        }
        for child in &node.children {
            if let Some(child) = self.child(child, depth + 1)? {
                out.child("children", child);
            }
        }
        for wire in self.wires(node) {
            out.child("children", wire);
        }
        Ok(Some(out))
    }

    /// The curves and points of a node; one that stands there again is written again.
    fn wires(&mut self, node: &Node) -> Vec<Out> {
        let scene = self.scene;
        let mut written = Vec::new();
        for wire in node.wires.iter().map(|&id| scene.wire(id)) {
            let mut shape = Out::new("Shape");
            if let Some(id) = wire.material {
                let is_plain = self.scene.material(id).is_unlit();
                let wear = if is_plain { Wear::Plain } else { Wear::Thin };
                shape.child("appearance", self.appearance(id, wear));
            }
            let mut geometry = self.wire(&wire.shape);
            if !wire.name.is_empty() {
                self.define(&mut geometry, &wire.name, None);
            }
            shape.child("geometry", geometry);
            written.push(shape);
        }
        written
    }

    /// A shape: geometry with its material.
    fn item(&mut self, item: &Item) -> Out {
        let mut shape = Out::new("Shape");
        let has_colors = match item.shape {
            Shape::Mesh(id) => !self.scene.mesh(id).colors().is_empty(),
            Shape::Patch(_) => false,
        };
        let mut tint = DVec3::ONE;
        if let Some(id) = self.scene.item_material(item) {
            let is_colored = has_colors && self.scene.material(id).is_unlit();
            let wear = if is_colored {
                Wear::Colored
            } else {
                Wear::Plain
            };
            shape.child("appearance", self.appearance(id, wear));
            if has_colors {
                tint = self.tint(self.scene.material(id));
            }
        }
        let key = (item.shape, tint.to_array().map(f64::to_bits));
        let geometry = match self.shapes.get(&key) {
            Some((kind, def)) => Out::reference(kind, def),
            None => {
                let (kind, mut out, name) = match item.shape {
                    Shape::Patch(id) => {
                        let patch = self.scene.patch(id);
                        let (kind, out) = self.patch(patch);
                        (kind, out, &patch.name)
                    }
                    Shape::Mesh(id) => {
                        let mesh = self.scene.mesh(id);
                        let (kind, out) = self.mesh(mesh, tint);
                        (kind, out, &mesh.name)
                    }
                };
                let is_used = self.uses.shapes.get(&item.shape).copied() > Some(1);
                if let Some(def) = self.define(&mut out, name, is_used.then_some("shape")) {
                    self.shapes.insert(key, (kind, def));
                }
                out
            }
        };
        shape.child("geometry", geometry);
        shape
    }

    /// A material with its pictures, or a reference to what has been written of them; meshes may
    /// have colours of their own.
    fn appearance(&mut self, id: MaterialId, wear: Wear) -> Out {
        let own = self.scene.material(id);
        let thin = (wear == Wear::Thin).then(|| Material {
            name: own.name.clone(),
            opacity: own.opacity,
            ..Material::unlit(own.flat())
        });
        let source = thin.as_ref().unwrap_or(own);
        let worn = (id, wear);
        let has_colors = wear == Wear::Colored;
        if let Some(def) = self.appearances.get(&worn) {
            return Out::reference("Appearance", def);
        }
        let mut appearance = Out::new("Appearance");
        if let Some((kind, def)) = self.materials.get(&worn) {
            appearance.child("material", Out::reference(kind, def));
            return appearance;
        }
        let is_used = self.uses.materials.get(&id).copied() > Some(1);
        let (kind, mut out) = self.material(source, has_colors);
        // VRML 97 has no other materials without reflection than none.
        let has_material = kind != UNLIT || self.dialect != Dialect::Vrml97;
        let is_alone = source.maps.is_empty() && source.back.is_none();
        if is_alone && has_material {
            if let Some(def) = self.define(&mut out, &source.name, is_used.then_some("material")) {
                self.materials.insert(worn, (kind, def));
            }
        } else {
            self.pictures(source, &mut out, &mut appearance);
            let mut name = &*source.name;
            if has_material {
                self.define(&mut out, name, None);
                name = "";
            }
            let around = is_used.then_some("appearance");
            if let Some(def) = self.define(&mut appearance, name, around) {
                self.appearances.insert(worn, def);
            }
        }
        if let Some(back) = &source.back {
            if self.dialect == Dialect::Vrml97 {
                self.lost(source, "another look from behind");
            } else {
                self.is_physical = true;
                let back = self.material(back, has_colors).1;
                appearance.child("backMaterial", back);
            }
        }
        if has_material {
            appearance.child("material", out);
        }
        appearance
    }

    /// Gives a node a name of its own, made of `name`, or of `fallback` if that is empty. Where
    /// the name is another one then, the true one goes to the metadata.
    pub(super) fn define(
        &mut self,
        out: &mut Out,
        name: &str,
        fallback: Option<&str>,
    ) -> Option<String> {
        let wanted = if name.is_empty() { fallback? } else { name };
        let def = self.names.name(&identifier(wanted));
        if def != name && self.dialect != Dialect::Vrml97 {
            let mut metadata = Out::new("MetadataString");
            metadata.field("name", Value::Text(NAME.to_owned()));
            metadata.field("value", Value::Texts(vec![name.to_owned()]));
            out.child("metadata", metadata);
        } else if def != name && !name.is_empty() {
            let place = Place::item(0, format!("\"{name}\""));
            let text = "a name that stands there before, or that VRML 97 does not allow; \
                it is changed";
            self.warnings.unsupported(place, text);
        }
        out.def.clone_from(&def);
        Some(def)
    }

    /// The Transform of a map, or nothing if it does nothing.
    fn transform(&mut self, map: &DAffine3) -> Option<Out> {
        if *map == DAffine3::IDENTITY {
            return None;
        }
        let parts = Parts::of(&map.matrix3);
        let mut out = Out::new("Transform");
        if map.translation != DVec3::ZERO {
            out.field("translation", Value::tuple(&map.translation.to_array()));
        }
        if let Some(rotation) = rotation(parts.rotation) {
            out.field("rotation", rotation);
        }
        if parts.scale.min_element() < 0.0 && self.dialect == Dialect::Vrml97 {
            let text = "VRML 97 wants scales above zero; programs that keep to it do not mirror";
            self.warnings
                .unsupported(Place::item(0, "mirrored places"), text);
        }
        if parts.scale != DVec3::ONE {
            out.field("scale", Value::tuple(&parts.scale.to_array()));
        }
        if let Some(orientation) = rotation(parts.orientation) {
            out.field("scaleOrientation", orientation);
        }
        Some(out)
    }
}

/// Axis and angle, or nothing for no rotation.
pub(super) fn rotation(rotation: DQuat) -> Option<Value> {
    let (axis, angle) = rotation.to_axis_angle();
    let [x, y, z] = axis.to_array();
    (angle != 0.0).then(|| Value::tuple(&[x, y, z, angle]))
}

/// A matrix as `R O S O^-1`.
#[derive(Clone, Copy, Debug)]
struct Parts {
    rotation: DQuat,
    scale: DVec3,
    orientation: DQuat,
}

/// Matrices that differ from scaled rotations by no more are taken for such.
const RIGID: f64 = 1e-14;

impl Parts {
    /// The polar decomposition, its symmetric part in its own axes.
    fn of(matrix: &DMat3) -> Self {
        let diagonal = DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z);
        if *matrix == DMat3::from_diagonal(diagonal) {
            return Self {
                rotation: DQuat::IDENTITY,
                scale: diagonal,
                orientation: DQuat::IDENTITY,
            };
        }
        let sign = matrix.determinant().signum();
        let matrix = *matrix * sign;
        let gram = matrix.transpose() * matrix;
        let square = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
        let stray = gram - DMat3::from_diagonal(DVec3::splat(square));
        let is_rigid = |x: &f64| x.abs() <= RIGID * square;
        if stray.to_cols_array().iter().all(is_rigid) {
            let scale = square.sqrt();
            let scale = if (scale - 1.0).abs() <= RIGID {
                1.0
            } else {
                scale
            };
            return Self {
                rotation: DQuat::from_mat3(&(matrix * scale.recip())),
                scale: DVec3::splat(scale * sign),
                orientation: DQuat::IDENTITY,
            };
        }
        let (axes, squares) = symmetric_axes(gram);
        let scale = squares.map(f64::sqrt);
        let unscaled = axes * DMat3::from_diagonal(scale.recip()) * axes.transpose();
        Self {
            rotation: DQuat::from_mat3(&(matrix * unscaled)).normalize(),
            scale: scale * sign,
            orientation: DQuat::from_mat3(&axes).normalize(),
        }
    }
}

/// Sweeps of Jacobi's method: it doubles the digits with each near its end.
const SWEEPS: usize = 16;

/// The principal axes of a symmetric matrix as the columns of a rotation, and its values along
/// them; by Jacobi's method \[Golub 2013, section 8.5\].
fn symmetric_axes(mut matrix: DMat3) -> (DMat3, DVec3) {
    let mut axes = DMat3::IDENTITY;
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = matrix.col(q)[p];
            if off == 0.0 {
                continue;
            }
            let theta = (matrix.col(q)[q] - matrix.col(p)[p]) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = t.hypot(1.0).recip();
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = c;
            turn.col_mut(q)[q] = c;
            turn.col_mut(q)[p] = t * c;
            turn.col_mut(p)[q] = -t * c;
            matrix = turn.transpose() * matrix * turn;
            axes *= turn;
        }
    }
    let values = DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z);
    (axes, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_make_the_matrix_again() {
        let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 2.0);
        let other = DMat3::from_axis_angle(DVec3::new(0.0, 0.28, 0.96), -0.7);
        let stretch = DMat3::from_diagonal(DVec3::new(0.5, 3.0, 2.0));
        for matrix in [
            turn,
            turn * -2.5,
            stretch,
            turn * stretch,
            other * stretch * turn,
            DMat3::from_cols(DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Z),
            DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
            DMat3::from_cols(DVec3::Y, DVec3::X, DVec3::Z * 4.0),
        ] {
            let parts = Parts::of(&matrix);
            let orientation = DMat3::from_quat(parts.orientation);
            let again = DMat3::from_quat(parts.rotation)
                * orientation
                * DMat3::from_diagonal(parts.scale)
                * orientation.transpose();
            let stray = (again - matrix).to_cols_array();
            assert!(stray.iter().all(|x| x.abs() < 4e-15), "{matrix} {parts:?}");
        }
    }
}
