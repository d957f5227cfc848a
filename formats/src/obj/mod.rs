//! Wavefront OBJ: free-form surfaces, polygons and their materials.
//!
//! Free-form statements are read here, polygons are gathered by `tobj`; no crate reads the
//! former. Hints that change no shape (smoothing, level of detail, approximation techniques,
//! merging groups) are passed over. References are resolved where they stand, so a statement
//! may only name what comes before it.

use std::collections::HashMap;

use glam::{DVec2, DVec3, DVec4};
use kernel::{Curve, Surface};

mod basis;
mod elements;
mod freeform;
mod materials;
mod polygons;
mod scene;
pub(crate) mod statements;

mod trims;
mod write;

use crate::{Error, Format, Import, Place, Problem, ReadOptions, Warnings};
use elements::Open;
use freeform::{Attributes, direction_index};
use polygons::{Faces, Tag};
pub(crate) use write::WRITER;

use statements::{Statement, Statements, decode, number, numbers, some_numbers};

/// The row of this format.
pub(crate) const FORMAT: Format = Format {
    name: "OBJ",
    extensions: &["obj"],
    sniff,
    read,
};

/// How much of a file is looked at to tell its format.
const HEAD: usize = 4096;

/// Whether the first statements are all ones of OBJ and one of them is unmistakable.
fn sniff(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD)];
    let text = decode(head);
    if ["#VRML", "#X3D"]
        .iter()
        .any(|other| text.starts_with(other))
    {
        return false;
    }
    let mut statements: Vec<_> = Statements::new(&text).take(40).collect();
    if bytes.len() > HEAD && statements.len() < 40 {
        // The last one may be cut off.
        statements.pop();
    }
    let sure = |s: &Statement<'_>| match s.keyword() {
        "v" => s.arguments().count() >= 3 && s.arguments().all(|w| number(w).is_ok()),
        "vt" | "vn" | "vp" => s.arguments().count() > 0 && s.arguments().all(|w| number(w).is_ok()),
        "cstype" => s.arguments().last().and_then(basis::Basis::named).is_some(),
        "mtllib" => !s.rest().is_empty(),
        _ => false,
    };
    let known = |s: &Statement<'_>| KEYWORDS.contains(&s.keyword());
    statements.iter().all(known) && statements.iter().any(sure)
}

/// All statements of OBJ.
const KEYWORDS: [&str; 45] = [
    "v",
    "vt",
    "vn",
    "vp",
    "cstype",
    "deg",
    "bmat",
    "step",
    "curv",
    "curv2",
    "surf",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "p",
    "l",
    "f",
    "fo",
    "g",
    "s",
    "mg",
    "o",
    "usemtl",
    "mtllib",
    "usemap",
    "maplib",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "call",
    "csh",
    "bsp",
    "bzp",
    "cdc",
    "cdp",
    "res",
];

fn read(bytes: &[u8], options: &ReadOptions<'_>) -> Result<Import, Error> {
    let text = decode(bytes);
    let mut reader = Reader::new(options);
    for (index, statement) in Statements::new(&text).enumerate() {
        if index >= options.limits.entities {
            let limit = options.limits.entities;
            return Err(too_large(
                &statement,
                format!("more than {limit} statements"),
            ));
        }
        reader.take(&statement);
        if reader.lists.len() > options.limits.points {
            let limit = options.limits.points;
            return Err(too_large(&statement, format!("more than {limit} points")));
        }
    }
    reader.close_element(None);
    reader.finish()
}

fn too_large(statement: &Statement<'_>, text: String) -> Error {
    Error {
        format: FORMAT.name,
        place: Place::line(statement.line),
        problem: Problem::TooLarge(text),
    }
}

fn invalid(text: impl Into<String>) -> Problem {
    Problem::Invalid(text.into())
}

