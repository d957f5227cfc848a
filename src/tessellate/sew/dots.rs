//! Borders too small to see.

use super::{LONG, Sewer, Strand};

impl Sewer<'_, '_> {
    /// Makes one point of space of what is smaller than `reach` and keeps strands from their
    /// partners: borders of holes too small to see, where corners of faces do not meet.
    pub(super) fn shrink(&mut self, reach: f64) {
        for strand in &mut self.strands {
            strand.awake = true;
        }
        for s in 0..self.strands.len() {
            let strand = &self.strands[s];
            if self.is_dot(strand, reach) && (Self::is_open(strand) || self.is_ear(s)) {
                let [a, b] = self.strands[s].ends;
                self.pinch(a, b, reach);
            }
        }
        self.for_close_ends(reach, |sewer, a, b| sewer.pinch(a, b, reach));
    }

    /// Whether a strand and another one, of its face or of another edge, have the same ends: where a border was
    /// divided in between by what ends beside it.
    fn is_ear(&self, s: usize) -> bool {
        let ends = self.roots(&self.strands[s]);
        let [a, b] = ends;
        self.links[a].iter().any(|&other| {
            let strand = &self.strands[other];
            let same = [ends, [b, a]].contains(&self.roots(strand));
            let own = &self.strands[s];
            other != s && same && (strand.face == own.face || strand.edge != own.edge)
        })
    }

    /// Makes one of two vertices if what runs between them is short, and becomes a point, or long, and
    /// becomes a ring.
    fn pinch(&mut self, a: usize, b: usize, reach: f64) {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return;
        }
        let between: Vec<usize> = self.links[a]
            .iter()
            .copied()
            .filter(|&s| {
                let ends = self.roots(&self.strands[s]);
                ends == [a, b] || ends == [b, a]
            })
            .collect();
        let is_dot = |s: &usize| self.is_dot(&self.strands[*s], reach);
        let (dots, rest): (Vec<_>, Vec<_>) = between.into_iter().partition(is_dot);
        let is_long = |s: &usize| self.strands[*s].trail.length() > LONG * reach;
        if dots.is_empty() && !rest.is_empty() || !rest.iter().all(is_long) {
            return;
        }
        self.unite(a, b, reach, true);
        if self.root(a) == self.root(b) {
            for s in dots {
                match self.strands[s].edge {
                    Some(edge) => self.joints[edge].collapsed = true,
                    None => self.strands[s].collapsed = true,
                }
            }
        }
    }

    /// Whether a strand is short, and so is the straight way between its ends in the parameters
    /// of its face.
    fn is_dot(&self, strand: &Strand, reach: f64) -> bool {
        let (face, curve) = (&self.faces[strand.face], &strand.curve);
        let (start, end) = (curve.start(), curve.end());
        let point = face.point(start);
        let is_near = |k: u32| {
            let uv = start.lerp(end, f64::from(k) / 8.0);
            face.point(face.clamped(uv)).distance(point) <= reach
        };
        strand.trail.length() <= reach && (1..8).all(is_near)
    }
}
