//! Solids that came out open, made again.
//!
//! Where a solid has details smaller than the tolerance, edges of some are taken for those of others. What
//! fails at one tolerance is often closed at a smaller one.

use std::collections::BTreeSet;

use kernel::{PatchId, Scene};

use super::{Done, FINER, Group};
use crate::tessellate::TessellateOptions;
use crate::tessellate::room::Room;
use crate::tessellate::shell::Shell;

/// The share of all points that such a solid may have.
const ROOM: usize = 8;

impl Group {
    /// What the group became, with solids closed that are closed at a smaller tolerance.
    pub(super) fn closed(
        &self,
        scene: &Scene,
        tolerances: &[f64],
        options: &TessellateOptions,
        mut done: Done,
    ) -> Done {
        let mut tried = BTreeSet::new();
        while let Some(own) = self.next_open(&done.shells, &tried) {
            tried.extend(own.iter().copied());
            let small = self.of(&Vec::from_iter(own.iter().copied()));
            let finer = small.finer(tolerances);
            let room = Room::new(options.most_points / ROOM);
            let made = small.refine(scene, &finer, (options, &room), FINER);
            let Some(made) = made.filter(|made| made.shells.iter().all(|shell| shell.naked == 0))
            else {
                continue;
            };
            let is_other =
                |shell: &Shell| !shell.patches.iter().any(|id| small.number(*id).is_some());
            done.shells.retain(is_other);
            done.shells.extend(made.shells);
            done.crossings += made.crossings;
            for (k, face) in own.into_iter().zip(made.faces) {
                done.crossings -= done.faces[k].undrawn;
                done.faces[k] = face;
            }
        }
        done
    }

    /// The members of a solid with an open shell, and of all that hangs together with it, of which none
    /// was `tried`.
    fn next_open(&self, shells: &[Shell], tried: &BTreeSet<usize>) -> Option<BTreeSet<usize>> {
        let number = |id: &PatchId| self.number(*id);
        let numbers = |shell: &Shell| shell.patches.iter().filter_map(number).collect::<Vec<_>>();
        let solid = |k: &usize| self.solids.get(&self.members[*k]);
        let open = shells.iter().filter(|shell| shell.naked > 0);
        let first = open
            .flat_map(numbers)
            .find(|k| solid(k).is_some() && !tried.contains(k))?;
        let mut own = BTreeSet::from([first]);
        loop {
            let before = own.len();
            let solids: BTreeSet<_> = own.iter().filter_map(solid).copied().collect();
            let belongs = |k: &usize| solid(k).is_some_and(|solid| solids.contains(solid));
            own.extend((0..self.members.len()).filter(belongs));
            for shell in shells {
                let members = numbers(shell);
                if members.iter().any(|k| own.contains(k)) {
                    own.extend(members);
                }
            }
            if own.len() == before {
                return Some(own);
            }
        }
    }
}