/// The numbered lists that references count in.
#[derive(Clone, Debug, Default)]
struct Lists {
    /// `v`: Cartesian, with weight. Unreadable ones are not a number.
    positions: Vec<DVec4>,
    /// `vt`, first two numbers.
    texcoords: Vec<DVec2>,
    /// `vn`.
    normals: Vec<DVec3>,
    /// `vp`: two parameters and a weight.
    parameters: Vec<DVec3>,
}

impl Lists {
    fn len(&self) -> usize {
        let others = self.normals.len() + self.parameters.len();
        self.positions.len() + self.texcoords.len() + others
    }
}

/// Names that are referred to by position, in the order of their first use.
#[derive(Clone, Debug, Default)]
struct Names {
    list: Vec<String>,
    positions: HashMap<String, usize>,
}

impl Names {
    fn position(&mut self, name: &str) -> usize {
        if let Some(&position) = self.positions.get(name) {
            return position;
        }
        self.list.push(name.to_owned());
        self.positions.insert(name.to_owned(), self.list.len() - 1);
        self.list.len() - 1
    }
}

/// A surface with its loops and its place in the file.
#[derive(Clone, Debug)]
struct SurfacePart {
    surface: Surface,
    loops: Vec<kernel::TrimLoop>,
    tag: Tag,
    line: usize,
    what: String,
}

/// What has been read so far.
struct Reader<'a> {
    options: &'a ReadOptions<'a>,
    warnings: Warnings,
    /// The first thing that cost a part of the file.
    failure: Option<(Place, Problem)>,
    lists: Lists,
    attributes: Attributes,
    /// The element whose body is being read.
    open: Option<Open>,
    /// `parm` values that stood before their element.
    early_parms: [Vec<f64>; 2],
    /// All `curv2` elements; `None` for those that could not be read.
    trim_curves: Vec<Option<Curve<DVec2>>>,
    surface_count: usize,
    curve_count: usize,
    /// Control points of all trim loops so far.
    loop_points: usize,
    /// Curves, points and lines, which are read but not shown.
    not_shown: usize,
    groups: Names,
    material_names: Names,
    material_files: Names,
    /// The lines of the material files.
    material_lines: Vec<usize>,
    tag: Tag,
    surfaces: Vec<SurfacePart>,
    faces: Faces,
}

impl<'a> Reader<'a> {
    fn new(options: &'a ReadOptions<'a>) -> Self {
        Self {
            options,
            warnings: Warnings::default(),
            failure: None,
            lists: Lists::default(),
            attributes: Attributes::default(),
            open: None,
            early_parms: Default::default(),
            trim_curves: Vec::new(),
            surface_count: 0,
            curve_count: 0,
            loop_points: 0,
            not_shown: 0,
            groups: Names::default(),
            material_names: Names::default(),
            material_files: Names::default(),
            material_lines: Vec::new(),
            tag: (None, None),
            surfaces: Vec::new(),
            faces: Faces::default(),
        }
    }

    /// Notes what cost a part of the file.
    fn fail(&mut self, place: Place, problem: Problem) {
        if self.failure.is_none() && !matches!(problem, Problem::Unsupported(_)) {
            self.failure = Some((place.clone(), problem.clone()));
        }
        self.warnings.add(place, problem);
    }

    fn take(&mut self, statement: &Statement<'_>) {
        let place = || Place::item(statement.line, statement.keyword());
        if statement.misprinted {
            let text = "a \"\\\" within the line; taken as one at its end";
            self.warnings.invalid(place(), text);
        }
        if let Err(problem) = self.dispatch(statement) {
            self.fail(place(), problem);
        }
    }

