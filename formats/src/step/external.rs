//! Products of which the shape is in another file.

use std::cell::{Cell, RefCell};
use std::collections::HashMap;

use super::part21::Exchange;
use super::translator::Translator;
use super::units::Units;
use crate::{Problem, ReadOptions};

/// How many files one file may name, with those that these name.
const FILES: usize = 10_000;

/// How deep files may stand in each other.
const DEEP: usize = 16;

/// What a file becomes, or why it cannot be read.
type Loaded = Result<(i64, Units), String>;

/// The files that are named in others.
pub(super) struct Files<'o> {
    options: &'o ReadOptions<'o>,
    /// By name, once they have been read.
    known: RefCell<HashMap<String, Loaded>>,
    /// The names of those that are being read.
    reading: RefCell<Vec<String>>,
    /// How many more bytes they may have.
    left: Cell<usize>,
}

impl<'o> Files<'o> {
    pub(super) fn new(options: &'o ReadOptions<'o>) -> Self {
        Self {
            options,
            known: RefCell::default(),
            reading: RefCell::default(),
            left: Cell::new(options.limits.bytes),
        }
    }
}

impl std::fmt::Debug for Files<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Files").finish_non_exhaustive()
    }
}

impl Translator<'_> {
    /// The definition of what another file shows, which stands for a product, and its units.
    pub(super) fn external(
        &mut self,
        document: u64,
        name: &str,
        depth: usize,
    ) -> Option<(i64, Units)> {
        let known = self.files.known.borrow().get(name).cloned();
        let loaded = known.unwrap_or_else(|| {
            let loaded = self.load(name, depth);
            let mut known = self.files.known.borrow_mut();
            known.insert(name.to_owned(), loaded.clone());
            loaded
        });
        loaded
            .map_err(|reason| {
                let text = format!("the file \"{name}\" could not be read: {reason}");
                self.fail(document, Problem::Unsupported(text));
            })
            .ok()
    }

    fn load(&mut self, name: &str, depth: usize) -> Loaded {
        let files = self.files;
        let is_open = files.reading.borrow().iter().any(|open| open == name);
        if is_open {
            return Err("it contains itself".to_owned());
        }
        if files.reading.borrow().len() >= DEEP {
            return Err(format!("files stand in each other deeper than {DEEP}"));
        }
        if files.known.borrow().len() >= FILES {
            return Err(format!("more than {FILES} files are named"));
        }
        let bytes = files.options.resolver.resolve(name);
        let bytes = bytes.map_err(|problem| problem.to_string())?;
        let bytes =
            crate::plain(&bytes, files.left.get()).map_err(|problem| problem.to_string())?;
        files.left.set(files.left.get() - bytes.len());
        if !super::sniff(&bytes) {
            return Err("it is no STEP file".to_owned());
        }
        files.reading.borrow_mut().push(name.to_owned());
        let loaded = self.translate(name, &bytes, depth);
        files.reading.borrow_mut().pop();
        loaded
    }

    /// Writes another file down beside this one.
    fn translate(&mut self, name: &str, bytes: &[u8], depth: usize) -> Loaded {
        let exchange = Exchange::new(bytes, self.limits.entities);
        let exchange = exchange.map_err(|problem| problem.to_string())?;
        let mut inner = Translator::new(&exchange, self.limits, self.files);
        name.clone_into(&mut inner.file);
        inner.continue_with(self);
        let (shown, units) = inner.whole(depth);
        let loaded = match units.or_else(|| (!shown.is_empty()).then(Units::default)) {
            Some(units) if !shown.is_empty() => {
                Ok((inner.definition(shown, 0, String::new()), units))
            }
            _ => Err("it shows nothing".to_owned()),
        };
        self.continue_with(&mut inner);
        loaded
    }
}
