//! Boolean trees (type 180): solids of which one is made by uniting, intersecting and subtracting.
//!
//! Operands are built like all else, and their faces taken from the scene, each in its place; what only they
//! were is left out of the scene at the end.

use std::collections::HashSet;

use glam::DAffine3;
use kernel::boolean::{self, Operation};
use kernel::{Child, Item, Node, NodeId, Patch, Shape};

use super::{LEAST_COST, Tree};
use crate::Problem;
use crate::iges::blanks;
use crate::iges::primitives;
use crate::iges::transform::check_finite;

/// Faces of the two solids of one operation,
const MOST_FACES: usize = 1_000;

/// and of all operations of a file.
const MOST_OF_ALL: usize = 50_000;

/// Steps that all operations of a file may take: about a minute.
const MOST_WORK: usize = 10_000_000;

/// What is known for boolean trees.
#[derive(Debug)]
pub(super) struct Booleans {
    /// Nodes and shapes that are solids by construction.
    nodes: HashSet<NodeId>,
    shapes: HashSet<Shape>,
    /// Trees of which nothing is left.
    empty: HashSet<usize>,
    /// Trees of which the bodies are shown whole.
    whole: HashSet<usize>,
    /// Whether the scene may have what only operands are made of.
    pub has_operands: bool,
    /// How many more faces may be combined.
    faces_left: usize,
    /// How many more steps that may take.
    work_left: usize,
}

impl Default for Booleans {
    fn default() -> Self {
        Self {
            nodes: HashSet::new(),
            shapes: HashSet::new(),
            empty: HashSet::new(),
            whole: HashSet::new(),
            has_operands: false,
            faces_left: MOST_OF_ALL,
            work_left: MOST_WORK,
        }
    }
}

/// An operand of a tree.
struct Operand {
    /// Its entity; `None` if there is none.
    index: Option<usize>,
    child: Option<Child>,
    /// Whether it is shown where the tree only shows its bodies.
    is_shown: bool,
}

/// A term of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Term {
    /// The operand with this number.
    Operand(usize),
    Operation(Operation),
}

/// A solid that waits for its operation.
enum Solid {
    /// The operand with this number.
    Given(usize),
    Made(Vec<Patch>),
}

/// The terms of a tree, of which every operation has its two solids, and one solid is left.
fn plan(terms: &[i64]) -> Result<Vec<Term>, Problem> {
    let invalid = |text: String| Err(Problem::Invalid(text));
    let mut plan = Vec::new();
    let (mut given, mut solids) = (0, 0_usize);
    for (k, &term) in terms.iter().enumerate() {
        let operation = match term {
            _ if term < 0 => {
                plan.push(Term::Operand(given));
                given += 1;
                solids += 1;
                continue;
            }
            1 => Operation::Union,
            2 => Operation::Intersection,
            3 => Operation::Difference,
            _ => {
                return invalid(format!(
                    "term {} is {term}; terms are negative pointers to solids, or 1, 2 and 3 for a union, \
                     an intersection and a difference",
                    k + 1
                ));
            }
        };
        if solids < 2 {
            return invalid(format!(
                "term {} is {} of two solids, but {solids} of those before it are left",
                k + 1,
                noun(operation)
            ));
        }
        solids -= 1;
        plan.push(Term::Operation(operation));
    }
    match solids {
        1 => Ok(plan),
        0 => invalid("it has no terms; at least one must be a pointer to a solid".to_owned()),
        _ => invalid(format!(
            "its terms leave {solids} solids; they must leave one"
        )),
    }
}

fn noun(operation: Operation) -> &'static str {
    match operation {
        Operation::Union => "a union",
        Operation::Intersection => "an intersection",
        Operation::Difference => "a difference",
    }
}

impl Tree<'_, '_> {
    /// Notes what a solid by construction became.
    pub(super) fn note_solid(&mut self, index: usize, child: Option<Child>) {
        if !primitives::is_primitive(self.file.entries[index].kind) {
            return;
        }
        match child {
            Some(Child::Node(id)) => {
                self.booleans.nodes.insert(id);
            }
            Some(Child::Item(item)) => {
                self.booleans.shapes.insert(item.shape);
            }
            None => {}
        }
    }

