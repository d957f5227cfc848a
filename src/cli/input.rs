//! Input files of every command: reading, limits, and what to say about warnings.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context as _, anyhow, bail};
use nurbray::formats::{
    self, FORMATS, Folder, Import, Limits, NoFiles, Problem, ReadOptions, Resolver, Warnings,
};
use nurbray::output;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use super::parse;
use super::say::say;

/// Warnings that are printed one by one; `info` shows all.
const WARNINGS_SHOWN: usize = 8;

/// Options that concern reading.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ReadArgs {
    /// Multiply the limits on file size, entities, points, nesting, instances, pictures and laid curves by this factor
    #[arg(long, value_name = "FACTOR", default_value_t = 1, value_parser = parse::count(1..=u32::MAX))]
    relax_limits: u32,
    /// Let files name others in this folder and below, not only beside themselves
    #[arg(long, value_name = "FOLDER", value_parser = parse::folder)]
    within: Option<PathBuf>,
}

/// A file that has been read.
#[derive(Debug)]
pub(super) struct Loaded {
    pub(super) import: Import,
    pub(super) took: Duration,
    /// What was read beside it.
    pub(super) beside: Named,
}

impl ReadArgs {
    pub(super) fn limits(&self) -> Limits {
        let factor = self.relax_limits as usize;
        let limits = Limits::default();
        Limits {
            bytes: limits.bytes.saturating_mul(factor),
            entities: limits.entities.saturating_mul(factor),
            nesting: limits.nesting.saturating_mul(factor),
            points: limits.points.saturating_mul(factor),
            placements: limits
                .placements
                .saturating_mul(u64::from(self.relax_limits)),
            laying: limits.laying.saturating_mul(factor),
            texels: limits.texels.saturating_mul(factor),
        }
    }

    /// Reads a file, or standard input for `-`.
    pub(super) fn load(&self, path: &Path) -> anyhow::Result<Loaded> {
        let started = Instant::now();
        let mut loaded = self.understand(path, &self.bytes(path)?)?;
        loaded.took = started.elapsed();
        Ok(loaded)
    }

    /// The content of a file, or of standard input for `-`.
    pub(super) fn bytes(&self, path: &Path) -> anyhow::Result<Vec<u8>> {
        read_bytes(path, self.limits().bytes).with_context(|| display(path))
    }

    /// Makes a scene of the content of a file.
    pub(super) fn understand(&self, path: &Path, bytes: &[u8]) -> anyhow::Result<Loaded> {
        let started = Instant::now();
        let limits = self.limits();
        let beside = self.beside(path, &limits);
        let options = ReadOptions {
            limits: &limits,
            resolver: &beside,
        };
        let import = formats::read(bytes, ending(path).as_deref(), &options);
        Ok(Loaded {
            import: import
                .map_err(|error| advised(error, path))
                .with_context(|| display(path))?,
            took: started.elapsed(),
            beside: beside.found.into_inner(),
        })
    }

    /// The places of the files that a file names, whether it can be read or not.
    pub(super) fn named(&self, path: &Path) -> Vec<PathBuf> {
        let Ok(bytes) = self.bytes(path) else {
            return Vec::new();
        };
        let limits = self.limits();
        let beside = self.beside(path, &limits);
        let options = ReadOptions {
            limits: &limits,
            resolver: &beside,
        };
        // What is wrong with it is told when it is converted.
        let _ = formats::read(&bytes, ending(path).as_deref(), &options);
        let named = beside.found.into_inner();
        named.keys().map(|name| Beside::place(path, name)).collect()
    }

    /// The folder in which, and below, the files are that a file may name.
    pub(super) fn root<'a>(&'a self, path: &'a Path) -> &'a Path {
        let root = self.within.as_deref();
        root.unwrap_or_else(|| output::folder(path))
    }

    /// What fetches the files that a file names.
    pub(super) fn beside<'a>(&'a self, path: &'a Path, limits: &'a Limits) -> Beside<'a> {
        let base = path.parent().unwrap_or(Path::new(""));
        let root = self.within.as_deref().unwrap_or(base);
        Beside {
            folder: (!is_stdin(path)).then(|| Folder::new(base, root, limits)),
            found: RefCell::default(),
        }
    }
}

/// The error, with what helps: where a limit is passed, or where another command reads the file.
fn advised(error: formats::Error, path: &Path) -> anyhow::Error {
    let is_unknown = error.format.is_empty();
    match (&error.problem, ending(path).as_deref()) {
        (Problem::TooLarge(_), _) => anyhow!("{error}; --relax-limits multiplies the limits"),
        (_, Some("glb" | "gltf" | "stl" | "ply")) if is_unknown => {
            anyhow!("{error}; `nurbray compare` measures meshes")
        }
        (_, Some("dcm")) if is_unknown => anyhow!("{error}; `nurbray model` reads contours"),
        _ => error.into(),
    }
}

