//! What entities refer to: members, surfaces, instances, colours, names.

use glam::DVec3;
use kernel::{Material, linear_from_srgb};

use super::boundary::{self, Boundary};
use super::copies::{self, Copies};
use super::curves;
use super::directory::{Entry, File, SHORT, WHOLE};
use super::parameters::Parameters;
use super::primitives;
use super::sheets;
use super::types;
use crate::Problem;

/// The form of associations (402) of one parent with its children.
pub(super) const PARENT: i64 = 9;

/// The forms of properties (406) that are names, and that say which attributes count for members.
const NAME: i64 = 15;
const HIERARCHY: i64 = 10;

/// The form of planes (108) that are holes of others.
const HOLE: i64 = -1;

/// An entity that can be shown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entity {
    /// Its name, or empty; without its label. Surfaces tell theirs when they are read.
    pub name: String,
    /// Whether a property says that its members go by what they say themselves of being blanked.
    pub defers_blanking: bool,
    /// What it is.
    pub content: Content,
}

/// What an entity is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    /// A surface on its own.
    Surface,
    /// A curve on its own.
    Curve,
    /// Points on their own.
    Points(Vec<DVec3>),
    /// A mesh.
    Mesh,
    /// A surface with boundaries.
    Face {
        /// Pointer to the surface.
        surface: i64,
        /// Its boundaries.
        boundary: Boundary,
    },
    /// Pointers to the members of a group, a definition or a shell.
    Members(Vec<i64>),
    /// The terms of a boolean tree: pointers to operands, negative, and operations after theirs.
    Terms(Vec<i64>),
    /// Pointers to the outer shell of a solid, and to those of its voids.
    Solid(i64, Vec<i64>),
    /// Pointers to the members of an assembly, each with one to its transformation, or zero.
    Placed(Vec<(i64, i64)>),
    /// A definition or another entity, placed once or often.
    Copies(Copies),
}

impl Content {
    /// Whether it is a shape itself, and has no members.
    pub(super) fn is_leaf(&self) -> bool {
        matches!(self, Self::Surface | Self::Face { .. } | Self::Mesh)
    }

    /// Pointers to the shells, solids or other members that it is composed of, if it is.
    pub(super) fn into_members(self) -> Option<Vec<i64>> {
        match self {
            Self::Members(members) => Some(members),
            Self::Terms(terms) => {
                let operands = terms.iter().filter(|term| **term < 0);
                Some(operands.map(|term| term.saturating_neg()).collect())
            }
            Self::Solid(shell, voids) => Some([vec![shell], voids].concat()),
            Self::Placed(placed) => Some(placed.iter().map(|(solid, _)| *solid).collect()),
            _ => None,
        }
    }
}

/// Reads an entity; `None` if it is none that can be shown.
///
/// The numbers of surfaces and curves are left to others.
pub(super) fn read(file: &File<'_>, index: usize) -> Result<Option<Entity>, Problem> {
    let entry = &file.entries[index];
    let mut buffer = Vec::new();
    let plain = |content| {
        let name = match content {
            Content::Curve | Content::Points(_) => own_name(file, index).unwrap_or_default(),
            _ => String::new(),
        };
        Ok(Some(Entity {
            name,
            defers_blanking: false,
            content,
        }))
    };
    match entry.kind {
        106 if matches!(entry.form, 1..=3) => {
            let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
            return plain(Content::Points(curves::copious(&mut parameters)?));
        }
        116 => {
            let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
            return plain(Content::Points(vec![parameters.point_or(DVec3::ZERO)?]));
        }
        types::MESH => {
            file.parameters(index, SHORT, &mut buffer)?;
            return plain(Content::Mesh);
        }
        108 if entry.form == HOLE => {
            let text = "a hole without the plane that it belongs to is not shown";
            return Err(Problem::Unsupported(text.to_owned()));
        }
        kind if sheets::is_sheet(kind) || primitives::is_primitive(kind) => {
            return plain(Content::Surface);
        }
        kind if types::is_curve(kind, entry.form) => return plain(Content::Curve),
        _ => {}
    }
    let is_readable = match entry.kind {
        402 => types::is_group(entry.kind, entry.form) || entry.form == PARENT,
        143 | 144 | 510 => true,
        kind => types::is_composed(kind),
    };
    if !is_readable {
        return Ok(None);
    }
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    let Some((mut name, content)) = composition(file, entry, &mut parameters)? else {
        return Ok(None);
    };
    let properties = properties(file, &mut parameters);
    let better = name_of(file, &properties);
    if !better.is_empty() {
        name = better;
    }
    Ok(Some(Entity {
        name,
        defers_blanking: defers_blanking(file, &properties),
        content,
    }))
}