    /// Fills the node of a boolean tree: with the faces of its solid, or with its bodies if it only unites them
    /// and that fails.
    pub(super) fn combined(
        &mut self,
        index: usize,
        terms: &[i64],
        color: i64,
        depth: usize,
        node: &mut Node,
    ) -> Result<(), Problem> {
        let plan = plan(terms);
        let pointers: Vec<i64> = terms.iter().copied().filter(|term| *term < 0).collect();
        let only_unites = !pointers.is_empty() && terms.iter().all(|&term| term < 0 || term == 1);
        if !only_unites {
            plan.as_ref().map_err(Clone::clone)?;
        }
        let operand = |pointer: i64| self.operand(index, pointer.saturating_neg(), color, depth);
        let operands: Vec<Operand> = pointers.into_iter().map(operand).collect();
        let made = match (plan, operands.as_slice()) {
            // That is shown as it is.
            (Ok(_), [one]) => {
                node.children.extend(one.child);
                return Ok(());
            }
            (plan, _) => plan.and_then(|plan| self.evaluate(&plan, &operands)),
        };
        match made {
            Ok(patches) if patches.is_empty() => {
                let text = "an empty solid: nothing is left of those that it is made of";
                self.problem(index, Problem::Invalid(text.to_owned()));
                self.booleans.empty.insert(index);
            }
            Ok(patches) => {
                node.voids = Some(0);
                for patch in patches {
                    let shape = self.scene.add_patch(patch).map_err(Problem::Geometry)?;
                    node.children.push(Child::Item(Item {
                        shape: Shape::Patch(shape),
                        material: None,
                    }));
                }
            }
            Err(problem) if only_unites && !matches!(problem, Problem::TooLarge(_)) => {
                let text = format!("its bodies are shown whole, also inside each other: {problem}");
                self.problem(index, Problem::Unsupported(text));
                self.booleans.whole.insert(index);
                let shown = operands.iter().filter(|operand| operand.is_shown);
                node.children
                    .extend(shown.filter_map(|operand| operand.child));
            }
            Err(problem) => return Err(problem),
        }
        Ok(())
    }

    /// Builds an operand. Whether it is blanked counts for itself alone.
    fn operand(&mut self, parent: usize, pointer: i64, color: i64, depth: usize) -> Operand {
        self.booleans.has_operands = true;
        match self.file.follow(pointer, "an operand") {
            Ok(index) => {
                let entries = &self.file.entries;
                Operand {
                    index: Some(index),
                    is_shown: blanks::shows_member(&entries[parent], &entries[index]),
                    child: self.inheriting(index, color, depth + 1),
                }
            }
            Err(problem) => {
                self.problem(parent, problem);
                Operand {
                    index: None,
                    child: None,
                    is_shown: false,
                }
            }
        }
    }

    /// The faces of the solid that the terms of a tree leave.
    fn evaluate(&mut self, plan: &[Term], operands: &[Operand]) -> Result<Vec<Patch>, Problem> {
        let mut waiting = Vec::new();
        let is_long = operands.len() > 2;
        for (k, term) in plan.iter().enumerate() {
            let operation = match *term {
                Term::Operand(number) => {
                    waiting.push(Solid::Given(number));
                    continue;
                }
                Term::Operation(operation) => operation,
            };
            let (second, first) = (waiting.pop(), waiting.pop());
            let made = self.operate(first, second, operation, operands);
            waiting.push(Solid::Made(made.map_err(|problem| match problem {
                Problem::TooLarge(_) => problem,
                _ if !is_long => problem,
                _ => {
                    let text = format!("term {}, {}: {problem}", k + 1, noun(operation));
                    match problem {
                        Problem::Invalid(_) => Problem::Invalid(text),
                        _ => Problem::Unsupported(text),
                    }
                }
            })?));
        }
        let last = waiting.pop();
        self.faces_of(last, operands)
    }

    fn operate(
        &mut self,
        first: Option<Solid>,
        second: Option<Solid>,
        operation: Operation,
        operands: &[Operand],
    ) -> Result<Vec<Patch>, Problem> {
        let first = self.faces_of(first, operands)?;
        let second = self.faces_of(second, operands)?;
        self.combine(first, second, operation)
    }

    /// What an operation makes of two solids, of which each may be empty.
    fn combine(
        &mut self,
        first: Vec<Patch>,
        second: Vec<Patch>,
        operation: Operation,
    ) -> Result<Vec<Patch>, Problem> {
        match (operation, first.is_empty(), second.is_empty()) {
            (_, false, false) => {}
            (Operation::Union, true, _) => return Ok(second),
            (Operation::Intersection, ..) => return Ok(Vec::new()),
            _ => return Ok(first),
        }
        let count = first.len() + second.len();
        if count > MOST_FACES {
            let text = format!("its solids have {count} faces; the limit is {MOST_FACES}");
            return Err(Problem::Unsupported(text));
        }
        let left = self.booleans.faces_left.checked_sub(count);
        self.booleans.faces_left = left.ok_or_else(|| {
            let text = format!("more than {MOST_OF_ALL} faces are combined in the file");
            Problem::Unsupported(text)
        })?;
        let made = boolean::combine(&first, &second, operation, &mut self.booleans.work_left)
            .map_err(Problem::Geometry)?;
        for patch in &made {
            self.spend(patch.surface.homogeneous().len().max(LEAST_COST))?;
        }
        Ok(made)
    }

