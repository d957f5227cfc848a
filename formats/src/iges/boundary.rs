//! What bounds a face: boundaries (141, 142), the loops of solids (508 with 504), and planes with
//! their holes (108).

use std::collections::HashMap;

use super::directory::{File, WHOLE};
use super::parameters::Parameters;
use crate::Problem;

/// The boundaries of a face.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Boundary {
    /// The whole domain.
    Natural,
    /// Loops only, by pointers.
    Loops(Vec<i64>),
    /// The border of the domain, with holes.
    Holes(Vec<i64>),
}

/// A loop as the file has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Loop {
    pub uses: Vec<Use>,
    /// Whether the file makes sure that the face lies to its left.
    pub is_oriented: bool,
    /// Whether the curves of space are the ones that count.
    pub prefers_space: bool,
}

impl Loop {
    /// Whether it points to any curve.
    pub(super) fn has_curves(&self) -> bool {
        self.uses.iter().any(|u| u.space != 0 || !u.flat.is_empty())
    }
}

/// A stretch of a loop, by pointers to curves.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Use {
    /// In the parameter domain, in order; empty if there are none.
    pub flat: Vec<i64>,
    /// In space: the curve, or the list that has its edge; zero if there is none.
    pub space: i64,
    /// Pointer to what moves the curve of space beside its own transformation, or zero.
    pub matrix: i64,
    /// The number of the edge in the list, from 1 on; zero for a curve.
    pub edge: i64,
    /// Whether the curve of space is run through backwards.
    pub reversed: bool,
}

/// Reads the loop a pointer leads to; `None` for the loop of a vertex, which bounds nothing.
pub(super) fn read(file: &File<'_>, pointer: i64) -> Result<Option<Loop>, Problem> {
    let index = file.follow(pointer, "a boundary")?;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let entry = &file.entries[index];
    let found = match entry.kind {
        142 => {
            let _way_of_making = parameters.integer()?;
            let _surface = parameters.integer()?;
            let [flat, space] = [parameters.integer()?, parameters.integer_or(0)?];
            let prefers_space = parameters.integer_or(0)? == 2;
            let flat = Some(flat).filter(|p| *p != 0).into_iter().collect();
            let uses = vec![Use {
                flat,
                space,
                ..Use::default()
            }];
            Some(Loop {
                uses,
                is_oriented: false,
                prefers_space,
            })
        }
        // A plane with its curve, after its equation.
        108 => {
            parameters.skip(4);
            let space = parameters.integer()?;
            let uses = vec![Use {
                space,
                ..Use::default()
            }];
            Some(Loop {
                uses,
                ..Loop::default()
            })
        }
        141 => Some(boundary(&mut parameters)?),
        508 => edges(&mut parameters)?,
        _ => {
            let text = format!("{} is no boundary", file.source(index));
            return Err(Problem::Invalid(text));
        }
    };
    Ok(found.map(|mut one| {
        let uses = one.uses.iter_mut();
        uses.for_each(|stretch| stretch.matrix = entry.transform);
        one
    }))
}

/// A boundary (type 141).
fn boundary(parameters: &mut Parameters<'_>) -> Result<Loop, Problem> {
    let _kind = parameters.integer()?;
    let prefers_space = parameters.integer()? == 1;
    let _surface = parameters.integer()?;
    let count = parameters.count()?;
    let mut uses = Vec::new();
    for _ in 0..parameters.expect(count, "boundary curves")? {
        let space = parameters.integer()?;
        let reversed = parameters.integer()? == 2;
        let mut flat = parameters.pointers("curves of the parameter domain")?;
        flat.retain(|pointer| *pointer != 0);
        uses.push(Use {
            flat,
            space,
            reversed,
            ..Use::default()
        });
    }
    Ok(Loop {
        uses,
        is_oriented: false,
        prefers_space,
    })
}

/// A loop of edges (type 508).
fn edges(parameters: &mut Parameters<'_>) -> Result<Option<Loop>, Problem> {
    let count = parameters.count()?;
    let mut uses = Vec::new();
    for _ in 0..parameters.expect(count, "edges")? {
        let is_vertex = parameters.integer()? == 1;
        let list = parameters.integer()?;
        let number = parameters.integer()?;
        let reversed = parameters.integer()? == 0;
        let count = parameters.count()?;
        let mut flat = Vec::new();
        for _ in 0..parameters.expect(count, "curves of the parameter domain")? {
            let _is_isoparametric = parameters.integer()?;
            flat.push(parameters.integer()?);
        }
        flat.retain(|pointer| *pointer != 0);
        let [space, edge] = if is_vertex { [0, 0] } else { [list, number] };
        uses.push(Use {
            flat,
            space,
            reversed,
            edge,
            ..Use::default()
        });
    }
    let is_point = uses.iter().all(|u| u.space == 0 && u.flat.is_empty());
    if is_point {
        return Ok(None);
    }
    Ok(Some(Loop {
        uses,
        is_oriented: true,
        prefers_space: false,
    }))
}

/// An edge of a list: pointers to its curve and to the lists of its vertices, with their numbers there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub curve: i64,
    pub vertices: [(i64, i64); 2],
}

/// The edges of lists (type 504), read once each.
#[derive(Debug, Default)]
pub(super) struct Edges {
    known: HashMap<i64, Result<Vec<Edge>, Problem>>,
}

impl Edges {
    /// Replaces edges by their curves.
    pub(super) fn resolve(&mut self, file: &File<'_>, one: &mut Loop) -> Result<(), Problem> {
        for stretch in one.uses.iter_mut().filter(|u| u.edge != 0) {
            stretch.space = self.find(file, stretch.space, stretch.edge)?.curve;
            stretch.edge = 0;
        }
        Ok(())
    }

    /// An edge, counted from 1 on.
    pub(super) fn find(
        &mut self,
        file: &File<'_>,
        list: i64,
        number: i64,
    ) -> Result<Edge, Problem> {
        let edges = self
            .known
            .entry(list)
            .or_insert_with(|| edges_of(file, list));
        let edges = edges.as_ref().map_err(Problem::clone)?;
        let index = usize::try_from(number).ok().and_then(|n| n.checked_sub(1));
        index.and_then(|i| edges.get(i)).copied().ok_or_else(|| {
            let count = edges.len();
            Problem::Invalid(format!("edge {number} is wanted of a list of {count}"))
        })
    }
}

/// The edges of a list.
pub(super) fn edges_of(file: &File<'_>, pointer: i64) -> Result<Vec<Edge>, Problem> {
    let index = file.follow(pointer, "an edge list")?;
    if file.entries[index].kind != 504 {
        let text = format!("{} is no edge list", file.source(index));
        return Err(Problem::Invalid(text));
    }
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let count = parameters.count()?;
    let mut edges = Vec::new();
    for _ in 0..parameters.expect(count, "edges")? {
        let curve = parameters.integer()?;
        let mut vertex =
            || Ok::<_, Problem>((parameters.integer_or(0)?, parameters.integer_or(0)?));
        let vertices = [vertex()?, vertex()?];
        edges.push(Edge { curve, vertices });
    }
    Ok(edges)
}
