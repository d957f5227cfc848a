//! Rows of numbers: CSV, TSV, and XYZ.
//!
//! A row is a point. A heading may name the columns; without one three columns are x, y and z,
//! four begin with the layer, and five with the body and the layer. Where no column names the
//! layer, blank lines part the layers, and where there are none, changes of z do.

use std::collections::HashMap;

use glam::DVec3;

use super::{Budget, Layer, PointBody, PointFormat, PointSet};
use crate::obj::statements::number;
use crate::{Error, Export, Limits, Place, Warnings};

pub(super) const FORMAT: PointFormat = PointFormat {
    name: "table",
    extensions: &["csv", "tsv", "xyz", "txt", "dat"],
    sniff,
    read,
    write: Some(write),
};

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Body,
    Layer,
    Axis(usize),
    Other,
}

/// The words of headings.
const NAMES: [(&str, Column); 13] = [
    ("body", Column::Body),
    ("roi", Column::Body),
    ("name", Column::Body),
    ("structure", Column::Body),
    ("layer", Column::Layer),
    ("row", Column::Layer),
    ("slice", Column::Layer),
    ("contour", Column::Layer),
    ("level", Column::Layer),
    ("x", Column::Axis(0)),
    ("y", Column::Axis(1)),
    ("z", Column::Axis(2)),
    ("i", Column::Layer),
];

/// Whether the first row is one of numbers, or a heading that names x, y and z.
fn sniff(bytes: &[u8]) -> bool {
    /// More than a row has.
    const HEAD: usize = 4096;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(HEAD)]);
    let mut lines = text.trim_start_matches('\u{feff}').lines().map(str::trim);
    let Some(first) = lines.find(|line| !line.is_empty() && !line.starts_with('#')) else {
        return false;
    };
    let fields = fields(first);
    if fields.iter().all(|field| is_word(field)) {
        return heading(&fields, 1, &mut Warnings::default()).is_ok();
    }
    unnamed(fields.len(), 1).is_ok_and(|columns| row(&columns, &fields, 1, 0).is_ok())
}

/// A point with all that its row says.
struct Row<'a> {
    line: usize,
    body: &'a str,
    layer: &'a str,
    point: DVec3,
    /// Blank lines before it.
    gaps: usize,
}

fn read(bytes: &[u8], limits: &Limits) -> Result<PointSet, Error> {
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let mut warnings = Warnings::default();
    let mut columns: Vec<Column> = Vec::new();
    let mut rows: Vec<Row<'_>> = Vec::new();
    let mut budget = Budget::new(limits);
    let mut gaps = 0;
    for (line, text) in (1..).zip(text.lines()) {
        let text = text.trim();
        if text.is_empty() {
            gaps += 1;
            continue;
        }
        if text.starts_with('#') {
            continue;
        }
        let fields = fields(text);
        if columns.is_empty() {
            if fields.iter().all(|field| is_word(field)) {
                columns = heading(&fields, line, &mut warnings)?;
                continue;
            }
            columns = unnamed(fields.len(), line)?;
        }
        budget
            .take(1)
            .map_err(|p| FORMAT.error(Place::line(line), p))?;
        rows.push(row(&columns, &fields, line, gaps)?);
    }
    Ok(PointSet {
        bodies: bodies(&rows, columns.contains(&Column::Layer))?,
        warnings,
        ..PointSet::default()
    })
}

/// The fields of a line, by the first of these that stands in it: semicolons, tabs, commas, or
/// blanks.
fn fields(line: &str) -> Vec<&str> {
    let sign = [';', '\t', ',']
        .into_iter()
        .find(|sign| line.contains(*sign));
    match sign {
        Some(sign) => line
            .split(sign)
            .map(|f| f.trim().trim_matches('"'))
            .collect(),
        None => line.split_whitespace().collect(),
    }
}

/// Whether a field is a word that no number is spelt as.
fn is_word(field: &str) -> bool {
    field.parse::<f64>().is_err() && field.starts_with(|c: char| c.is_alphabetic())
}

/// What the columns under a heading hold.
fn heading(fields: &[&str], line: usize, warnings: &mut Warnings) -> Result<Vec<Column>, Error> {
    let mut columns = Vec::new();
    for field in fields {
        let word = field.to_lowercase();
        let found = NAMES.iter().find(|(name, _)| *name == word);
        let column = found.map_or(Column::Other, |(_, column)| *column);
        if column == Column::Other {
            let text = format!("the column '{field}' is not used");
            warnings.unsupported(Place::line(line), text);
        } else if columns.contains(&column) {
            let text = format!("'{field}' is the second column of its kind");
            return Err(FORMAT.invalid(Place::line(line), text));
        }
        columns.push(column);
    }
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        if !columns.contains(&Column::Axis(axis)) {
            let text = format!("the heading names no column '{name}'");
            return Err(FORMAT.invalid(Place::line(line), text));
        }
    }
    Ok(columns)
}

