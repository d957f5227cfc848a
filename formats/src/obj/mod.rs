//! Wavefront OBJ: free-form surfaces, polygons and their materials.
//!
//! Every statement of Appendix B1 of the Advanced Visualizer manual is known. References are
//! resolved where they stand, so a statement may only name what comes before it.

use std::collections::HashMap;
use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use kernel::{Surface, linear_from_srgb};

mod basis;
mod elements;
mod feed;
mod freeform;
mod hints;
mod maps;
mod materials;
mod polygons;
mod scene;
mod seams;
mod specials;
pub(crate) mod statements;
mod trims;
mod write;

use crate::{Error, Format, Import, Place, Problem, ReadOptions, Warnings};
use elements::Open;
use freeform::{Attributes, direction_index};
use polygons::{Faces, Tag};
use seams::{Merging, SeamPart};
use specials::{TrimCurve, WirePart};
pub(crate) use write::WRITER;

use statements::{Statement, Statements, decode, number, numbers};

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
        "cstype" => s
            .arguments()
            .any(|word| basis::Basis::named(word).is_some()),
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

/// Statements that no open element outlives; others of state or of lists go past it.
const ENDING: [&str; 16] = [
    "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "con", "p", "l", "f", "fo", "bsp",
    "bzp", "cdc", "cdp",
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
    reader.finish(&text)
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
    /// Colours that stand with vertices, as the file has them until all are read, then linear;
    /// empty as long as there are none, else for all vertices up to the last one with a colour,
    /// [`Self::NO_COLOR`] for those without.
    colors: Vec<DVec4>,
    /// `vt`, first two numbers.
    texcoords: Vec<DVec2>,
    /// `vn`.
    normals: Vec<DVec3>,
    /// `vp`: two parameters and a weight.
    parameters: Vec<DVec3>,
    /// Whether some entry could not be read, or is a normal without a length.
    damaged: bool,
}

impl Lists {
    const NO_COLOR: DVec4 = DVec4::NEG_ONE;

    fn len(&self) -> usize {
        let others = self.normals.len() + self.parameters.len();
        self.positions.len() + self.texcoords.len() + others
    }

    /// Makes colours linear. Some programs write bytes, and then in the whole file.
    fn settle_colors(&mut self) {
        let is_byte = |color: &DVec4| color.max_element() >= LEAST_BYTE;
        let most = if self.colors.iter().any(is_byte) {
            255.0
        } else {
            1.0
        };
        for color in self.colors.iter_mut().filter(|c| **c != Self::NO_COLOR) {
            let share = (color.truncate() / most).clamp(DVec3::ZERO, DVec3::ONE);
            *color = linear_from_srgb(share).extend(1.0);
        }
    }
}

