//! Looks that instances have in some places only: where a product occurs, or an item shows them.

use std::collections::{BTreeMap, HashMap};

use super::styles::{Key, Style, Styled};
use super::translator::Translator;

/// How instances look in some places, and where we are.
#[derive(Debug, Default)]
pub(super) struct Overrides {
    all: Vec<Override>,
    /// Those that each place is one of.
    by_place: HashMap<u64, Vec<usize>>,
    here: Here,
}

/// How an instance looks where we are in all of some places.
#[derive(Debug)]
struct Override {
    item: u64,
    places: usize,
    look: Look,
}

#[derive(Clone, Copy, Debug, Default)]
struct Look {
    surface: Option<Style>,
    curve: Option<Style>,
    is_hidden: bool,
}

/// What holds where we are.
#[derive(Clone, Debug, Default)]
pub(super) struct Here {
    /// In how many of their places we are, for those that do not hold yet.
    entered: BTreeMap<usize, usize>,
    looks: BTreeMap<u64, Look>,
}

/// What tells places apart in which instances look differently.
type Scope = (Vec<(usize, usize)>, Vec<(u64, [Option<Key>; 2], bool)>);

impl Here {
    fn scope(&self) -> Scope {
        let entered = self.entered.iter().map(|(&index, &count)| (index, count));
        let looks = self.looks.iter().map(|(&item, look)| {
            let colors = [look.surface, look.curve].map(|style| style.map(|style| style.key()));
            (item, colors, look.is_hidden)
        });
        (entered.collect(), looks.collect())
    }
}

impl Overrides {
    /// Adds how something looks in its places, or that it is hidden there.
    pub(super) fn add(&mut self, styled: &Styled, is_hidden: bool) {
        let Some(item) = styled.item else {
            return;
        };
        let look = Look {
            surface: styled.surface.filter(|_| !is_hidden),
            curve: styled.curve.filter(|_| !is_hidden),
            is_hidden,
        };
        for &place in &styled.places {
            let list = self.by_place.entry(place).or_default();
            list.push(self.all.len());
        }
        let places = styled.places.len();
        self.all.push(Override { item, places, look });
    }

    pub(super) fn of_surfaces(&self, id: u64) -> Option<Style> {
        self.here.looks.get(&id)?.surface
    }

    pub(super) fn of_curve(&self, id: u64) -> Option<Style> {
        self.here.looks.get(&id)?.curve
    }

    pub(super) fn is_hidden(&self, id: u64) -> bool {
        self.here.looks.get(&id).is_some_and(|look| look.is_hidden)
    }

    /// Enters a place in which something looks differently: what held before, or `None` if nothing
    /// does there.
    fn enter(&mut self, place: u64) -> Option<Here> {
        let mut reached = self.by_place.get(&place)?.clone();
        let before = self.here.clone();
        // Those of more places are made for fewer things; those from farther outside come first.
        reached.sort_by_key(|&index| std::cmp::Reverse(self.all[index].places));
        for index in reached {
            let over = &self.all[index];
            let count = self.here.entered.entry(index).or_default();
            *count += 1;
            if *count < over.places {
                continue;
            }
            self.here.entered.remove(&index);
            let look = self.here.looks.entry(over.item).or_default();
            look.surface = look.surface.or(over.look.surface);
            look.curve = look.curve.or(over.look.curve);
            look.is_hidden |= over.look.is_hidden;
        }
        Some(before)
    }
}

/// What instances became, where they all look the same.
pub(super) type Scopes<T> = HashMap<Scope, T>;

impl Translator<'_> {
    /// Makes something in a place. Where instances look differently there, it is made of entities of
    /// its own, which all places share in which they look so.
    pub(super) fn within<T>(&mut self, place: u64, make: impl FnOnce(&mut Self) -> T) -> T {
        if self.is_crowded() && self.styles.overrides.by_place.contains_key(&place) {
            let text =
                "there are too many looks of the same large things; they have their usual one";
            self.tell(place, text);
            return make(self);
        }
        let Some(before) = self.styles.overrides.enter(place) else {
            return make(self);
        };
        let scope = self.styles.overrides.here.scope();
        let known = self.scopes.remove(&scope).unwrap_or_default();
        let outside = std::mem::replace(&mut self.known, known);
        let made = make(self);
        let known = std::mem::replace(&mut self.known, outside);
        self.scopes.insert(scope, known);
        self.styles.overrides.here = before;
        made
    }
}
