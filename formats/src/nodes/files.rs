//! Files that are named inside a file: `Inline` and `EXTERNPROTO`.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;

use super::address::{Address, REMOTE};
use super::build::Builder;
use super::proto::{Body, Prototype, Scope};
use super::{Field, File, Link, Node, Spelling};
use crate::Error;

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

    /// Puts the scene of the first file that can be read into an `Inline`, in its units.
    ///
    /// # Errors
    /// If a limit is passed.
    pub(super) fn inline(&mut self, node: &mut Node) -> Result<(), Error> {
        // The prototype around it still has to say where it leads.
        if node.connections.iter().any(|(field, _)| &**field == "url") {
            return Ok(());
        }
        node.children.clear();
        if !node.flag("load", true, &mut self.warnings) {
            return Ok(());
        }
        let addresses = self.addresses(node);
        let scene = |contents: &Contents, _: Option<&str>| {
            Some((contents.scene?, contents.file.length.metres))
        };
        let Some((scene, metres)) = self.first_of(node, &addresses, scene)? else {
            return Ok(());
        };
        node.children.push(Link {
            node: scene,
            field: None,
            defined_here: false,
        });
        node.kind = "Transform".into();
        let scale = metres / node.file.length.metres;
        node.fields = vec![Field {
            name: "scale".into(),
            value: format!("{scale} {scale} {scale}").into(),
        }];
        Ok(())
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
        let body = |contents: &Contents, fragment: Option<&str>| {
            let name = fragment.or(contents.names.first.as_deref())?;
            match contents.names.prototypes.get(name)? {
                Prototype::Here(body) => Some(Arc::clone(body)),
                _ => None,
            }
        };
        self.first_of(node, addresses, body)
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
        wanted: impl Fn(&Contents, Option<&str>) -> Option<T>,
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
