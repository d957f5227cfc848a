//! Which entity refers to which.

use super::directory::File;
use super::entities;

/// Who refers to whom.
pub(super) struct Links {
    /// For each entity one that refers to it as its own.
    pub owners: Vec<Option<usize>>,
    /// Whether it is the surface of a face or a hole in it, a face of a shell or a shell of a solid, and
    /// shown as that.
    pub is_part: Vec<bool>,
}

/// Collects all references.
pub(super) fn links(file: &File<'_>) -> Links {
    let count = file.entries.len();
    let mut links = Links {
        owners: vec![None; count],
        is_part: vec![false; count],
    };
    for (index, entry) in file.entries.iter().enumerate() {
        for pointer in entities::references(file, index) {
            if let Some(owned) = file.find(pointer) {
                links.owners[owned] = Some(index);
                let is_body = matches!(entry.kind, 186 | 514) && !entry.blanked;
                let is_face = matches!(entry.kind, 143 | 144 | 510)
                    || (entry.kind, entry.form) == (402, entities::PARENT);
                links.is_part[owned] |= is_body || is_face;
            }
        }
    }
    links
}

/// One entity of each cycle of owners.
pub(super) fn cycles(owners: &[Option<usize>]) -> Vec<usize> {
    let mut walks = vec![usize::MAX; owners.len()];
    let mut found = Vec::new();
    for start in 0..owners.len() {
        let mut at = Some(start);
        while let Some(index) = at
            && walks[index] == usize::MAX
        {
            walks[index] = start;
            at = owners[index];
        }
        found.extend(at.filter(|&index| walks[index] == start));
    }
    found
}