    /// The faces of a solid that waited, in the coordinates of its tree.
    fn faces_of(
        &mut self,
        solid: Option<Solid>,
        operands: &[Operand],
    ) -> Result<Vec<Patch>, Problem> {
        let operand = match solid {
            Some(Solid::Made(patches)) => return Ok(patches),
            Some(Solid::Given(number)) => operands.get(number),
            None => None,
        };
        let Some(Operand {
            index: Some(index),
            child,
            ..
        }) = operand
        else {
            let text = "one of its solids is not there";
            return Err(Problem::Invalid(text.to_owned()));
        };
        if self.booleans.empty.contains(index) {
            return Ok(Vec::new());
        }
        let source = self.file.source(*index);
        if self.booleans.whole.contains(index) {
            let text = format!("{source} is shown as its bodies");
            return Err(Problem::Unsupported(text));
        }
        let Some(child) = child else {
            let text = format!("{source} is not read");
            return Err(Problem::Unsupported(text));
        };
        let mut bodies = Vec::new();
        let mut left = MOST_FACES;
        self.bodies(*child, DAffine3::IDENTITY, &mut bodies, &mut left)
            .map_err(|fault| fault.of(&source))?;
        let mut bodies = bodies.into_iter();
        let mut all = bodies.next().unwrap_or_default();
        // Parts of an assembly may be inside each other.
        for body in bodies {
            all = self.combine(all, body, Operation::Union)?;
        }
        Ok(all)
    }

    /// Adds the bodies of a child, each as its faces; `left` is how many more these may be.
    fn bodies(
        &self,
        child: Child,
        place: DAffine3,
        all: &mut Vec<Vec<Patch>>,
        left: &mut usize,
    ) -> Result<(), Fault> {
        let is_body = match child {
            Child::Item(item) => self.booleans.shapes.contains(&item.shape),
            Child::Node(id) => {
                self.booleans.nodes.contains(&id) || self.scene.node(id).voids.is_some()
            }
        };
        if is_body {
            let mut body = Vec::new();
            self.faces(child, place, &mut body, left)?;
            all.push(body);
            return Ok(());
        }
        let Child::Node(id) = child else {
            return Err(Fault::NoSolid);
        };
        let node = self.scene.node(id);
        if !node.wires.is_empty() {
            return Err(Fault::NoSolid);
        }
        for &child in &node.children {
            self.bodies(child, place * node.parent_from_node, all, left)?;
        }
        Ok(())
    }

    /// Adds the faces of a body, with the materials that they have there.
    fn faces(
        &self,
        child: Child,
        place: DAffine3,
        body: &mut Vec<Patch>,
        left: &mut usize,
    ) -> Result<(), Fault> {
        let item = match child {
            Child::Node(id) => {
                let node = self.scene.node(id);
                for &child in &node.children {
                    self.faces(child, place * node.parent_from_node, body, left)?;
                }
                return Ok(());
            }
            Child::Item(item) => item,
        };
        let Shape::Patch(id) = item.shape else {
            return Err(Fault::NoSolid);
        };
        *left = left.checked_sub(1).ok_or(Fault::TooMany)?;
        let patch = self.scene.patch(id);
        let mut patch = if place == DAffine3::IDENTITY {
            patch.clone()
        } else {
            patch.transformed(&place)
        };
        check_finite(patch.surface.points()).map_err(Fault::Other)?;
        patch.material = self.scene.item_material(&item);
        body.push(patch);
        Ok(())
    }
}

/// Why something is no operand.
enum Fault {
    NoSolid,
    TooMany,
    Other(Problem),
}

impl Fault {
    fn of(self, source: &str) -> Problem {
        match self {
            Self::NoSolid => Problem::Unsupported(format!("{source} is no solid")),
            Self::TooMany => {
                let text = format!("{source} has more than {MOST_FACES} faces");
                Problem::Unsupported(text)
            }
            Self::Other(problem) => problem,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_come_after_their_solids() {
        use Operation::{Difference, Intersection, Union};
        let operations = |terms: &[i64]| -> Vec<Operation> {
            let plan = plan(terms).unwrap();
            let operation = |term| match term {
                Term::Operand(_) => None,
                Term::Operation(operation) => Some(operation),
            };
            plan.into_iter().filter_map(operation).collect()
        };
        assert_eq!(operations(&[-5]), []);
        assert_eq!(operations(&[-5, -7, 3]), [Difference]);
        let terms = [-9, -11, 2, -13, -11, 3, 1];
        assert_eq!(operations(&terms), [Intersection, Difference, Union]);
        assert_eq!(operations(&[-1, -3, -5, 1, 3]), [Union, Difference]);
    }

    #[test]
    fn terms_that_say_nothing_are_told() {
        for (terms, told) in [
            (&[][..], "it has no terms"),
            (&[-1, -3], "its terms leave 2 solids; they must leave one"),
            (&[-1, -3, -5, 1], "its terms leave 2 solids"),
            (
                &[-1, 3],
                "term 2 is a difference of two solids, but 1 of those before it are left",
            ),
            (&[1, -1, -3], "term 1 is a union of two solids, but 0"),
            (&[-1, -3, 2, 1], "term 4 is a union of two solids, but 1"),
            (
                &[-1, -3, 4],
                "term 3 is 4; terms are negative pointers to solids, or 1, 2 and 3 for a union",
            ),
            (&[-1, 13, 1], "term 2 is 13; terms are negative pointers"),
            (&[-1, 0, 1], "term 2 is 0; terms are negative pointers"),
        ] {
            let Err(Problem::Invalid(text)) = plan(terms) else {
                panic!("{terms:?}")
            };
            assert!(text.starts_with(told), "{terms:?}: {text}");
        }
    }
}
