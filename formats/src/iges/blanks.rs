//! What is blanked, and when it is shown nevertheless.

use super::directory::{Entry, File};
use super::entities::{self, Content};
use super::leftovers::is_geometry;
use super::links::{cycles, links};
use super::types::{self, Class};

/// How the directory attributes of an entity count for its members.
pub(super) mod hierarchy {
    /// They do not.
    pub(in super::super) const DEFER: u8 = 1;
    /// A property says which of them do.
    pub(in super::super) const BY_PROPERTY: u8 = 2;
}

/// Settles what is blanked in a file; the first entry that is shown nevertheless, if all that could
/// be shown is blanked.
pub(super) fn settle(file: &mut File<'_>) -> Option<usize> {
    if !file.entries.iter().any(|entry| entry.blanked) {
        return None;
    }
    defer(file);
    unblank(file)
}

/// A group or an instance that is blanked hides nothing if its members go by what they say
/// themselves. A solid or a shell is one thing with its parts.
fn defer(file: &mut File<'_>) {
    for index in 0..file.entries.len() {
        let entry = &file.entries[index];
        let gathers = matches!(entry.kind, 184 | 402 | 408 | 412 | 414 | 420 | 430);
        let defers = match entry.hierarchy {
            _ if !entry.blanked || !gathers => false,
            hierarchy::DEFER => true,
            hierarchy::BY_PROPERTY => {
                let entity = entities::read(file, index);
                entity.is_ok_and(|e| e.is_some_and(|e| e.defers_blanking))
            }
            _ => false,
        };
        if defers {
            file.entries[index].blanked = false;
        }
    }
}

/// Shows what is blanked where there is nothing else, and surfaces also where there are only
/// curves else; the first such entry.
fn unblank(file: &mut File<'_>) -> Option<usize> {
    let owners = links(file).owners;
    let visible = Reached::new(file, &owners);
    if visible.has_sheet {
        return None;
    }
    let before: Vec<_> = file.entries.iter().map(|e| e.blanked).collect();
    let all = !visible.has_wire;
    for entry in &mut file.entries {
        entry.blanked &= !all && types::is_wire(entry.kind);
    }
    let found = Reached::new(file, &owners);
    if found.has_sheet || all && found.has_wire {
        return (0..before.len()).find(|&index| before[index] && found.entries[index]);
    }
    for (entry, blanked) in file.entries.iter_mut().zip(before) {
        entry.blanked = blanked;
    }
    None
}

/// By entry: whether it is shown, as far as what is blanked tells.
pub(super) fn shown(file: &File<'_>) -> Vec<bool> {
    Reached::new(file, &links(file).owners).entries
}

/// What is found from the entries that stand for themselves on, without what is blanked.
#[derive(Debug)]
struct Reached {
    /// By entry: whether it is.
    entries: Vec<bool>,
    has_sheet: bool,
    has_wire: bool,
}

impl Reached {
    fn new(file: &File<'_>, owners: &[Option<usize>]) -> Self {
        let mut reached = Self {
            entries: vec![false; file.entries.len()],
            has_sheet: false,
            has_wire: false,
        };
        let stand_alone = (0..file.entries.len()).filter(|&i| stands_alone(file, owners, i));
        let around = cycles(owners).into_iter();
        let around = around.filter(|&i| !file.entries[i].blanked);
        let mut open: Vec<_> = stand_alone.chain(around).collect();
        while let Some(index) = open.pop() {
            if std::mem::replace(&mut reached.entries[index], true) {
                continue;
            }
            let entry = &file.entries[index];
            let members = if types::is_composed(entry.kind) {
                members(file, index)
            } else {
                None
            };
            match members {
                Some(members) => {
                    let found = members.into_iter().filter_map(|pointer| file.find(pointer));
                    open.extend(found.filter(|&i| shows_member(entry, &file.entries[i])));
                }
                None if types::is_wire(entry.kind) => reached.has_wire = true,
                None => reached.has_sheet = true,
            }
        }
        reached
    }
}

/// Pointers to what an entity is composed of, if it is.
fn members(file: &File<'_>, index: usize) -> Option<Vec<i64>> {
    let entity = match entities::read(file, index) {
        Ok(entity) => entity,
        // No surface is missed with a group.
        Err(_) if file.entries[index].kind == 402 => None,
        Err(_) => return None,
    };
    match entity.map(|entity| entity.content) {
        Some(Content::Copies(copies)) => Some(vec![copies.base]),
        Some(content) => content.into_members(),
        None => Some(Vec::new()),
    }
}

/// The entities that are shown for their own sake: stray curves where there is nothing else.
pub(super) fn standing(file: &File<'_>, owners: &[Option<usize>]) -> Vec<usize> {
    let all = || 0..file.entries.len();
    let standing: Vec<_> = all().filter(|&i| stands_alone(file, owners, i)).collect();
    if standing.is_empty() {
        return all().filter(|&i| is_unowned(file, owners, i)).collect();
    }
    standing
}

/// Whether an entity is shown for its own sake.
fn stands_alone(file: &File<'_>, owners: &[Option<usize>], index: usize) -> bool {
    let entry = &file.entries[index];
    // Curves that belong to something which does not name them are no news.
    let is_stray = types::is_wire(entry.kind) && entry.dependent;
    is_unowned(file, owners, index) && !is_stray
}

/// Whether an entity can be shown for its own sake, and nothing else shows it.
fn is_unowned(file: &File<'_>, owners: &[Option<usize>], index: usize) -> bool {
    let entry = &file.entries[index];
    is_shown(entry) && owners[index].is_none() && !entry.blanked
}

/// Whether a member of a group, definition or shell is shown with that.
pub(super) fn shows_member(parent: &Entry, entry: &Entry) -> bool {
    let is_definition = match entry.kind {
        308 => matches!(parent.kind, 408 | 412 | 414),
        320 => parent.kind == 420,
        _ => false,
    };
    is_definition || !entry.blanked && types::class(entry.kind) == Class::Shown
}

/// Whether an entity can be shown for its own sake.
fn is_shown(entry: &Entry) -> bool {
    let Entry { kind, form, .. } = *entry;
    let is_readable = match kind {
        402 => types::is_group(kind, form) || form == entities::PARENT,
        kind => !types::is_wire(kind) || types::is_free_form(kind, form),
    };
    types::class(kind) == Class::Shown && is_geometry(entry) && is_readable
}