impl Loaded {
    /// Refuses outputs that would be written over one of the files that `source`, which was read,
    /// names.
    pub(super) fn check_beside(&self, source: &Path, outputs: &[PathBuf]) -> anyhow::Result<()> {
        let named = self.beside.keys().map(|name| Beside::place(source, name));
        check_apart(outputs, &named.collect::<Vec<_>>())
    }
}

/// The files that are given, themselves or by their folders.
///
/// # Errors
/// As [`files_at`].
pub(super) fn files(given: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let files: Result<Vec<_>, _> = given.iter().map(|path| files_at(path)).collect();
    Ok(files?.concat())
}

/// The file at a path; of a folder those in it and below that some format may read, hidden ones aside.
///
/// # Errors
/// If it is a folder that has no such file.
pub(super) fn files_at(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let shown = path.display();
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut files = Vec::new();
    find(path, &mut files);
    if files.is_empty() {
        bail!("{shown}: there is no file in it that could be read");
    }
    Ok(files)
}

/// Collects the files below a folder that some format may read, in the order of their names.
///
/// A folder that cannot be read is among them, to be told as a file that cannot.
fn find(folder: &Path, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let Ok(mut entries) = entries else {
        found.push(folder.to_owned());
        return;
    };
    // Other systems leave files such as `._part.igs` beside those that are meant.
    let is_hidden = |entry: &fs::DirEntry| entry.file_name().as_encoded_bytes().starts_with(b".");
    entries.retain(|entry| !is_hidden(entry));
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        // Links to folders are not followed: they may lead back.
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            find(&path, found);
        } else if is_known(&path) && (path.is_file() || path.metadata().is_err()) {
            // A link to nowhere is told as a file that cannot be read.
            found.push(path);
        }
    }
}

/// Whether some format has the ending of this name, or the one before `.gz`.
fn is_known(path: &Path) -> bool {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    let extension = Path::new(name).extension().and_then(|e| e.to_str());
    let has = |e: &str| FORMATS.iter().any(|format| format.extensions.contains(&e));
    extension.is_some_and(has)
}

/// The ending of a file, in small letters.
pub(super) fn ending(path: &Path) -> Option<String> {
    let extension = path.extension();
    extension.map(|e| e.to_string_lossy().to_lowercase())
}

/// The content of a file, or of standard input for `-`.
pub(super) fn read_bytes(path: &Path, limit: usize) -> io::Result<Vec<u8>> {
    if is_stdin(path) {
        formats::read_within(io::stdin().lock(), limit)
    } else if path.is_dir() {
        fs::read_dir(path)?;
        let text = "this is a folder; name a file in it";
        Err(io::Error::new(io::ErrorKind::IsADirectory, text))
    } else {
        formats::read_within(File::open(path)?, limit)
    }
}

/// The hash by which contents are told apart.
pub(super) fn sha256(bytes: &[u8]) -> String {
    let hash = Sha256::digest(bytes);
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The files that a file names, as it spells them, each with the hash of its content; without one
/// where it could not be read.
pub(super) type Named = BTreeMap<String, Option<String>>;

/// Fetches the files that a file names, and keeps in mind which these were.
#[derive(Debug)]
pub(super) struct Beside<'a> {
    /// Where they are; standard input has no place.
    folder: Option<Folder<'a>>,
    found: RefCell<Named>,
}

impl Beside<'_> {
    /// Where a file is that is named.
    pub(super) fn place(source: &Path, name: &str) -> PathBuf {
        source.with_file_name(name.replace('\\', "/"))
    }
}

impl Resolver for Beside<'_> {
    fn resolve(&self, name: &str) -> io::Result<Vec<u8>> {
        let bytes = match &self.folder {
            Some(folder) => folder.resolve(name),
            None => NoFiles.resolve(name),
        };
        let hash = bytes.as_deref().ok().map(sha256);
        self.found.borrow_mut().insert(name.to_owned(), hash);
        bytes
    }
}

/// Whether a name stands for standard input, or for standard output.
pub(super) fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// The name of a file in messages.
pub(super) fn display(path: &Path) -> String {
    if is_stdin(path) {
        "standard input".to_owned()
    } else {
        path.display().to_string()
    }
}

/// The part of a file's name that `{stem}` stands for.
pub(super) fn stem(path: &Path) -> &OsStr {
    let stem = path.file_stem().filter(|_| !is_stdin(path));
    stem.unwrap_or(OsStr::new("stdin"))
}

