//! From the order of a file to a [`Tree`]: nesting, DEF and USE, limits.

use std::collections::HashMap;

use super::{Field, Link, Node, Tree};
use crate::{Error, Limits, Place, Problem, Warnings};

/// The beginning of a node, as a file spells it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Head {
    /// Its type.
    pub kind: String,
    /// The name given to it.
    pub def: Option<String>,
    /// The name of the node that stands here instead.
    pub use_of: Option<String>,
    /// The field of the outer node it belongs to, if the file says so.
    pub field: Option<String>,
    /// The line.
    pub line: usize,
    /// The fields that are not nodes.
    pub fields: Vec<Field>,
}

/// A node that is not finished.
#[derive(Debug)]
struct Open {
    node: Node,
    field: Option<String>,
    /// Largest height of the children.
    height: usize,
    role: Role,
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

/// Builds a [`Tree`] from the begins and ends of nodes.
#[derive(Debug)]
pub(crate) struct Builder<'a> {
    limits: &'a Limits,
    tree: Tree,
    /// For each stored node, how many nodes lie below each other in it.
    heights: Vec<usize>,
    open: Vec<Open>,
    /// DEF names; a prototype's body has its own.
    scopes: Vec<HashMap<String, usize>>,
    count: usize,
}

impl<'a> Builder<'a> {
    /// An empty tree of this format, in metres and radians.
    pub(crate) fn new(format: &'static str, limits: &'a Limits) -> Self {
        let tree = Tree {
            format,
            version: String::new(),
            length: kernel::Unit {
                name: "m".to_owned(),
                metres: 1.0,
            },
            angle: 1.0,
            nodes: Vec::new(),
            root: None,
        };
        Self {
            limits,
            tree,
            heights: Vec::new(),
            open: Vec::new(),
            scopes: vec![HashMap::new()],
            count: 0,
        }
    }

    /// Begins a node inside those that are open.
    ///
    /// # Errors
    /// If there are too many nodes or they nest too deep.
    pub(crate) fn begin(&mut self, head: Head, warnings: &mut Warnings) -> Result<(), Error> {
        self.count += 1;
        if self.count > self.limits.entities {
            let text = format!("more than {} nodes", self.limits.entities);
            return Err(self.too_large(head.line, text));
        }
        self.check_nesting(self.open.len() + 1, head.line)?;
        if head.kind == "ProtoBody" {
            self.scopes.push(HashMap::new());
        }
        let role = match &head.use_of {
            None => Role::Keep,
            Some(name) => self.find(name, &head, warnings),
        };
        let node = Node {
            kind: head.kind,
            def: head.def.unwrap_or_default(),
            line: head.line,
            fields: head.fields,
            ..Node::default()
        };
        self.open.push(Open {
            node,
            field: head.field,
            height: 0,
            role,
        });
        Ok(())
    }

    /// What stands where `name` is used.
    fn find(&self, name: &str, head: &Head, warnings: &mut Warnings) -> Role {
        let scope = self.scopes.last().and_then(|scope| scope.get(name));
        if let Some(&node) = scope {
            return Role::Use(node);
        }
        let place = Place::item(head.line, format!("{} USE {name}", head.kind));
        if self.open.iter().any(|open| open.node.def == name) {
            warnings.invalid(place, "a node is used inside itself; it is left out there");
        } else {
            warnings.invalid(place, "USE of a name that no node before has as its DEF");
        }
        Role::Drop
    }

    /// Ends the innermost open node.
    ///
    /// # Errors
    /// If USEs nest too deep.
    pub(crate) fn end(&mut self) -> Result<(), Error> {
        self.close(true)
    }

    fn close(&mut self, complete: bool) -> Result<(), Error> {
        let Some(Open {
            mut node,
            field,
            height,
            role,
        }) = self.open.pop()
        else {
            return Ok(());
        };
        if node.kind == "ProtoBody" && self.scopes.len() > 1 {
            self.scopes.pop();
        }
        let defined_here = role == Role::Keep;
        let index = match role {
            Role::Drop => return Ok(()),
            Role::Use(index) => index,
            Role::Keep => {
                self.check_nesting(self.open.len() + height + 1, node.line)?;
                let index = self.tree.nodes.len();
                if let (false, Some(scope)) = (node.def.is_empty(), self.scopes.last_mut()) {
                    scope.insert(node.def.clone(), index);
                }
                node.complete = complete;
                for link in node.children.iter().filter(|link| link.defined_here) {
                    self.tree.nodes[link.node].parent = Some(index);
                }
                if node.kind == "Scene" && self.tree.root.is_none() {
                    self.tree.root = Some(index);
                }
                self.tree.nodes.push(node);
                self.heights.push(height + 1);
                index
            }
        };
        if let Some(outer) = self.open.last_mut() {
            outer.height = outer.height.max(self.heights[index]);
            outer.node.children.push(Link {
                node: index,
                field,
                defined_here,
            });
        }
        Ok(())
    }

    /// The innermost open node.
    pub(crate) fn innermost(&self) -> Option<&Node> {
        self.open.last().map(|open| &open.node)
    }

    /// Sets the version of X3D.
    pub(crate) fn set_version(&mut self, version: &str) {
        version.clone_into(&mut self.tree.version);
    }

    /// Sets the unit of length.
    pub(crate) fn set_length(&mut self, unit: kernel::Unit) {
        self.tree.length = unit;
    }

    /// Sets the unit of angle, in radians.
    pub(crate) fn set_angle(&mut self, radians: f64) {
        self.tree.angle = radians;
    }

    /// Ends the file; nodes that are open stay without their ends.
    ///
    /// # Errors
    /// If USEs nest too deep.
    pub(crate) fn finish(mut self) -> Result<Tree, Error> {
        while !self.open.is_empty() {
            self.close(false)?;
        }
        Ok(self.tree)
    }

    fn check_nesting(&self, depth: usize, line: usize) -> Result<(), Error> {
        let limit = self.limits.nesting;
        if depth <= limit {
            return Ok(());
        }
        Err(self.too_large(line, format!("nodes nest deeper than {limit}")))
    }

    fn too_large(&self, line: usize, text: String) -> Error {
        Error {
            format: self.tree.format,
            place: Place::line(line),
            problem: Problem::TooLarge(text),
        }
    }
}
