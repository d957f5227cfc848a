//! From the order of a file to a [`Tree`]: nesting, DEF and USE, limits.

use std::collections::HashMap;
use std::sync::Arc;

use super::files::Loader;
use super::proto::{Declared, Exposed, Prototype, Scope, is_inline};
use super::{Field, File, Link, Node, Spelling, Tree};
use crate::{Error, Problem, ReadOptions, Warnings};

/// A node that is not finished.
#[derive(Debug)]
pub(super) struct Open {
    pub(super) node: Node,
    pub(super) slot: Option<Arc<str>>,
    /// Largest height of the children.
    pub(super) height: usize,
    role: Role,
    /// How many nodes were stored when it began.
    pub(super) first: usize,
    /// How many routes there were then.
    pub(super) first_route: usize,
    /// Of the declaration of a prototype: what has been read of it.
    pub(super) declared: Declared,
    /// Routes inside of it that wait for its end, since they lead to it or from it.
    pub(super) routes: Vec<Node>,
}

/// What happens to a node when it ends.
#[derive(Debug, PartialEq)]
enum Role {
    /// It is stored.
    Keep,
    /// This one, defined before, takes its place.
    Use(usize),
    /// It vanishes: its USE leads nowhere.
    Drop,
}

/// Builds a [`Tree`] from the begins and ends of nodes, in any spelling.
#[derive(Debug)]
pub(crate) struct Builder<'a> {
    pub(super) options: &'a ReadOptions<'a>,
    pub(super) tree: Tree,
    /// What is wrong with the file.
    pub(crate) warnings: Warnings,
    /// For each stored node, how many nodes lie below each other in it.
    pub(super) heights: Vec<usize>,
    pub(super) open: Vec<Open>,
    /// Names, innermost last: one scope for each file and each body of a prototype.
    pub(super) scopes: Vec<Scope>,
    /// The file that is being read.
    pub(super) file: Arc<File>,
    pub(super) loader: Loader,
    count: usize,
    /// Fields of instances of prototypes, by the first node of each, that lead to their nodes.
    pub(super) exposed: HashMap<usize, Vec<Exposed>>,
    /// Nodes made as copies of prototypes, and points moved by deformers.
    pub(super) copies: usize,
}

impl<'a> Builder<'a> {
    /// An empty tree of this format, in metres and radians.
    pub(super) fn new(
        format: &'static str,
        spelling: Spelling,
        options: &'a ReadOptions<'a>,
    ) -> Self {
        let (nodes, routes, root) = (Vec::new(), Vec::new(), None);
        Self {
            options,
            tree: Tree {
                format,
                nodes,
                routes,
                root,
            },
            warnings: Warnings::default(),
            heights: Vec::new(),
            open: Vec::new(),
            scopes: Vec::new(),
            file: Arc::default(),
            loader: Loader::new(spelling),
            count: 0,
            exposed: HashMap::new(),
            copies: 0,
        }
    }

    /// The file that is being read.
    pub(crate) fn file(&self) -> &Arc<File> {
        &self.file
    }

    /// Begins a node inside those that are open.
    ///
    /// # Errors
    /// If there are too many nodes or they nest too deep.
    pub(crate) fn begin(&mut self, kind: &str, line: usize) -> Result<(), Error> {
        self.count += 1;
        if self.count > self.options.limits.entities {
            let text = format!("more than {} nodes", self.options.limits.entities);
            return Err(self.too_large(line, text));
        }
        self.check_nesting(self.open.len() + 1, line)?;
        if kind == "ProtoBody" {
            self.scopes.push(Scope::default());
        }
        let node = Node {
            kind: kind.into(),
            line,
            file: Arc::clone(&self.file),
            ..Node::default()
        };
        self.open.push(Open {
            node,
            slot: None,
            height: 0,
            role: Role::Keep,
            first: self.tree.nodes.len(),
            first_route: self.tree.routes.len(),
            declared: Declared::default(),
            routes: Vec::new(),
        });
        Ok(())
    }

    /// Gives the innermost node a field that is no node.
    pub(crate) fn field(&mut self, name: &str, value: &str) {
        let Some(open) = self.open.last_mut() else {
            return;
        };
        if (&*open.node.kind, name) == ("X3D", "version") {
            self.set_version(value);
        } else {
            open.node.fields.push(Field {
                name: name.into(),
                value: value.into(),
            });
        }
    }