/// What an entity is composed of, with the name that stands among its own parameters.
fn composition(
    file: &File<'_>,
    entry: &Entry,
    parameters: &mut Parameters<'_>,
) -> Result<Option<(String, Content)>, Problem> {
    let mut name = String::new();
    let content = match entry.kind {
        186 => {
            let [shell, _] = [parameters.integer()?, parameters.integer()?];
            Content::Solid(shell, with_flags(parameters)?)
        }
        308 | 320 => {
            parameters.integer()?;
            name = parameters.text();
            let members = parameters.pointers("members")?;
            if entry.kind == 320 {
                copies::skip_connections(parameters);
            }
            Content::Members(members)
        }
        402 if entry.form == PARENT => match holes(file, parameters)? {
            Some(content) => content,
            None => return Ok(None),
        },
        402 => Content::Members(parameters.pointers("members")?),
        kind @ (408 | 412 | 414 | 420) => Content::Copies(Copies::read(kind, parameters)?),
        180 => Content::Terms(parameters.pointers("terms")?),
        184 => {
            let solids = parameters.pointers("solids")?;
            let place = |solid| Ok((solid, parameters.integer_or(0)?));
            let placed: Result<Vec<_>, Problem> = solids.into_iter().map(place).collect();
            Content::Placed(placed?)
        }
        430 => Content::Members(vec![parameters.integer()?]),
        514 => Content::Members(with_flags(parameters)?),
        kind => face(kind, parameters)?,
    };
    Ok(Some((name, content)))
}

/// The name of a curve or point, which follows its own parameters.
fn own_name(file: &File<'_>, index: usize) -> Result<String, Problem> {
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, WHOLE, &mut buffer)?;
    curves::skip(file.entries[index].kind, &mut parameters)?;
    Ok(trailing_name(file, &mut parameters))
}

/// The entities that belong to another one, as pointers; what is not readable is left out.
pub(super) fn references(file: &File<'_>, index: usize) -> Vec<i64> {
    try_references(file, index).unwrap_or_default()
}

fn try_references(file: &File<'_>, index: usize) -> Result<Vec<i64>, Problem> {
    let entry = &file.entries[index];
    let mut buffer = Vec::new();
    // How many parameters stand before the pointers, and how many pointers there are.
    let (before, count) = match entry.kind {
        108 if entry.form != 0 => (4, 1),
        118 | 120 | 190 | 192 | 194 | 198 => (0, 2),
        122 | 130 | 162 | 164 | 412 | 414 | 430 => (0, 1),
        140 => (4, 1),
        142 => (1, 3),
        196 => (0, 1),
        // The planes that clip a view.
        410 if entry.form == 0 => (2, 6),
        102 => {
            return file
                .parameters(index, WHOLE, &mut buffer)?
                .pointers("curves");
        }
        504 => {
            let own = i64::try_from(entry.number).unwrap_or_default();
            let edges = boundary::edges_of(file, own)?;
            return Ok(edges.into_iter().map(|edge| edge.curve).collect());
        }
        141 | 508 => {
            let own = i64::try_from(entry.number).unwrap_or_default();
            let uses = boundary::read(file, own)?
                .map(|l| l.uses)
                .unwrap_or_default();
            let pointers = uses
                .into_iter()
                .flat_map(|u| [u.flat, vec![u.space]].concat());
            return Ok(pointers.collect());
        }
        143 | 144 | 180 | 184 | 186 | 308 | 320 | 402 | 510 | 514 => {
            let content = read(file, index)?.map(|entity| entity.content);
            return Ok(match content {
                Some(Content::Face { surface, boundary }) => match boundary {
                    Boundary::Loops(loops) | Boundary::Holes(loops) => {
                        [vec![surface], loops].concat()
                    }
                    _ => vec![surface],
                },
                Some(content) => content.into_members().unwrap_or_default(),
                None => Vec::new(),
            });
        }
        _ => return Ok(Vec::new()),
    };
    let mut parameters = file.parameters(index, SHORT, &mut buffer)?;
    for _ in 0..before {
        parameters.text();
    }
    let mut pointers = Vec::new();
    for _ in 0..count {
        pointers.push(parameters.integer_or(0)?);
    }
    // A curve on a surface has that as its own only if the file says so.
    let is_other = |surface| {
        file.find(surface)
            .is_some_and(|i| !file.entries[i].dependent)
    };
    if entry.kind == 142 && is_other(pointers[0]) {
        pointers.remove(0);
    }
    // Nor has a view anything that could be shown.
    if entry.kind == 410 {
        let is_endless = |i: usize| (file.entries[i].kind, file.entries[i].form) == (108, 0);
        pointers.retain(|&plane| file.find(plane).is_some_and(is_endless));
    }
    Ok(pointers)
}