/// The least number that tells that colours are bytes: shares may be a little above one.
const LEAST_BYTE: f64 = 2.0;

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
    /// Texture coordinates, if it has any.
    texture: Option<Surface>,
    loops: Vec<kernel::TrimLoop>,
    tag: Tag,
    merging: Merging,
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
    trim_curves: Vec<Option<TrimCurve>>,
    /// For every `surf` the surfaces that it became.
    surface_parts: Vec<Range<usize>>,
    curve_count: usize,
    /// Control points of all trim loops, and of all special curves, so far.
    loop_points: usize,
    special_cost: usize,
    groups: Names,
    material_names: Names,
    material_files: Names,
    /// The lines of the material files.
    material_lines: Vec<usize>,
    tag: Tag,
    /// The smoothing group; 0 for none.
    smoothing: u32,
    merging: Merging,
    surfaces: Vec<SurfacePart>,
    faces: Faces,
    wires: Vec<WirePart>,
    seams: Vec<SeamPart>,
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
            surface_parts: Vec::new(),
            curve_count: 0,
            loop_points: 0,
            special_cost: 0,
            groups: Names::default(),
            material_names: Names::default(),
            material_files: Names::default(),
            material_lines: Vec::new(),
            tag: (None, None),
            smoothing: 0,
            merging: Merging::default(),
            surfaces: Vec::new(),
            faces: Faces::default(),
            wires: Vec::new(),
            seams: Vec::new(),
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
            "end" if self.open.is_none() => return Err(invalid("no element is open")),
            "end" => {
                self.close_element(Some(statement.line));
                return Ok(());
            }
            _ => {}
        }
        if ENDING.contains(&keyword) {
            self.close_element(None);
        } else if let Some(open) = &mut self.open
            && KEYWORDS.contains(&keyword)
        {
            open.pass(statement);
        }
        match keyword {
            "v" | "vt" | "vn" | "vp" => self.vertex(statement),
            "f" | "fo" => {
                let (tag, smoothing) = (self.tag, self.smoothing);
                self.faces
                    .add(statement, &self.lists, tag, smoothing, &mut self.warnings)
            }
            "l" => self.faces.add_line(statement, &self.lists, self.tag),
            "p" => self.points(statement),
            "cstype" | "deg" | "bmat" | "step" => self.attributes.set(statement),
            "surf" | "curv" | "curv2" => {
                self.open_element(statement);
                Ok(())
            }
            "con" => self.connect(statement),
            "bzp" | "bsp" | "cdp" | "cdc" => self.superseded(statement),
            _ => self.state(statement),
        }
    }

    /// Takes a statement about what follows it.
    fn state(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        let (keyword, name) = (statement.keyword(), statement.rest());
        let unsupported = |text: &str| Err(Problem::Unsupported(text.to_owned()));
        match keyword {
            "g" | "o" => {
                self.tag.0 = (!name.is_empty()).then(|| self.groups.position(name));
            }
            "usemtl" => {
                self.tag.1 = (!name.is_empty()).then(|| self.material_names.position(name));
            }
            "mtllib" => {
                let file = self.material_files.position(name);
                if file == self.material_lines.len() {
                    self.material_lines.push(statement.line);
                }
            }
            "s" => self.smoothing = hints::smoothing(statement)?,
            "mg" => self.merging = hints::merging(statement)?,
            "usemap" if name == "off" => {}
            "usemap" | "maplib" => {
                return unsupported("texture libraries are not used; maps of materials are");
            }
            "call" => return unsupported("other files are never read in place of a line"),
            "csh" => return unsupported("programs are never run"),
            _ if KEYWORDS.contains(&keyword) => return hints::check(statement),
            _ => {
                let word = statements::shown(keyword);
                return Err(invalid(format!("\"{word}\" is not a statement of OBJ")));
            }
        }
        Ok(())
    }

    /// Takes a `v`, `vt`, `vn` or `vp`. A wrong one keeps its number in its list.
    fn vertex(&mut self, statement: &Statement<'_>) -> Result<(), Problem> {
        let read = statement.some_numbers::<7>();
        let (x, count) = *read.as_ref().unwrap_or(&([f64::NAN; 7], 8));
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
                let normal = DVec3::new(x[0], x[1], x[2]);
                self.lists.damaged |= !polygons::is_direction(normal);
                self.lists.normals.push(normal);
                3
            }
            _ => {
                let weight = if count >= 3 { x[2] } else { 1.0 };
                self.lists.parameters.push(DVec3::new(x[0], x[1], weight));
                1
            }
        };
        let is_read = read.is_ok() && count >= least;
        self.lists.damaged |= !is_read;
        let vertices = &mut self.faces.vertices;
        vertices.add(statement, &self.lists, if is_read { count } else { 0 });
        read.map_err(invalid)?;
        if count < least {
            return Err(invalid(format!(
                "{count} numbers; at least {least} are needed"
            )));
        }
        if statement.keyword() == "v" && count == 5 {
            let place = Place::item(statement.line, "v");
            let text = "5 numbers; a vertex has 3, 4 with a weight, 6 with a colour";
            self.warnings.invalid(place, text);
        }
        if statement.keyword() == "v" && count > 5 {
            let colors = &mut self.lists.colors;
            colors.resize(self.lists.positions.len() - 1, Lists::NO_COLOR);
            colors.push(DVec4::new(x[3], x[4], x[5], 1.0));
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
            "scrv" => {
                let curve = trims::LoopText::parse(statement, self.trim_curves.len())?;
                if let Some(specials) = open.specials() {
                    specials.curves.push(curve);
                }
                Ok(())
            }
            _ => {
                let points = self.special_points(statement)?;
                if let Some(specials) = self.open.as_mut().and_then(Open::specials) {
                    specials.points.push((statement.line, points));
                }
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod special_tests;
#[cfg(test)]
mod tests;