    /// Gives the innermost node what XML and JSON write as an attribute.
    pub(crate) fn attribute(&mut self, name: &str, value: &str) {
        match name {
            "DEF" => self.define(value),
            "USE" => self.use_of(value),
            "containerField" => self.set_slot(value),
            _ => self.field(name, value),
        }
    }

    /// Gives the innermost node its name.
    pub(crate) fn define(&mut self, name: &str) {
        if let Some(open) = self.open.last_mut() {
            open.node.def = name.into();
        }
    }

    /// Says to which field of the outer node the innermost one belongs.
    pub(crate) fn set_slot(&mut self, field: &str) {
        if let Some(open) = self.open.last_mut() {
            open.slot = Some(field.into());
        }
    }

    /// Puts the node of this name in the place of the innermost one.
    pub(crate) fn use_of(&mut self, name: &str) {
        let Some((open, around)) = self.open.split_last_mut() else {
            return;
        };
        let scope = self.scopes.last().and_then(|scope| scope.nodes.get(name));
        if let Some(&node) = scope {
            open.role = Role::Use(node);
            return;
        }
        open.role = Role::Drop;
        let outer = around.iter().find(|open| &*open.node.def == name);
        if outer.is_some_and(|outer| &*outer.node.kind == "Script") {
            // A field of a script may be the script.
            return;
        }
        let what = match &*open.node.kind {
            "" => format!("USE {name}"),
            kind => format!("{kind} USE {name}"),
        };
        let place = self.file.place(open.node.line, &what);
        let text = if outer.is_some() {
            "a node is used inside itself; it is left out there"
        } else {
            "USE of a name that no node before has as its DEF"
        };
        self.warnings.invalid(place, text);
    }

    /// Lets the prototype around the innermost node fill one of its fields.
    pub(crate) fn connect(&mut self, field: &str, prototype_field: &str) {
        if let Some(open) = self.open.last_mut() {
            let connection = (field.into(), prototype_field.into());
            open.node.connections.push(connection);
        }
    }

    /// Ends the innermost open node.
    ///
    /// # Errors
    /// If USEs nest too deep, or prototypes or files named inside pass a limit.
    pub(crate) fn end(&mut self) -> Result<(), Error> {
        self.close(true)
    }

    fn close(&mut self, complete: bool) -> Result<(), Error> {
        let Some(mut open) = self.open.pop() else {
            return Ok(());
        };
        open.node.complete = complete;
        if &*open.node.kind == "ProtoBody" {
            self.scopes.pop();
        }
        let routes = std::mem::take(&mut open.routes);
        match open.role {
            Role::Drop => {}
            Role::Use(index) => self.link(index, open.slot, false),
            Role::Keep => {
                if let Some(open) = self.structure(open)? {
                    self.keep(open)?;
                }
            }
        }
        for route in routes {
            self.route(route)?;
        }
        Ok(())
    }

    /// Stores a node, or what the prototype of that name makes of it.
    fn keep(&mut self, mut open: Open) -> Result<(), Error> {
        // The scene itself is no instance, even where a prototype is called so, too.
        let holds_scene = |open: &Open| &*open.node.kind == "Scene";
        let is_scene = holds_scene(&open);
        let is_outermost = is_scene && !self.open.iter().any(holds_scene);
        if !is_outermost && let Some(prototype) = self.prototype(&mut open.node)? {
            return self.instance(&prototype, open);
        }
        if is_inline(&open.node.kind) {
            let contents = self.inline(&mut open.node)?;
            open.height = self.height_inside(&open.node);
            if let (false, Some(scope)) = (open.node.def.is_empty(), self.scopes.last_mut()) {
                scope.inlines.insert(Arc::clone(&open.node.def), contents);
            }
        }
        if &*open.node.kind == "CoordinateDeformer" {
            self.deform(&open.node);
        }
        let Open {
            node, slot, height, ..
        } = open;
        let def = Arc::clone(&node.def);
        let index = self.store(node, height)?;
        if let (false, Some(scope)) = (def.is_empty(), self.scopes.last_mut()) {
            scope.nodes.insert(def, index);
        }
        if is_scene && *self.loader.scene.get_or_insert(index) != index {
            let text = "the file has a scene before it; it is not shown";
            self.warnings.invalid(self.tree.nodes[index].place(), text);
        }
        self.link(index, slot, true);
        Ok(())
    }

