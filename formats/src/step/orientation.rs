//! Faces of a shell whose loops run the wrong way round.
//!
//! Neighbours in a shell run through the edge between them in opposite directions. On a torus, a sphere or
//! another closed surface the direction is all that tells a face from the rest of the surface; and there are
//! writers that turn it where the frame of a surface was left-handed. What the few say against the many is
//! taken as such a fault.

use std::collections::HashMap;

use super::translator::Translator;
use crate::Problem;

impl Translator<'_> {
    /// Finds the faces among those of a shell whose loops are to be turned.
    pub(super) fn find_against(&mut self, faces: &[u64]) {
        let mut uses: HashMap<u64, Vec<(usize, bool)>> = HashMap::new();
        for (number, &face) in faces.iter().enumerate() {
            // What cannot be read is told where the face is made.
            let directions = self.directions(face).unwrap_or_default();
            self.uses_left -= directions.len();
            for (edge, is_backwards) in directions {
                uses.entry(edge).or_default().push((number, is_backwards));
            }
        }
        let mut links = vec![Vec::new(); faces.len()];
        for sides in uses.values() {
            if let &[(a, x), (b, y)] = &sides[..]
                && a != b
            {
                links[a].push((b, x == y));
                links[b].push((a, x == y));
            }
        }
        let turned = against(&links).into_iter().map(|number| faces[number]);
        let turned: Vec<u64> = turned.filter(|&face| self.is_ambiguous(face)).collect();
        self.against.extend(turned);
    }

    /// Whether a loop bounds a face on either side of it: the surface has an end everywhere.
    fn is_ambiguous(&self, face: u64) -> bool {
        let record = self.exchange.get(face);
        let surface = record.and_then(|record| record.attributes().reference(2));
        let kind = surface.map(|surface| self.exchange.keyword(surface));
        kind.is_ok_and(|kind| {
            let endless: [&[u8]; 3] = [b"PLANE", b"CYLINDRICAL_SURFACE", b"CONICAL_SURFACE"];
            !endless.iter().any(|name| kind.eq_ignore_ascii_case(name))
        })
    }

    /// The edges around a face, and whether each is run through backwards there; no more than are left.
    fn directions(&self, face: u64) -> Result<Vec<(u64, bool)>, Problem> {
        let record = self.exchange.get(face)?;
        let mut directions = Vec::new();
        if !matches!(record.name(), "ADVANCED_FACE" | "FACE_SURFACE") {
            return Ok(directions);
        }
        for bound in record.attributes().references(1)? {
            let record = self.exchange.get(bound)?;
            let is_turned = !record.attributes().is_true(2, true);
            let path = self.exchange.get(record.attributes().reference(1)?)?;
            if path.name() != "EDGE_LOOP" {
                continue;
            }
            for edge in path.attributes().references(1)? {
                // Each use has an instance of its own, unless the file is out to take all time and memory.
                if directions.len() == self.uses_left {
                    return Ok(directions);
                }
                let record = self.exchange.get(edge)?;
                let at = record.attributes();
                if matches!(record.name(), "ORIENTED_EDGE" | "SEAM_EDGE") {
                    directions.push((at.reference(3)?, is_turned == at.is_true(4, true)));
                }
            }
        }
        Ok(directions)
    }
}

/// The members that are at odds with the more of those that hang together with them, by links to
/// others and whether these tell of odds; none where that is a draw, or where they are at odds in a circle.
fn against(links: &[Vec<(usize, bool)>]) -> Vec<usize> {
    let mut sides: Vec<Option<bool>> = vec![None; links.len()];
    let mut all = Vec::new();
    for first in 0..links.len() {
        if sides[first].is_some() {
            continue;
        }
        sides[first] = Some(false);
        let mut part = vec![first];
        let mut agrees = true;
        let mut next = 0;
        while let Some(&member) = part.get(next) {
            next += 1;
            for &(other, is_odd) in &links[member] {
                let side = sides[member].map(|side| side != is_odd);
                if sides[other].is_none() {
                    sides[other] = side;
                    part.push(other);
                }
                agrees &= sides[other] == side;
            }
        }
        let odd = part.iter().filter(|&&k| sides[k] == Some(true)).count();
        if agrees && 2 * odd != part.len() {
            let fewer = 2 * odd < part.len();
            all.extend(part.into_iter().filter(|&k| sides[k] == Some(fewer)));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::against;

    /// Links between pairs of members.
    fn links(count: usize, pairs: &[(usize, usize, bool)]) -> Vec<Vec<(usize, bool)>> {
        let mut links = vec![Vec::new(); count];
        for &(a, b, is_odd) in pairs {
            links[a].push((b, is_odd));
            links[b].push((a, is_odd));
        }
        links
    }

    #[test]
    fn the_few_are_against_the_many() {
        let odd = links(5, &[(0, 1, true), (1, 2, true), (2, 3, false)]);
        assert_eq!(against(&odd), [1]);
        let first = links(3, &[(0, 1, true), (0, 2, true), (1, 2, false)]);
        assert_eq!(against(&first), [0]);
        let draw = links(2, &[(0, 1, true)]);
        assert!(against(&draw).is_empty());
        let circle = links(3, &[(0, 1, true), (1, 2, false), (2, 0, false)]);
        assert!(against(&circle).is_empty());
        assert!(against(&links(3, &[(0, 1, false)])).is_empty());
    }
}