    fn dispatch(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        let keyword = statement.keyword();
        match keyword {
            "parm" | "trim" | "hole" | "scrv" | "sp" => return self.body(statement),
            "end" => {
                return if self.open.is_some() {
                    self.close_element(Some(statement.line));
                    Ok(())
                } else {
                    Err(invalid("no element is open"))
                };
            }
            "s" | "mg" | "lod" | "ctech" | "stech" | "bevel" | "c_interp" | "d_interp"
            | "shadow_obj" | "trace_obj" | "res" | "con" => return Ok(()),
            _ => {}
        }
        if self.open.is_some() && KEYWORDS.contains(&keyword) {
            self.close_element(None);
        }
        match keyword {
            "v" | "vt" | "vn" | "vp" => self.vertex(statement),
            "f" | "fo" => self
                .faces
                .add(statement, &self.lists, self.tag, &mut self.warnings),
            "g" | "o" => {
                let name = statement.rest();
                self.tag.0 = (!name.is_empty()).then(|| self.groups.position(name));
                Ok(())
            }
            "usemtl" => {
                let name = statement.rest();
                self.tag.1 = (!name.is_empty()).then(|| self.material_names.position(name));
                Ok(())
            }
            "mtllib" => {
                let file = self.material_files.position(statement.rest());
                if file == self.material_lines.len() {
                    self.material_lines.push(statement.line);
                }
                Ok(())
            }
            "cstype" | "deg" | "bmat" | "step" => self.attributes.set(statement),
            "surf" | "curv" | "curv2" => {
                self.open_element(statement);
                Ok(())
            }
            "bzp" | "bsp" | "cdp" | "cdc" => self.superseded(statement),
            "p" | "l" => {
                self.not_shown += 1;
                Err(Problem::Unsupported(
                    "points and lines are not shown".into(),
                ))
            }
            "usemap" | "maplib" => Err(Problem::Unsupported("textures are not used".into())),
            "call" | "csh" => {
                let text = "other files and programs are never called";
                Err(Problem::Unsupported(text.into()))
            }
            _ => {
                let word = statements::shown(keyword);
                Err(invalid(format!("\"{word}\" is not a statement of OBJ")))
            }
        }
    }

    /// Takes a `v`, `vt`, `vn` or `vp`. A wrong one keeps its number in its list.
    fn vertex(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        let read = some_numbers::<7>(statement.arguments());
        let (x, count) = read.clone().unwrap_or(([f64::NAN; 7], 8));
        let least = match statement.keyword() {
            "v" => {
                let weight = if count == 4 { x[3] } else { 1.0 };
                self.lists.positions.push(if count < 3 {
                    DVec4::NAN
                } else {
                    DVec4::new(x[0], x[1], x[2], weight)
                });
                3
            }
            "vt" => {
                self.lists.texcoords.push(DVec2::new(x[0], x[1]));
                1
            }
            "vn" => {
                self.lists.normals.push(DVec3::new(x[0], x[1], x[2]));
                3
            }
            _ => {
                let weight = if count >= 3 { x[2] } else { 1.0 };
                self.lists.parameters.push(DVec3::new(x[0], x[1], weight));
                1
            }
        };
        read.map_err(invalid)?;
        if count < least {
            return Err(invalid(format!(
                "{count} numbers; at least {least} are needed"
            )));
        }
        if statement.keyword() == "v" && count > 4 {
            let place = Place::item(statement.line, "v");
            if count == 5 {
                self.warnings
                    .invalid(place, "5 numbers; a vertex has 3, or 4 with a weight");
            } else {
                self.warnings
                    .unsupported(place, "colours of vertices are not used");
            }
        }
        Ok(())
    }

    /// Takes a statement of an element's body.
    fn body(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        if statement.keyword() == "parm" {
            let index = direction_index(statement)?;
            let values = numbers(statement.arguments().skip(1)).map_err(invalid)?;
            if let Some(open) = &mut self.open {
                open.set_parm(index, values);
            } else {
                self.early_parms[index] = values;
                let place = Place::item(statement.line, "parm");
                let text = "no element is open; taken for the next one";
                self.warnings.invalid(place, text);
            }
            return Ok(());
        }
        let Some(open) = &mut self.open else {
            return Err(invalid("no element is open"));
        };
        match statement.keyword() {
            "trim" | "hole" => open.add_loop(statement, self.trim_curves.len()),
            _ => Err(Problem::Unsupported(
                "special curves and points are not shown".into(),
            )),
        }
    }
}

#[cfg(test)]
mod tests;
