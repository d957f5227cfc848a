//! Files that are named inside a file: `Inline` and `EXTERNPROTO`.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;

use super::address::Address;
use super::build::Builder;
use super::proto::{Body, Prototype, Scope};
use super::{Field, File, Link, Node, Spelling};
use crate::pictures::REMOTE;
use crate::{Error, Problem};

/// How deep files may stand inside each other.
const DEEP: usize = 32;

/// How many files one file may name, with all that these name.
const FILES: usize = 1000;

/// What is known about files.
#[derive(Debug)]
pub(super) struct Loader {
    spelling: Spelling,
    /// The scene of the file that is being read, once it is complete.
    pub(super) scene: Option<usize>,
    /// The first of the scopes that belong to this file.
    pub(super) first_scope: usize,
    /// Marks of the contents that are being read: a file must not contain itself.
    reading: Vec<u64>,
    /// Files by name; for those that could not be read, why.
    known: HashMap<Arc<str>, Result<Arc<Contents>, String>>,
    /// What these files have in bytes together.
    bytes: usize,
}

/// What a file holds.
#[derive(Debug)]
pub(super) struct Contents {
    file: Arc<File>,
    scene: Option<usize>,
    names: Scope,
}

impl Loader {
    pub(super) fn new(spelling: Spelling) -> Self {
        Self {
            spelling,
            scene: None,
            first_scope: 0,
            reading: Vec::new(),
            known: HashMap::new(),
            bytes: 0,
        }
    }
}

