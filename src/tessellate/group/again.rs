//! Solids that came out open, made again.
//!
//! Where a solid has details smaller than the tolerance, edges of some are taken for those of others. What
//! fails at one tolerance is often closed at a smaller one. Otherwise its faces may be farther apart than the
//! tolerance: since the file says that they are of one solid, that is a fault of the file, over which edges are
//! sewn as far as needed.

use std::collections::BTreeSet;
use std::iter;

use kernel::{PatchId, Scene};

use super::{Done, FINER, Group};
use crate::tessellate::TessellateOptions;
use crate::tessellate::room::Room;
use crate::tessellate::shell::Shell;

/// The share of all points that such a solid may have.
const ROOM: usize = 8;

/// Edges are sewn over gaps so many times as wide as the tolerance where a solid is not closed otherwise.
const WIDER: [f64; 4] = [2.0, 4.0, 8.0, 16.0];

impl Group {
    /// What the group became, with solids closed that are closed at a smaller tolerance, or where edges may be
    /// farther from their faces.
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
            let mut small = self.of(&Vec::from_iter(own.iter().copied()));
            let finer = small.finer(tolerances);
            let over_gaps = WIDER.map(|wider| (tolerances, wider));
            let mut tries = iter::once((&finer[..], 1.0)).chain(over_gaps);
            let closed = tries.find_map(|(tolerances, wider)| {
                small.wider = wider;
                let room = Room::new(options.most_points / ROOM);
                let made = small.refine(scene, tolerances, (options, &room), FINER);
                made.filter(|made| made.shells.iter().all(|shell| shell.naked == 0))
            });
            let Some(made) = closed else {
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
