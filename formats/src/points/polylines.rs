//! Polylines of OBJ files: every chain of `l` statements is a layer, every `o` or `g` a body.

use std::collections::HashMap;

use glam::DVec3;

use super::{Budget, Layer, PointBody, PointFormat, PointSet};
use crate::obj::statements::{Statement, Statements, decode, number, reference};
use crate::{Error, Limits, Place};

pub(super) const FORMAT: PointFormat = PointFormat {
    name: "OBJ polylines",
    extensions: &["obj"],
    sniff: |bytes| {
        let text = decode(&bytes[..bytes.len().min(4096)]);
        let mut statements = Statements::new(&text).take(40);
        statements.any(|s| s.keyword() == "v" && (3..=7).contains(&s.arguments().count()))
    },
    read,
    write: None,
};

/// The polyline that is being read.
#[derive(Default)]
struct Chain {
    line: usize,
    /// Numbers of points, and the lines that name them.
    numbers: Vec<(usize, usize)>,
}

fn read(bytes: &[u8], limits: &Limits) -> Result<PointSet, Error> {
    let text = decode(bytes);
    let mut set = PointSet::default();
    let mut budget = Budget::new(limits);
    let mut points: Vec<DVec3> = Vec::new();
    let mut known: HashMap<String, usize> = HashMap::new();
    let mut name = String::new();
    let mut chain = Chain::default();
    for statement in Statements::new(&text) {
        let place = Place::line(statement.line);
        match statement.keyword() {
            "v" => {
                budget.take(1).map_err(|p| FORMAT.error(place.clone(), p))?;
                points.push(vertex(&statement)?);
            }
            "l" => {
                budget
                    .take(statement.arguments().count())
                    .map_err(|p| FORMAT.error(place.clone(), p))?;
                for (k, word) in statement.arguments().enumerate() {
                    let word = word.split('/').next().unwrap_or(word);
                    let number = reference(word, points.len(), "v")
                        .map_err(|text| FORMAT.invalid(place.clone(), text))?;
                    let end = chain.numbers.last().map(|n| n.0);
                    let is_closed =
                        chain.numbers.len() > 1 && chain.numbers.first().map(|n| n.0) == end;
                    match (k, end) {
                        // It goes on where the one before ended.
                        (0, Some(end)) if end == number && !is_closed => continue,
                        (0, _) => {
                            finish(&mut chain, &points, &name, &mut known, &mut set);
                            chain.line = statement.line;
                        }
                        _ => {}
                    }
                    chain.numbers.push((number, statement.line));
                }
            }
            "o" | "g" => {
                finish(&mut chain, &points, &name, &mut known, &mut set);
                name = statement.rest().to_owned();
            }
            other => {
                let text = format!("'{other}' is not used for points");
                set.warnings.unsupported(place, text);
            }
        }
    }
    finish(&mut chain, &points, &name, &mut known, &mut set);
    Ok(set)
}

fn vertex(statement: &Statement<'_>) -> Result<DVec3, Error> {
    let invalid = |text: String| FORMAT.invalid(Place::line(statement.line), text);
    let mut numbers = [0.0; 3];
    let mut words = statement.arguments();
    for x in &mut numbers {
        let word = words.next();
        let word = word.ok_or_else(|| invalid("a point has three coordinates".to_owned()))?;
        *x = number(word).map_err(invalid)?;
    }
    Ok(numbers.into())
}

/// Puts a polyline to the body of this name; `known` are the numbers of those that there are.
fn finish(
    chain: &mut Chain,
    points: &[DVec3],
    name: &str,
    known: &mut HashMap<String, usize>,
    set: &mut PointSet,
) {
    let Chain { line, mut numbers } = std::mem::take(chain);
    if numbers.is_empty() {
        return;
    }
    let ends = [numbers.first(), numbers.last()].map(|end| end.map(|n| n.0));
    let is_closed = numbers.len() > 2 && ends[0] == ends[1];
    if is_closed {
        numbers.pop();
    }
    let next = set.bodies.len();
    let index = *known.entry(name.to_owned()).or_insert(next);
    if index == next {
        set.bodies.push(PointBody {
            name: name.to_owned(),
            ..PointBody::default()
        });
    }
    let layers = &mut set.bodies[index].layers;
    layers.push(Layer {
        place: Place::item(line, format!("polyline {}", layers.len() + 1)),
        points: numbers.iter().map(|n| points[n.0]).collect(),
        lines: numbers.iter().map(|n| n.1).collect(),
        is_closed: Some(is_closed),
    });
}