impl Builder<'_> {
    /// Reads the content of a file to its end, or to where it is broken.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn read(&mut self, bytes: &[u8]) -> Result<Option<Error>, Error> {
        self.loader.reading.push(mark(bytes));
        self.scopes.push(Scope::default());
        let spelling = self.loader.spelling;
        spelling(bytes, self)
    }

    /// Puts the scene of the first file that can be read into an `Inline`, in its units. Gives
    /// what that file holds.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn inline(&mut self, node: &mut Node) -> Result<Option<Arc<Contents>>, Error> {
        // The prototype around it still has to say where it leads.
        if node.connections.iter().any(|(field, _)| &**field == "url") {
            return Ok(None);
        }
        node.children.clear();
        if !node.flag("load", true, &mut self.warnings) {
            return Ok(None);
        }
        let addresses = self.addresses(node);
        let scene = |contents: &Arc<Contents>, _: Option<&str>| {
            Some((contents.scene?, Arc::clone(contents)))
        };
        let Some((scene, contents)) = self.first_of(node, &addresses, scene)? else {
            return Ok(None);
        };
        node.children.push(Link {
            node: scene,
            field: None,
            defined_here: false,
        });
        node.kind = "Transform".into();
        let scale = contents.file.length.metres / node.file.length.metres;
        node.fields = vec![Field {
            name: "scale".into(),
            value: format!("{scale} {scale} {scale}").into(),
        }];
        Ok(Some(contents))
    }

    /// The files that a node names; a URN says nothing about where one is.
    pub(super) fn addresses(&self, node: &Node) -> Vec<Address> {
        let all = node.strings("url").into_iter();
        let places = all.filter(|address| !is_urn(address));
        places.map(|a| self.file.address_of_part(&a)).collect()
    }

    /// The prototype from the first of these files that has it.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn fetch_prototype(
        &mut self,
        node: &Node,
        addresses: &[Address],
    ) -> Result<Option<Arc<Body>>, Error> {
        let body = |contents: &Arc<Contents>, fragment: Option<&str>| {
            let name = fragment.or(contents.names.first.as_deref())?;
            match contents.names.prototypes.get(name)? {
                Prototype::Here(body) => Some(Arc::clone(body)),
                _ => None,
            }
        };
        self.first_of(node, addresses, body)
    }

    /// An `EXPORT`: what other files may import from this one.
    pub(super) fn export(&mut self, statement: &Node) {
        let local = statement.name_in("localDEF");
        let name = Some(statement.name_in("AS")).filter(|name| !name.is_empty());
        if let Some(scope) = self.scopes.last_mut() {
            let name = name.unwrap_or_else(|| Arc::clone(&local));
            scope.exports.insert(name, local);
        }
    }

    /// An `IMPORT`: gives a name to a node of the file of an `Inline`. What several `Inline`s show
    /// of one file is the same for all of them.
    pub(super) fn import(&mut self, statement: &Node) {
        let [inline, first, second, other] =
            ["inlineDEF", "importedDEF", "exportedDEF", "AS"].map(|f| statement.name_in(f));
        let name = if first.is_empty() { second } else { first };
        let what = format!("IMPORT of {name}");
        let place = self.file.place(statement.line, &what);
        let node = match self.imported(&inline, &name) {
            Ok((node, problem)) => {
                if let Some(problem) = problem {
                    self.warnings.add(place, problem);
                }
                node
            }
            Err(problem) => return self.warnings.add(place, problem),
        };
        let name = if other.is_empty() { name } else { other };
        if let Some(scope) = self.scopes.last_mut() {
            scope.nodes.insert(name, node);
        }
    }

    /// The node of this name in the file of an `Inline`, and what is wrong with it.
    fn imported(&self, inline: &str, name: &str) -> Result<(usize, Option<Problem>), Problem> {
        let scope = self.scopes.last();
        let contents = scope.and_then(|scope| scope.inlines.get(inline));
        let Some(contents) = contents else {
            let text = format!("no Inline before it has the DEF \"{inline}\"; it is left out");
            return Err(Problem::Invalid(text));
        };
        let Some(contents) = contents else {
            let text = format!("the Inline {inline} shows no file; it is left out");
            return Err(Problem::Unsupported(text));
        };
        let (file, names) = (&contents.file, &contents.names);
        let exported = names.exports.get(name);
        let Some(&node) = names.nodes.get(exported.map_or(name, |own| own)) else {
            let text = format!("{} has no such node; it is left out", file.name);
            return Err(Problem::Invalid(text));
        };
        let problem = if exported.is_none() {
            let text = format!("{} has no EXPORT of it; it is taken anyhow", file.name);
            Some(Problem::Invalid(text))
        } else if file.length.metres.to_bits() != self.file.length.metres.to_bits() {
            let text = format!(
                "{} has another unit of length; what is used of it or routed to it is not scaled",
                file.name
            );
            Some(Problem::Unsupported(text))
        } else {
            None
        };
        Ok((node, problem))
    }

    /// What is wanted from the first of these files that has it; if there is none, a warning
    /// says why.
    ///
    /// # Errors
    /// If a limit is passed.
    fn first_of<T>(
        &mut self,
        node: &Node,
        addresses: &[Address],
        wanted: impl Fn(&Arc<Contents>, Option<&str>) -> Option<T>,
    ) -> Result<Option<T>, Error> {
        let mut reasons = Vec::new();
        for address in addresses {
            let mut reason = REMOTE.to_owned();
            for name in &address.names {
                reason = match self.load(name)? {
                    Ok(contents) => match wanted(&contents, address.fragment.as_deref()) {
                        Some(found) => return Ok(Some(found)),
                        None => "it does not have what is wanted".to_owned(),
                    },
                    Err(reason) => reason,
                };
            }
            reasons.push(format!("{}: {reason}", address.shown));
        }
        if !reasons.is_empty() {
            let reasons = reasons.join("; ");
            let text = format!("a file that is named could not be read: {reasons}");
            self.warnings.unsupported(node.place(), text);
        }
        Ok(None)
    }

    /// What a file holds, or why it cannot be read. Each name is read once.
    ///
    /// # Errors
    /// If a limit is passed.
    fn load(&mut self, name: &str) -> Result<Result<Arc<Contents>, String>, Error> {
        if let Some(known) = self.loader.known.get(name) {
            return Ok(known.clone());
        }
        if self.loader.known.len() >= FILES {
            return Ok(Err(format!("more than {FILES} files are named")));
        }
        let contents = match self.fetch(name) {
            Ok(bytes) => Ok(Arc::new(self.contents(name, &bytes)?)),
            Err(reason) => Err(reason),
        };
        self.loader.known.insert(name.into(), contents.clone());
        Ok(contents)
    }

    /// The bytes of a file, decompressed.
    fn fetch(&mut self, name: &str) -> Result<Vec<u8>, String> {
        if self.loader.reading.len() >= DEEP {
            return Err(format!("files stand in each other deeper than {DEEP}"));
        }
        let bytes = self.options.resolver.resolve(name);
        let bytes = bytes.map_err(|problem| problem.to_string())?;
        let rest = self.options.limits.bytes - self.loader.bytes;
        let bytes = crate::plain(&bytes, rest).map_err(|problem| problem.to_string())?;
        self.loader.bytes += bytes.len();
        if self.loader.reading.contains(&mark(&bytes)) {
            return Err("it contains itself".to_owned());
        }
        Ok(bytes.into_owned())
    }

    /// Reads a file that is named in another one.
    ///
    /// # Errors
    /// If a limit is passed.
    fn contents(&mut self, name: &str, bytes: &[u8]) -> Result<Contents, Error> {
        let file = File {
            name: name.to_owned(),
            ..File::default()
        };
        let outer_file = std::mem::replace(&mut self.file, Arc::new(file));
        let outer_scene = self.loader.scene.take();
        let outer_scope = std::mem::replace(&mut self.loader.first_scope, self.scopes.len());
        // What is open belongs to the outer file, and nothing of this one is put into it.
        let outer_open = std::mem::take(&mut self.open);
        self.read(bytes)?;
        self.close_to(0)?;
        self.open = outer_open;
        self.loader.reading.pop();
        let names = self.scopes.drain(self.loader.first_scope..).next();
        self.loader.first_scope = outer_scope;
        Ok(Contents {
            file: std::mem::replace(&mut self.file, outer_file),
            scene: std::mem::replace(&mut self.loader.scene, outer_scene),
            names: names.unwrap_or_default(),
        })
    }
}

/// What tells contents apart.
fn mark(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    hasher.finish()
}

/// Whether an address is a name that says nothing about where a file is.
pub(super) fn is_urn(address: &str) -> bool {
    let scheme = address.get(..4);
    scheme.is_some_and(|scheme| scheme.eq_ignore_ascii_case("urn:"))
}