/// Pointers of which each is followed by a flag, after their number.
fn with_flags(parameters: &mut Parameters<'_>) -> Result<Vec<i64>, Problem> {
    let mut pointers = Vec::new();
    let count = parameters.count()?;
    for _ in 0..parameters.expect(count, "members")? {
        pointers.push(parameters.integer()?);
        parameters.integer_or(1)?;
    }
    Ok(pointers)
}

/// A plane with holes, if an association is one.
fn holes(file: &File<'_>, parameters: &mut Parameters<'_>) -> Result<Option<Content>, Problem> {
    parameters.integer()?;
    let count = parameters.count()?;
    let surface = parameters.integer()?;
    let count = parameters.expect(count, "holes")?;
    let holes: Result<Vec<_>, _> = (0..count).map(|_| parameters.integer()).collect();
    let holes = holes?;
    let is_plane = |pointer: i64, form: i64| {
        let index = file.find(pointer);
        index.is_some_and(|i| (file.entries[i].kind, file.entries[i].form) == (108, form))
    };
    if !(is_plane(surface, 1) && holes.iter().all(|&hole| is_plane(hole, HOLE))) {
        return Ok(None);
    }
    let boundary = Boundary::Loops([vec![surface], holes].concat());
    Ok(Some(Content::Face { surface, boundary }))
}

/// A face: bounded surface (143), trimmed surface (144) or face of a solid (510).
fn face(kind: i64, parameters: &mut Parameters<'_>) -> Result<Content, Problem> {
    if kind == 143 {
        parameters.integer()?;
    }
    let surface = parameters.integer()?;
    let boundary = match kind {
        143 => match parameters.pointers("boundaries")? {
            loops if loops.is_empty() => Boundary::Natural,
            loops => Boundary::Loops(loops),
        },
        144 => {
            let outer = parameters.integer()?;
            let count = parameters.count()?;
            let first = parameters.integer_or(0)?;
            let count = parameters.expect(count, "holes")?;
            let holes: Result<Vec<_>, _> = (0..count).map(|_| parameters.integer()).collect();
            match (outer != 0 && first != 0, holes?) {
                (true, holes) => Boundary::Loops([vec![first], holes].concat()),
                (false, holes) if holes.is_empty() => Boundary::Natural,
                (false, holes) => Boundary::Holes(holes),
            }
        }
        _ => {
            let count = parameters.count()?;
            parameters.integer()?;
            let count = parameters.expect(count, "loops")?;
            let loops: Result<Vec<_>, _> = (0..count).map(|_| parameters.integer()).collect();
            match loops? {
                loops if loops.is_empty() => Boundary::Natural,
                loops => Boundary::Loops(loops),
            }
        }
    };
    Ok(Content::Face { surface, boundary })
}