    /// Adds a finished node.
    ///
    /// # Errors
    /// If USEs nest too deep.
    pub(super) fn store(&mut self, node: Node, height: usize) -> Result<usize, Error> {
        self.check_nesting(self.open.len() + height + 1, node.line)?;
        let index = self.tree.nodes.len();
        for link in node.children.iter().filter(|link| link.defined_here) {
            self.tree.nodes[link.node].parent = Some(index);
        }
        self.tree.nodes.push(node);
        self.heights.push(height + 1);
        Ok(index)
    }

    /// Puts a stored node into the innermost open one.
    pub(super) fn link(&mut self, node: usize, field: Option<Arc<str>>, defined_here: bool) {
        if let Some(outer) = self.open.last_mut() {
            outer.height = outer.height.max(self.heights[node]);
            outer.node.children.push(Link {
                node,
                field,
                defined_here,
            });
        }
    }

    /// The height of the highest child of a node.
    pub(super) fn height_inside(&self, node: &Node) -> usize {
        let heights = node.children.iter().map(|link| self.heights[link.node]);
        heights.max().unwrap_or(0)
    }

    /// The innermost open node.
    pub(crate) fn innermost(&self) -> Option<&Node> {
        self.open.last().map(|open| &open.node)
    }

    /// Sets the version of X3D or VRML.
    pub(crate) fn set_version(&mut self, version: &str) {
        version.clone_into(&mut Arc::make_mut(&mut self.file).version);
    }

    /// Takes over a `unit`: the size of one in metres or radians.
    pub(super) fn set_unit(&mut self, node: &Node) {
        let factor = node.number("conversionFactor", 1.0, &mut self.warnings);
        if factor <= 0.0 {
            let text = "a unit must have a positive conversionFactor; it is not used";
            self.warnings.invalid(node.place(), text);
            return;
        }
        let before = Arc::clone(&self.file);
        let file = Arc::make_mut(&mut self.file);
        match &*node.string("category") {
            "length" => {
                let name = node.string("name");
                let metres = factor;
                file.length = kernel::Unit { name, metres };
            }
            "angle" => file.angle = factor,
            _ => {}
        }
        // In classic spelling the scene of this file has begun.
        let open = self.open.iter_mut().map(|open| &mut open.node.file);
        for file in open.filter(|file| Arc::ptr_eq(file, &before)) {
            *file = Arc::clone(&self.file);
        }
    }

    /// Ends all nodes down to a level; they stay without their ends.
    ///
    /// # Errors
    /// If USEs nest too deep.
    pub(super) fn close_to(&mut self, level: usize) -> Result<(), Error> {
        while self.open.len() > level {
            self.close(false)?;
        }
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// If USEs nest too deep.
    pub(super) fn finish(mut self) -> Result<(Tree, Warnings), Error> {
        self.close_to(0)?;
        self.tree.root = self.loader.scene;
        Ok((self.tree, self.warnings))
    }

    fn check_nesting(&self, depth: usize, line: usize) -> Result<(), Error> {
        let limit = self.options.limits.nesting;
        if depth <= limit {
            return Ok(());
        }
        Err(self.too_large(line, format!("nodes nest deeper than {limit}")))
    }

    /// How deep nodes may nest.
    pub(crate) fn nesting(&self) -> usize {
        self.options.limits.nesting
    }

    pub(crate) fn too_large(&self, line: usize, text: String) -> Error {
        self.error(line, Problem::TooLarge(text))
    }

    /// Notes where a file is broken, so that nothing is read from there on.
    pub(crate) fn broken(&mut self, line: usize, text: String) -> Error {
        let broken = self.error(line, Problem::Invalid(text));
        self.warnings
            .add(broken.place.clone(), broken.problem.clone());
        broken
    }

    /// An error at a line of the file that is being read.
    fn error(&self, line: usize, problem: Problem) -> Error {
        Error {
            format: self.tree.format,
            place: self.file.place(line, ""),
            problem,
        }
    }

    /// The prototype of a name, from the innermost body of the file outwards.
    pub(super) fn declared(&self, name: &str) -> Option<(usize, &Prototype)> {
        let scopes = self.scopes.iter().enumerate().skip(self.loader.first_scope);
        let mut found = scopes
            .rev()
            .filter_map(|(i, scope)| Some((i, scope.prototypes.get(name)?)));
        found.next()
    }
}