/// The name of an output: `{stem}` and `{ext}` stand for the name and the ending of its input, and
/// `{frame}` for the number of a frame.
pub(super) fn named(pattern: &str, path: &Path, frame: &str) -> OsString {
    let words = [
        ("{stem}", stem(path)),
        ("{ext}", path.extension().unwrap_or_default()),
        ("{frame}", OsStr::new(frame)),
    ];
    let (mut name, mut rest) = (OsString::new(), pattern);
    while let Some(brace) = rest.find('{') {
        let (before, from) = rest.split_at(brace);
        let word = words.iter().find(|(word, _)| from.starts_with(word));
        let (word, value) = word.copied().unwrap_or(("{", OsStr::new("{")));
        name.push(before);
        name.push(value);
        rest = &from[word.len()..];
    }
    name.push(rest);
    name
}

/// Refuses a pattern in which a word in braces stands for nothing; `option` is what it was given to.
pub(super) fn check_pattern(option: &str, pattern: &str, known: &[&str]) -> anyhow::Result<()> {
    let ends = pattern.split('{').skip(1);
    let words = ends.filter_map(|rest| Some(rest.split_once('}')?.0));
    let is_word = |word: &&str| !word.is_empty() && word.chars().all(char::is_alphabetic);
    let Some(word) = words.filter(is_word).find(|word| !known.contains(word)) else {
        return Ok(());
    };
    let known: Vec<_> = known.iter().map(|word| format!("{{{word}}}")).collect();
    let advice = match known.join(", ") {
        known if known.is_empty() => String::new(),
        known => format!("; what does is {known}"),
    };
    bail!("{option} {pattern}: {{{word}}} stands for nothing{advice}")
}

/// For every pair of an input and where it goes: the reason, if another one goes there, too.
pub(super) fn clashes(pairs: &[(&Path, &Path)]) -> Vec<Option<String>> {
    let mut takers: HashMap<&Path, Vec<&Path>> = HashMap::new();
    for &(file, target) in pairs {
        takers.entry(target).or_default().push(file);
    }
    let clash = |&(file, target): &(&Path, &Path)| {
        let all = &takers[target];
        let own = all.iter().position(|&other| other == file)?;
        let other = if own > 0 { all.first() } else { all.get(1) }?;
        let advice = if stem(file) != stem(other) {
            "put {stem} into -o"
        } else if file.extension() != other.extension() {
            "put {stem}-{ext} into -o"
        } else {
            "rename one or write them to different folders"
        };
        let (file, other, target) = (display(file), display(other), target.display());
        Some(format!(
            "{file}: {other} would be written to {target}, too; {advice}"
        ))
    };
    pairs.iter().map(clash).collect()
}

/// Refuses outputs that would be written over one of these inputs.
pub(super) fn check_apart(outputs: &[PathBuf], inputs: &[PathBuf]) -> anyhow::Result<()> {
    let real = |path: &PathBuf| path.canonicalize().ok();
    let inputs: Vec<_> = inputs.iter().filter_map(real).collect();
    let over = |path: &&PathBuf| real(path).is_some_and(|path| inputs.contains(&path));
    match outputs.iter().find(over) {
        Some(path) => bail!(over_input(path)),
        None => Ok(()),
    }
}

/// Why nothing is written to a path.
pub(super) fn over_input(path: &Path) -> String {
    format!("{}: an input would be written over", path.display())
}

/// Prints the first warnings about a file, and how many more there are; `format` is that of the
/// file in which their places are: of what is written, the one that was read.
pub(super) fn report_warnings(path: &Path, format: &str, warnings: &Warnings) {
    let warnings = warnings.as_slice();
    for warning in warnings.iter().take(WARNINGS_SHOWN) {
        let space = if format.is_empty() { "" } else { " " };
        say!(
            "nurbray: {}: warning: {format}{space}{warning}",
            display(path)
        );
    }
    if let Some(more) = warnings
        .len()
        .checked_sub(WARNINGS_SHOWN)
        .filter(|&more| more > 0)
    {
        say!(
            "nurbray: {}: {more} more kinds of warnings; 'nurbray info' shows them",
            display(path)
        );
    }
}

/// Warnings for machines.
pub(super) fn warnings_json(warnings: &Warnings) -> Value {
    let place = |place: &formats::Place| json!({ "line": place.line, "what": place.what });
    let warning = |warning: &formats::Warning| {
        json!({
            "kind": warning.problem.kind(),
            "text": warning.problem.to_string(),
            "count": warning.count,
            "places": warning.places.iter().map(place).collect::<Vec<_>>(),
        })
    };
    warnings.as_slice().iter().map(warning).collect()
}
