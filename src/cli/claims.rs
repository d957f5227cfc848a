//! Who writes where in a batch: nobody over what a file of it is read from, whether that was given or
//! is named by such a file, nor over what another one writes.

use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

use anyhow::bail;

use super::input::{self, ReadArgs};

/// The places of a batch.
#[derive(Debug)]
pub(super) struct Claims {
    members: Vec<Member>,
    /// Where they stand.
    inputs: HashSet<PathBuf>,
    read: ReadArgs,
    /// Who has written, or is about to write, where.
    taken: Mutex<HashMap<PathBuf, usize>>,
}

/// One file of a batch.
#[derive(Debug)]
struct Member {
    source: PathBuf,
    /// The folder in which, and below, the files are that it may name.
    folder: Option<PathBuf>,
    /// The files that it names: they are looked for when something is to be written over what may be
    /// one of them.
    named: OnceLock<HashSet<PathBuf>>,
}

impl Claims {
    /// Of a batch without claims, by inputs and outputs; the number of a file is its position.
    pub(super) fn new(pairs: &[(&Path, &Path)], read: &ReadArgs) -> Self {
        let member = |&(source, _): &(&Path, &Path)| Member {
            source: source.to_owned(),
            folder: read.root(source).canonicalize().ok(),
            named: OnceLock::new(),
        };
        let mut taken = HashMap::new();
        for (number, (_, output)) in pairs.iter().enumerate() {
            taken.entry(place(output)).or_insert(number);
        }
        let inputs = pairs.iter().filter_map(|pair| pair.0.canonicalize().ok());
        Self {
            members: pairs.iter().map(member).collect(),
            inputs: inputs.collect(),
            read: read.clone(),
            taken: Mutex::new(taken),
        }
    }

    /// Whether a path is one of the inputs.
    pub(super) fn is_input(&self, path: &Path) -> bool {
        self.inputs.contains(&place(path))
    }

    /// Claims the places of all that is written for a file of this number.
    ///
    /// # Errors
    /// If one of them is an input, is named by an input, or is where another file is written.
    pub(super) fn claim(&self, number: usize, outputs: &[PathBuf]) -> anyhow::Result<()> {
        for path in outputs {
            if self.is_input(path) {
                bail!(input::over_input(path));
            }
            if let Some(member) = self.named_by(number, path) {
                let by = input::display(&member.source);
                bail!("{}, which {by} names", input::over_input(path));
            }
        }
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let by_other = |path: &&PathBuf| taken.get(&place(path)).is_some_and(|by| *by != number);
        if let Some(path) = outputs.iter().find(by_other) {
            let other = taken.get(&place(path)).map(|&by| &self.members[by]);
            let other = other.map_or_else(String::new, |member| input::display(&member.source));
            let (own, shown) = (input::display(&self.members[number].source), path.display());
            bail!(
                "{own}: what {other} becomes would be written to {shown}, too; rename one or write \
                 them to different folders"
            );
        }
        taken.extend(outputs.iter().map(|path| (place(path), number)));
        Ok(())
    }

    /// A file of the batch other than the one of this number that names what stands at a path.
    fn named_by(&self, number: usize, path: &Path) -> Option<&Member> {
        let place = path.canonicalize().ok()?;
        let mut others = self.members.iter().enumerate();
        let found = others.find(|(other, member)| {
            let folder = member.folder.as_ref();
            let reaches = folder.is_some_and(|folder| place.starts_with(folder));
            *other != number && reaches && self.named(member).contains(&place)
        });
        found.map(|(_, member)| member)
    }

    /// The files that a member names.
    fn named<'a>(&self, member: &'a Member) -> &'a HashSet<PathBuf> {
        member.named.get_or_init(|| {
            // What is read from a pipe cannot be read twice.
            let named = member
                .source
                .is_file()
                .then(|| self.read.named(&member.source));
            let named = named.into_iter().flatten();
            named.filter_map(|path| path.canonicalize().ok()).collect()
        })
    }
}

/// Where a path leads, also before anything stands there: what is not there will be made as a folder.
fn place(path: &Path) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut place = PathBuf::new();
    for part in whole.components() {
        if part == Component::ParentDir {
            place.pop();
        } else {
            place.push(part);
        }
        if let Ok(real) = place.canonicalize() {
            place = real;
        }
    }
    place
}