/// The name among the properties that follow the parameters of an entity, or nothing.
pub(super) fn trailing_name(file: &File<'_>, parameters: &mut Parameters<'_>) -> String {
    name_of(file, &properties(file, parameters))
}

/// The properties that follow the parameters of an entity.
fn properties(file: &File<'_>, parameters: &mut Parameters<'_>) -> Vec<usize> {
    if parameters.at_most() == 0 || parameters.pointers("associativities").is_err() {
        return Vec::new();
    }
    let pointers = parameters.pointers("properties").unwrap_or_default();
    let found = pointers.iter().filter_map(|&pointer| file.find(pointer));
    found.collect()
}

/// What the first property of a form says.
fn property<T>(
    file: &File<'_>,
    properties: &[usize],
    form: i64,
    read: impl FnOnce(&mut Parameters<'_>) -> Result<T, Problem>,
) -> Option<T> {
    let is_it = |i: &&usize| (file.entries[**i].kind, file.entries[**i].form) == (406, form);
    let index = *properties.iter().find(is_it)?;
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, SHORT, &mut buffer).ok()?;
    // How many follow.
    parameters.integer().ok()?;
    read(&mut parameters).ok()
}

/// The name that is one of these properties, or nothing.
fn name_of(file: &File<'_>, all: &[usize]) -> String {
    property(file, all, NAME, |p| Ok(p.text())).unwrap_or_default()
}

/// Whether one of these properties says that members are blanked by themselves only.
fn defers_blanking(file: &File<'_>, all: &[usize]) -> bool {
    // Of line font, view, level, blank, weight and colour.
    let fourth = |p: &mut Parameters<'_>| {
        for _ in 0..3 {
            p.text();
        }
        p.integer_or(0)
    };
    property(file, all, HIERARCHY, fourth) == Some(1)
}

/// The colours with a number.
const COLORS: [(&str, DVec3); 8] = [
    ("black", DVec3::new(0.0, 0.0, 0.0)),
    ("red", DVec3::new(1.0, 0.0, 0.0)),
    ("green", DVec3::new(0.0, 1.0, 0.0)),
    ("blue", DVec3::new(0.0, 0.0, 1.0)),
    ("yellow", DVec3::new(1.0, 1.0, 0.0)),
    ("magenta", DVec3::new(1.0, 0.0, 1.0)),
    ("cyan", DVec3::new(0.0, 1.0, 1.0)),
    ("white", DVec3::new(1.0, 1.0, 1.0)),
];

/// The material of a colour number or of a negative pointer to a colour (type 314).
pub(super) fn material(file: &File<'_>, color: i64) -> Result<Option<Material>, Problem> {
    let mut opacity = 1.0;
    let (name, srgb) = match usize::try_from(color) {
        Ok(0) => return Ok(None),
        Ok(number) => match COLORS.get(number - 1) {
            Some(&(name, srgb)) => (name.to_owned(), srgb),
            None => {
                let text = format!("colour {color}; there are colours 0 to 8");
                return Err(Problem::Invalid(text));
            }
        },
        Err(_) => {
            let pointer = color.saturating_neg();
            let index = file.follow(pointer, "a colour")?;
            opacity = *file.drafted.opacities.get(&index).unwrap_or(&1.0);
            defined_color(file, index)?
        }
    };
    let linear = linear_from_srgb(srgb);
    Ok(Some(Material {
        name,
        ambient: linear,
        diffuse: linear,
        opacity,
        ..Material::default()
    }))
}

/// Name and colour of a colour definition.
fn defined_color(file: &File<'_>, index: usize) -> Result<(String, DVec3), Problem> {
    if file.entries[index].kind != 314 {
        let text = format!("{} is no colour", file.source(index));
        return Err(Problem::Invalid(text));
    }
    let mut buffer = Vec::new();
    let mut parameters = file.parameters(index, SHORT, &mut buffer)?;
    let mut percent = || Ok::<_, Problem>(parameters.real_or(0.0)?.clamp(0.0, 100.0) / 100.0);
    let srgb = DVec3::new(percent()?, percent()?, percent()?);
    Ok((parameters.text(), srgb))
}
