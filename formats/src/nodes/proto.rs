//! Prototypes: declarations, and the nodes that their instances stand for.
//!
//! The body of a prototype is stored once. An instance copies only its first node, and what
//! lies between that and the fields that the instance can fill; all else is shared, as if by
//! USE. So a prototype costs little, however often it stands there.

use std::collections::HashMap;
use std::sync::Arc;

use super::address::Address;
use super::animate::{Route, plain_name};
use super::build::{Builder, Open};
use super::files::{Contents, is_urn};
use super::kinds::{is_group, is_known, known};
use super::text::words;
use super::{Field, Link, Node};
use crate::Error;

/// The names of a file or of the body of a prototype.
#[derive(Debug, Default)]
pub(super) struct Scope {
    /// Nodes by their DEF.
    pub(super) nodes: HashMap<Arc<str>, usize>,
    /// Prototypes.
    pub(super) prototypes: HashMap<Arc<str>, Prototype>,
    /// The first prototype that is declared here.
    pub(super) first: Option<Arc<str>>,
    /// What other files may import: their name for it, and the one here.
    pub(super) exports: HashMap<Arc<str>, Arc<str>>,
    /// What the files of `Inline`s hold, by the DEF of these; of those without a file, nothing.
    pub(super) inlines: HashMap<Arc<str>, Option<Arc<Contents>>>,
}

/// A declared prototype.
#[derive(Clone, Debug)]
pub(super) enum Prototype {
    /// It stands in a file that has been read.
    Here(Arc<Body>),
    /// It stands in one of these files.
    Elsewhere(Arc<[Address]>),
    /// It is a node that is known without it.
    Known(Arc<str>),
    /// Its files have been looked for in vain.
    Missing,
}

/// A field of an instance of a prototype, and the field of a node that stands for it.
#[derive(Clone, Debug)]
pub(super) struct Exposed {
    name: Arc<str>,
    node: usize,
    field: Arc<str>,
}

/// What has been read of the declaration of a prototype.
#[derive(Debug, Default)]
pub(super) struct Declared {
    interface: Vec<Declaration>,
    body: Option<Body>,
}

/// A field of a prototype with its default.
#[derive(Clone, Debug)]
struct Declaration {
    name: Arc<str>,
    value: Option<Arc<str>>,
    nodes: Vec<Link>,
}

/// The body of a prototype.
#[derive(Debug)]
pub(super) struct Body {
    interface: Vec<Declaration>,
    /// Its first node, which is what an instance stands for.
    root: usize,
    /// The nodes that each instance has for itself, in the order of the tree.
    own: Vec<usize>,
    /// Nodes from here on are not of the prototype.
    end: usize,
    /// Routes that each instance has for itself.
    routes: Vec<Route>,
}

/// Nodes that are known to us and that prototypes of other names stand for: programs declare
/// what only some viewers have built in, with a script as a last resort.
fn is_nurbs(kind: &str) -> bool {
    is_known(kind) && (kind.starts_with("Nurbs") || matches!(kind, "TrimmedSurface" | "Contour2D"))
}