/// What as many columns without a heading hold.
fn unnamed(count: usize, line: usize) -> Result<Vec<Column>, Error> {
    let all = [
        Column::Body,
        Column::Layer,
        Column::Axis(0),
        Column::Axis(1),
        Column::Axis(2),
    ];
    match all.len().checked_sub(count).filter(|skip| *skip <= 2) {
        Some(skip) => Ok(all[skip..].to_vec()),
        None => {
            let text =
                format!("{count} columns; a row is x,y,z or layer,x,y,z or body,layer,x,y,z");
            Err(FORMAT.invalid(Place::line(line), text))
        }
    }
}

fn row<'a>(
    columns: &[Column],
    fields: &[&'a str],
    line: usize,
    gaps: usize,
) -> Result<Row<'a>, Error> {
    if fields.len() != columns.len() {
        let text = format!(
            "{} columns; the rows before have {}",
            fields.len(),
            columns.len()
        );
        return Err(FORMAT.invalid(Place::line(line), text));
    }
    let (mut body, mut layer, mut point) = ("", "", [0.0; 3]);
    for (column, field) in columns.iter().zip(fields) {
        match column {
            Column::Body => body = field,
            Column::Layer => layer = field,
            Column::Axis(axis) => {
                let found = number(field);
                point[*axis] = found.map_err(|text| FORMAT.invalid(Place::line(line), text))?;
            }
            Column::Other => {}
        }
    }
    Ok(Row {
        line,
        body,
        layer,
        point: point.into(),
        gaps,
    })
}

/// Sorts rows into bodies and layers.
fn bodies(rows: &[Row<'_>], has_layers: bool) -> Result<Vec<PointBody>, Error> {
    let has_gaps = match rows {
        [first, .., last] => first.gaps != last.gaps,
        _ => false,
    };
    let mut bodies: Vec<PointBody> = Vec::new();
    let mut known: HashMap<&str, usize> = HashMap::new();
    let mut seen: HashMap<(&str, &str), usize> = HashMap::new();
    let mut before: Option<&Row<'_>> = None;
    for row in rows {
        let index = *known.entry(row.body).or_insert(bodies.len());
        if index == bodies.len() {
            bodies.push(PointBody {
                name: row.body.to_owned(),
                ..PointBody::default()
            });
        }
        let is_next = before.is_none_or(|before| {
            let is_same = if has_layers {
                before.layer == row.layer
            } else if has_gaps {
                before.gaps == row.gaps
            } else {
                before.point.z.total_cmp(&row.point.z).is_eq()
            };
            before.body != row.body || !is_same
        });
        before = Some(row);
        let layers = &mut bodies[index].layers;
        if is_next {
            if has_layers && let Some(first) = seen.insert((row.body, row.layer), row.line) {
                let text = format!("layer '{}' goes on, which began at line {first}", row.layer);
                return Err(FORMAT.invalid(Place::line(row.line), text));
            }
            let name = if has_layers {
                row.layer.to_owned()
            } else {
                (layers.len() + 1).to_string()
            };
            layers.push(Layer {
                place: Place::item(row.line, format!("layer {name}")),
                ..Layer::default()
            });
        }
        if let Some(layer) = layers.last_mut() {
            layer.points.push(row.point);
            layer.lines.push(row.line);
        }
    }
    Ok(bodies)
}

fn write(set: &PointSet) -> Export {
    use crate::write::push_number;
    let mut text = String::from("body,layer,x,y,z\n");
    for body in &set.bodies {
        // What parts fields and lines may not stand in a name.
        let name = body.name.replace([',', ';', '\t', '\n', '\r', '"'], " ");
        for (number, layer) in (1..).zip(&body.layers) {
            for point in &layer.points {
                text.push_str(&format!("{name},{number}"));
                for x in point.to_array() {
                    text.push(',');
                    push_number(&mut text, x);
                }
                text.push('\n');
            }
        }
    }
    let mut export = set.export(text.into_bytes());
    if set.unit.is_some() {
        let text = "tables hold no unit of length; it is left out";
        export.warnings.unsupported(Place::default(), text);
    }
    if set.bodies.iter().any(|body| body.color.is_some()) {
        let text = "tables hold no colours; they are left out";
        export.warnings.unsupported(Place::default(), text);
    }
    export
}
