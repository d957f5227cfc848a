//! Meshes of drafts, and the exact shapes in place of which they stand.

use std::collections::HashMap;

use kernel::{Child, Item, Mesh, MeshId, Shape};

use super::Tree;
use crate::Problem;
use crate::iges::blanks;
use crate::iges::directory::File;
use crate::iges::entities;

/// What became of meshes.
#[derive(Debug)]
pub(super) struct Meshes {
    /// Those that the scene does not have yet, by entity.
    left: HashMap<usize, Mesh>,
    made: HashMap<usize, MeshId>,
    /// Entities in whose place meshes stand: whether there is something to show of them.
    exact: HashMap<usize, bool>,
    /// Whether an entity is not hidden, if meshes stand for any.
    shown: Vec<bool>,
}

impl Meshes {
    pub(super) fn new(file: &File<'_>) -> Self {
        let shown = if file.drafted.exact.is_empty() {
            Vec::new()
        } else {
            blanks::shown(file)
        };
        Self {
            left: file.drafted.meshes.take(),
            made: HashMap::new(),
            exact: HashMap::new(),
            shown,
        }
    }
}

impl Tree<'_, '_> {
    /// An item that shows a mesh; the inherited colour counts where it has none.
    pub(super) fn mesh(&mut self, index: usize, inherited: i64) -> Result<Child, Problem> {
        let id = match self.meshes.made.get(&index) {
            Some(&id) => id,
            None => {
                let mut mesh = self.meshes.left.remove(&index).ok_or_else(|| {
                    Problem::Unsupported("it is of a type that is not read".to_owned())
                })?;
                let entry = &self.file.entries[index];
                mesh.name.clone_from(&entry.label);
                mesh.source = self.file.source(index);
                mesh.material = self.material(index, entry.color);
                let id = self.scene.add_mesh(mesh).map_err(Problem::Geometry)?;
                self.meshes.made.insert(index, id);
                id
            }
        };
        let inherited = self.material(index, inherited);
        let own = self.scene.mesh(id).material;
        Ok(Child::Item(Item {
            shape: Shape::Mesh(id),
            material: inherited.filter(|_| own.is_none()),
        }))
    }

    /// Whether an entity is a mesh that stands for an exact shape, and that is there; tells which of the two
    /// is shown.
    pub(super) fn has_exact(&mut self, index: usize, depth: usize) -> bool {
        let Some(pointers) = self.file.drafted.exact.get(&index) else {
            return false;
        };
        let found = pointers
            .iter()
            .any(|&pointer| self.is_there(pointer, depth));
        let text = if found {
            "it is not shown, but the exact shape that it stands for"
        } else {
            "the exact shape that it stands for is not shown; its triangles are"
        };
        self.problem(index, Problem::Unsupported(text.to_owned()));
        found
    }

    /// Whether there is something to show of an exact shape: a face, or one of those that it is composed of.
    fn is_there(&mut self, pointer: i64, depth: usize) -> bool {
        let Some(index) = self.file.find(pointer) else {
            return false;
        };
        if let Some(&known) = self.meshes.exact.get(&index) {
            return known;
        }
        // What contains itself shows nothing by that.
        self.meshes.exact.insert(index, false);
        let entity = entities::read(self.file, index).ok().flatten();
        let members = entity.and_then(|entity| entity.content.into_members());
        let found = match members {
            _ if !self.meshes.shown[index] || depth > self.limits.nesting => false,
            Some(members) => members.iter().any(|&one| self.is_there(one, depth + 1)),
            None => self.child(index, 0, depth + 1).is_some(),
        };
        self.meshes.exact.insert(index, found);
        found
    }
}