impl Builder<'_> {
    /// Takes over what is no node: declarations and statements. Nodes come back.
    pub(super) fn structure(&mut self, mut open: Open) -> Result<Option<Open>, Error> {
        match &*open.node.kind {
            "IS" | "ProtoInterface" => {}
            "connect" => {
                let [field, outer] = ["nodeField", "protoField"].map(|f| open.node.string(f));
                // Around it is the IS, around that the node.
                if let Some(around) = self.open.iter_mut().rev().nth(1) {
                    let connection = (field.into(), outer.into());
                    around.node.connections.push(connection);
                }
            }
            "field" => self.declare_field(open.node),
            "fieldValue" => self.fill_field(open.node),
            "ProtoBody" => self.end_body(&open),
            "ProtoDeclare" => self.declare(open),
            "ExternProtoDeclare" => self.declare_elsewhere(&open.node),
            "ProtoInstance" => {
                open.node.kind = open.node.string("name").into();
                return Ok(Some(open));
            }
            "unit" => self.set_unit(&open.node),
            "ROUTE" => self.route(open.node)?,
            "IMPORT" => self.import(&open.node),
            "EXPORT" => self.export(&open.node),
            "component" | "meta" => {}
            _ => return Ok(Some(open)),
        }
        Ok(None)
    }

    /// A `ROUTE` between two nodes of the present scope. One that stands inside of a node to which
    /// it leads waits for the end of that.
    ///
    /// # Errors
    /// If it leads to too many nodes in instances.
    pub(super) fn route(&mut self, route: Node) -> Result<(), Error> {
        let names = ["fromNode", "toNode"].map(|field| route.string(field));
        if let Some(around) = self.around(&names) {
            around.routes.push(route);
            return Ok(());
        }
        let scope = self.scopes.last();
        let node = |name: &str| scope.and_then(|s| s.nodes.get(name)).copied();
        let [Some(from), Some(to)] = names.each_ref().map(|name| node(name)) else {
            let text = "a ROUTE between nodes that are not both there";
            self.warnings.invalid(route.place(), text);
            return Ok(());
        };
        let ends = |node, field| self.ends(node, &route.string(field));
        let (from, to) = (ends(from, "fromField"), ends(to, "toField"));
        // One stands in the file itself.
        let made = from.len().saturating_mul(to.len()).saturating_sub(1);
        self.count_copies(made, &route)?;
        let pairs = from
            .iter()
            .flat_map(|from| to.iter().map(move |to| (from, to)));
        let routes = pairs.map(|((from, from_field), (to, to_field))| Route {
            from: *from,
            from_field: Arc::clone(from_field),
            to: *to,
            to_field: Arc::clone(to_field),
        });
        self.tree.routes.extend(routes);
        Ok(())
    }

    /// The outermost open node of the present scope that has one of these names.
    fn around(&mut self, names: &[String]) -> Option<&mut Open> {
        let begins = |open: &Open| matches!(&*open.node.kind, "ProtoBody" | "Scene");
        let first = self.open.iter().rposition(begins).map_or(0, |at| at + 1);
        let is_named = |def: &str| !def.is_empty() && names.iter().any(|name| name == def);
        let mut open = self.open[first..].iter_mut();
        open.find(|open| is_named(&open.node.def))
    }

    /// Counts what instances of prototypes make.
    ///
    /// # Errors
    /// If it passes the limit.
    fn count_copies(&mut self, count: usize, node: &Node) -> Result<(), Error> {
        self.copies = self.copies.saturating_add(count);
        let limit = self.options.limits.entities / COPIES;
        if self.copies <= limit {
            return Ok(());
        }
        let text = format!("more than {limit} nodes and routes made by prototypes");
        Err(self.too_large(node.line, text))
    }

    /// Where a route to or from a field really ends: within instances of prototypes.
    fn ends(&self, node: usize, field: &str) -> Vec<(usize, Arc<str>)> {
        let Some(exposed) = self.exposed.get(&node) else {
            return vec![(node, field.into())];
        };
        let same = |e: &&Exposed| plain_name(&e.name) == plain_name(field);
        let found = exposed.iter().filter(same);
        found.map(|e| (e.node, Arc::clone(&e.field))).collect()
    }

    /// A `field` of an interface; those of scripts are passed over.
    fn declare_field(&mut self, field: Node) {
        let declaration = Declaration {
            name: field.string("name").into(),
            value: field.text("value").map(Arc::from),
            nodes: field.children,
        };
        let mut around = self.open.iter_mut().rev().take(2);
        if let Some(open) = around.find(|open| &*open.node.kind == "ProtoDeclare") {
            open.declared.interface.push(declaration);
        }
    }

    /// A `fieldValue` of an instance.
    fn fill_field(&mut self, field: Node) {
        let name: Arc<str> = field.string("name").into();
        let Some(around) = self.open.last_mut() else {
            return;
        };
        if let Some(value) = field.text("value") {
            let (name, value) = (Arc::clone(&name), value.into());
            around.node.fields.push(Field { name, value });
        }
        for mut link in field.children {
            around.height = around.height.max(self.heights[link.node]);
            link.field = Some(Arc::clone(&name));
            around.node.children.push(link);
        }
    }

    /// Finds out which nodes of a body each instance needs for itself.
    fn end_body(&mut self, body: &Open) {
        let nodes = &self.tree.nodes;
        let mut links = body.node.children.iter();
        let Some(root) = links.find(|link| !nodes[link.node].is_metadata()) else {
            return;
        };
        let mut own = Vec::new();
        for (index, node) in nodes.iter().enumerate().skip(body.first) {
            let mut inside = node.children.iter().map(|link| link.node);
            let varies =
                !node.connections.is_empty() || inside.any(|i| own.binary_search(&i).is_ok());
            if varies || index == root.node {
                own.push(index);
            }
        }
        let is_own = |r: &Route| [r.from, r.to].iter().any(|i| own.binary_search(i).is_ok());
        let routes = self
            .tree
            .routes
            .extract_if(body.first_route.., |route| is_own(route))
            .collect();
        if let Some(around) = self.open.last_mut() {
            around.declared.body = Some(Body {
                interface: Vec::new(),
                root: root.node,
                own,
                end: self.tree.nodes.len(),
                routes,
            });
        }
    }

    fn declare(&mut self, open: Open) {
        let name: Arc<str> = open.node.string("name").into();
        let prototype = match open.declared.body {
            _ if is_nurbs(&name) => Prototype::Known(Arc::clone(&name)),
            Some(body) => Prototype::Here(Arc::new(Body {
                interface: open.declared.interface,
                ..body
            })),
            None => {
                let text = format!("the prototype {name} has nothing in its body");
                self.warnings.invalid(open.node.place(), text);
                Prototype::Missing
            }
        };
        self.declare_as(name, prototype);
    }

    /// An `EXTERNPROTO`: a node that is known needs no file, whether the prototype has its
    /// name or one of the addresses ends in it, in capitals or small letters.
    fn declare_elsewhere(&mut self, node: &Node) {
        let name: Arc<str> = node.string("name").into();
        let addresses = node.strings("url");
        let mut urns = addresses.iter().filter(|address| is_urn(address));
        let named = Some(&*name).filter(|name| is_known(name));
        let known = named.or_else(|| urns.find_map(|urn| known(urn.rsplit(':').next()?)));
        let prototype = match known {
            Some(kind) => Prototype::Known(kind.into()),
            None => Prototype::Elsewhere(self.addresses(node).into()),
        };
        self.declare_as(name, prototype);
    }

    fn declare_as(&mut self, name: Arc<str>, prototype: Prototype) {
        if let Some(scope) = self.scopes.last_mut() {
            scope.first.get_or_insert_with(|| Arc::clone(&name));
            scope.prototypes.insert(name, prototype);
        }
    }

    /// The prototype that a node is an instance of. Where it stands for a known node, that
    /// becomes the kind of the node.
    ///
    /// # Errors
    /// If a file that has to be read for it passes a limit.
    pub(super) fn prototype(&mut self, node: &mut Node) -> Result<Option<Prototype>, Error> {
        let Some((scope, prototype)) = self.declared(&node.kind) else {
            let is_around = |open: &Open| {
                &*open.node.kind == "ProtoDeclare" && open.node.text("name") == Some(&node.kind)
            };
            if self.open.iter().any(is_around) {
                let text = "a prototype is used inside itself";
                self.warnings.invalid(node.place(), text);
                return Ok(Some(Prototype::Missing));
            }
            return Ok(None);
        };
        match prototype.clone() {
            Prototype::Known(kind) => {
                node.kind = kind;
                Ok(None)
            }
            Prototype::Elsewhere(addresses) => {
                let found = self.fetch_prototype(node, &addresses)?;
                let found = found.map_or(Prototype::Missing, Prototype::Here);
                let prototypes = &mut self.scopes[scope].prototypes;
                prototypes.insert(Arc::clone(&node.kind), found.clone());
                Ok(Some(found))
            }
            found => Ok(Some(found)),
        }
    }

    /// Puts what an instance stands for into the outer node.
    ///
    /// # Errors
    /// If instances make too many nodes.
    pub(super) fn instance(&mut self, prototype: &Prototype, open: Open) -> Result<(), Error> {
        let Open { node, slot, .. } = open;
        let Prototype::Here(body) = prototype else {
            let text = format!(
                "the prototype {} could not be read; it is left out",
                node.kind
            );
            self.warnings.unsupported(node.place(), text);
            return Ok(());
        };
        // Shared with all that nest in it, copies are few; those of copies of copies are not.
        self.count_copies(body.own.len() + body.routes.len(), &node)?;
        let mut copies = Vec::new();
        for &index in &body.own {
            copies.push(self.filled(index, body, &node)?);
        }
        let base = self.tree.nodes.len();
        let copy_of = |index| body.own.binary_search(&index).ok().map(|at| base + at);
        for mut copy in copies {
            for link in &mut copy.children {
                match copy_of(link.node) {
                    Some(own) => link.node = own,
                    None => link.defined_here &= link.node >= body.end,
                }
            }
            let height = self.height_inside(&copy);
            self.store(copy, height)?;
        }
        self.tree
            .routes
            .extend(body.routes.iter().map(|route| Route {
                from: copy_of(route.from).unwrap_or(route.from),
                to: copy_of(route.to).unwrap_or(route.to),
                ..route.clone()
            }));
        let Some(root) = copy_of(body.root) else {
            return Ok(());
        };
        let mut exposed = Vec::new();
        for (place, &index) in body.own.iter().enumerate() {
            let connections = self.tree.nodes[index].connections.iter();
            exposed.extend(connections.map(|(field, name)| Exposed {
                name: Arc::clone(name),
                node: base + place,
                field: Arc::clone(field),
            }));
        }
        let made = &mut self.tree.nodes[root];
        made.complete &= node.complete;
        if !node.def.is_empty() {
            made.def = Arc::clone(&node.def);
        }
        let root = self.scaled(root, &node)?;
        if !node.def.is_empty() {
            if let Some(scope) = self.scopes.last_mut() {
                scope.nodes.insert(node.def, root);
            }
            self.exposed.insert(root, exposed);
        }
        self.link(root, slot, true);
        Ok(())
    }

    /// The first node of an instance, within a `Transform` where its file has another unit of
    /// length than that of the instance.
    fn scaled(&mut self, root: usize, instance: &Node) -> Result<usize, Error> {
        let made = &self.tree.nodes[root];
        let scale = made.file.length.metres / instance.file.length.metres;
        let is_placed = is_group(&made.kind) || &*made.kind == "Shape";
        if !is_placed || (scale - 1.0).abs() < f64::EPSILON {
            return Ok(root);
        }
        let mut around = Node {
            kind: "Transform".into(),
            file: Arc::clone(&instance.file),
            line: instance.line,
            complete: true,
            ..Node::default()
        };
        around.fields.push(Field {
            name: "scale".into(),
            value: format!("{scale} {scale} {scale}").into(),
        });
        around.children.push(Link {
            node: root,
            field: None,
            defined_here: true,
        });
        let height = self.height_inside(&around);
        self.store(around, height)
    }

    /// A copy of a node of a body, with the fields that an instance fills.
    fn filled(&mut self, index: usize, body: &Body, instance: &Node) -> Result<Node, Error> {
        let mut copy = self.tree.nodes[index].clone();
        for (field, outer) in std::mem::take(&mut copy.connections) {
            let given = instance.children.iter();
            let given: Vec<_> = given.filter(|l| l.field.as_ref() == Some(&outer)).collect();
            let value = instance.text(&outer).map(Arc::from);
            let default = body.interface.iter().find(|d| d.name == outer);
            let default = default.filter(|_| given.is_empty() && value.is_none());
            let units = instance.file.length.metres / copy.file.length.metres;
            let value = value.map(|value| in_units(&field, value, units));
            if let Some(value) = value.or_else(|| default?.value.clone()) {
                let name = Arc::clone(&field);
                copy.fields.push(Field { name, value });
            }
            let nodes: Vec<_> = match default {
                Some(default) => default.nodes.iter().collect(),
                None => given,
            };
            if !nodes.is_empty() {
                let place = Some(Arc::clone(&field));
                copy.children.retain(|link| link.field != place);
                copy.children.extend(nodes.into_iter().map(|link| Link {
                    field: place.clone(),
                    ..link.clone()
                }));
            }
            // The prototype around this instance may fill the field in turn.
            let further = instance.connections.iter();
            let further = further.filter(|(name, _)| *name == outer);
            let further = further.map(|(_, further)| (Arc::clone(&field), Arc::clone(further)));
            copy.connections.extend(further);
        }
        if is_inline(&copy.kind) {
            self.inline(&mut copy)?;
        }
        Ok(copy)
    }
}

/// A value of a field in units of which one of the value makes `units`; only lengths change.
fn in_units(field: &str, value: Arc<str>, units: f64) -> Arc<str> {
    if !LENGTHS.contains(&plain_name(field)) || (units - 1.0).abs() < f64::EPSILON {
        return value;
    }
    let numbers: Result<Vec<f64>, _> = words(&value).map(str::parse).collect();
    let Ok(numbers) = numbers else {
        return value;
    };
    let scaled: Vec<_> = numbers.iter().map(|x| format!("{:e}", x * units)).collect();
    scaled.join(" ").into()
}

/// Fields that hold lengths and nothing else.
const LENGTHS: &[&str] = &[
    "bottomRadius",
    "center",
    "height",
    "location",
    "point",
    "position",
    "radius",
    "size",
    "spine",
    "translation",
];

/// Whether a node stands for a file.
pub(super) fn is_inline(kind: &str) -> bool {
    matches!(kind, "Inline" | "InlineLoadControl")
}

/// The share of [`crate::Limits::entities`] that instances of prototypes and points of
/// deformers may make.
pub(super) const COPIES: usize = 250;
