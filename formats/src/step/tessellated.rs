//! Shapes of triangles (the tessellated geometry of ISO 10303-42), as meshes.
//!
//! Many of them stand for an exact shape in the same file. Whether that can be shown turns out only when
//! the scene is made, so that the meshes of all are written down, with what each stands for.

use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use glam::{DAffine3, DVec3};
use kernel::Mesh;

use super::part21::REPOSITIONED;
use super::translator::Translator;
use super::values::{Attributes, Record, Value};
use crate::Problem;
use crate::iges::Fields;

/// What an instance is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Make {
    /// Of faces, which may stand for an exact solid or shell.
    Body,
    /// Of anything.
    Set,
    Triangles,
    /// Of strips and fans of triangles.
    Strips,
}

/// A type of shapes of triangles.
#[derive(Debug)]
pub(super) struct Shape {
    name: &'static str,
    /// The type from which it has its first attributes, after its name, and how many these are.
    base: (&'static str, usize),
    make: Make,
}

const FACE: (&str, usize) = ("TESSELLATED_FACE", 4);
const SURFACE_SET: (&str, usize) = ("TESSELLATED_SURFACE_SET", 3);
const ALONE: (&str, usize) = ("", 0);

const SHAPES: [Shape; 7] = [
    Shape::new("TESSELLATED_SOLID", ALONE, Make::Body),
    Shape::new("TESSELLATED_SHELL", ALONE, Make::Body),
    Shape::new("TESSELLATED_GEOMETRIC_SET", ALONE, Make::Set),
    Shape::new("TRIANGULATED_FACE", FACE, Make::Triangles),
    Shape::new("COMPLEX_TRIANGULATED_FACE", FACE, Make::Strips),
    Shape::new("TRIANGULATED_SURFACE_SET", SURFACE_SET, Make::Triangles),
    Shape::new(
        "COMPLEX_TRIANGULATED_SURFACE_SET",
        SURFACE_SET,
        Make::Strips,
    ),
];

impl Shape {
    const fn new(name: &'static str, base: (&'static str, usize), make: Make) -> Self {
        Self { name, base, make }
    }

    /// The type of an instance, if it is one of these.
    pub(super) fn of(record: &Record<'_>) -> Option<&'static Self> {
        let is_it = |shape: &&Self| record.part(shape.name).is_some();
        SHAPES.iter().find(is_it)
    }

    /// The name of an instance, and its attributes: those from its base, and its own.
    fn attributes<'r, 'a>(&self, record: &'r Record<'a>) -> (String, [Attributes<'r, 'a>; 2]) {
        let none = Attributes(&[]);
        let (base, count) = self.base;
        if record.parts.len() > 1 {
            let part = |name| record.part(name).unwrap_or(none);
            let name = part("REPRESENTATION_ITEM").text(0);
            return (name, [part(base), part(self.name)]);
        }
        let at = record.attributes();
        let rest = at.0.get(1..).unwrap_or_default();
        let (base, own) = rest.split_at(count.min(rest.len()));
        (at.text(0), [Attributes(base), Attributes(own)])
    }
}

/// The rank among shapes that nothing shows: bodies and sets come before their faces.
pub(super) fn rank(keyword: &[u8]) -> Option<usize> {
    if keyword == REPOSITIONED.as_bytes() {
        return Some(0);
    }
    let shape = SHAPES.iter().find(|s| s.name.as_bytes() == keyword)?;
    Some(match shape.make {
        Make::Body | Make::Set => 0,
        Make::Triangles | Make::Strips => 1,
    })
}

/// A mesh that stands for an exact shape.
#[derive(Clone, Copy, Debug)]
struct Link {
    /// The instance with the triangles, and the pointer to its mesh.
    id: u64,
    mesh: i64,
    exact: u64,
}

/// What shapes of triangles are made of, and stand for.
#[derive(Debug, Default)]
pub(super) struct Tessellations {
    points: HashMap<u64, Result<Rc<[DVec3]>, Problem>>,
    links: Vec<Link>,
    /// What the body that is made stands for.
    body: Option<u64>,
}

impl Translator<'_> {
    /// What a shape of triangles becomes.
    pub(super) fn tessellated(
        &mut self,
        id: u64,
        record: &Record<'_>,
        shape: &Shape,
        depth: usize,
    ) -> Result<Option<i64>, Problem> {
        let (name, [base, own]) = shape.attributes(record);
        let place = record.part(REPOSITIONED).map(|at| at.reference(0));
        let map = place.transpose()?.map(|place| self.geometry().map(place));
        let map = map.transpose()?;
        let members = match shape.make {
            Make::Set => self.items(&own.references(0)?, depth),
            Make::Body => {
                let body = self.tessellated_body(id, own, name.clone(), depth)?;
                body.into_iter().collect()
            }
            Make::Triangles | Make::Strips => {
                let mesh = self.facets(id, shape, base, own)?;
                self.spend(mesh.positions().len())?;
                let mesh = self.add_mesh(mesh, id, name.clone());
                let own = base.reference(3).ok().filter(|&link| self.is_exact(link));
                let exact = own.or(self.tessellations.body);
                let link = exact.map(|exact| Link { id, mesh, exact });
                self.tessellations.links.extend(link);
                vec![mesh]
            }
        };
        let map = match map {
            None if shape.make != Make::Set => return Ok(members.first().copied()),
            map => map.unwrap_or(DAffine3::IDENTITY),
        };
        if members.is_empty() {
            return Ok(None);
        }
        let definition = self.definition(members, id, name);
        Ok(Some(self.placed(definition, &map, id, String::new())))
    }

    /// A solid or a shell of faces.
    fn tessellated_body(
        &mut self,
        id: u64,
        own: Attributes<'_, '_>,
        name: String,
        depth: usize,
    ) -> Result<Option<i64>, Problem> {
        let parts = own.references(0)?;
        if parts.is_empty() {
            return Err(Problem::Invalid("it has no parts".to_owned()));
        }
        let outer = self.tessellations.body;
        let link = own.reference(1).ok();
        let link =
            link.filter(|&link| rank(&self.exchange.keyword(link).to_ascii_uppercase()).is_none());
        self.tessellations.body = link.or(outer);
        let faces = self.items(&parts, depth);
        self.tessellations.body = outer;
        if faces.is_empty() {
            return Ok(None);
        }
        let fields = Fields::new(514).count(faces.len());
        let fields = fields.integers(faces.into_iter().flat_map(|face| [face, 1]));
        Ok(Some(self.add_named(1, &fields, id, name)))
    }

    /// Whether triangles that are linked with an instance stand for it: a surface on which they lie has no
    /// end.
    fn is_exact(&self, link: u64) -> bool {
        let keyword = self.exchange.keyword(link).to_ascii_uppercase();
        keyword.is_empty() || keyword == b"FACE_SURFACE" || {
            let face = keyword.strip_suffix(b"FACE");
            face.is_some_and(|before| before.is_empty() || before.ends_with(b"_"))
        }
    }

    /// Says for which entities meshes stand, once all are made.
    pub(super) fn settle_links(&mut self) {
        let links = std::mem::take(&mut self.tessellations.links);
        let mut exact: HashMap<u64, Vec<i64>> =
            links.iter().map(|link| (link.exact, Vec::new())).collect();
        for known in self.scopes.values().chain([&self.known]) {
            for (id, pointers) in &mut exact {
                pointers.extend(known.items.get(id).copied().flatten());
            }
        }
        for link in links {
            let pointers = exact.get(&link.exact).map_or(&[][..], Vec::as_slice);
            for &pointer in pointers {
                self.draft.stands_for(link.mesh, pointer);
            }
            if pointers.is_empty() {
                let text = "the exact shape that it stands for is not shown; its triangles are";
                self.tell(link.id, text);
            }
        }
    }

    /// What annotation draws, and what is in sets.
    pub(super) fn held(&self) -> HashSet<u64> {
        let mut held = HashSet::new();
        for id in self.exchange.ids() {
            let keyword = self.exchange.keyword(id).to_ascii_uppercase();
            let is_drawn = keyword.windows(10).any(|word| word == b"ANNOTATION");
            if !is_drawn && rank(&keyword) != Some(0) {
                continue;
            }
            let Ok(record) = self.exchange.get(id) else {
                continue;
            };
            if let Some(shape) = Shape::of(&record) {
                let (_, [_, own]) = shape.attributes(&record);
                held.extend(own.references(0).unwrap_or_default());
            } else {
                held.extend(record.attributes().reference(2));
            }
        }
        held
    }

    /// The mesh of an instance.
    fn facets(
        &mut self,
        id: u64,
        shape: &Shape,
        base: Attributes<'_, '_>,
        own: Attributes<'_, '_>,
    ) -> Result<Mesh, Problem> {
        let points = self.coordinates(base.reference(0)?)?;
        let mut facets = Facets::new(&points, listed(own, 0)?);
        if shape.make == Make::Strips {
            facets.add(listed(own, 1)?, "strip", |at| {
                // Every other one runs the other way round.
                if at % 2 == 0 {
                    [at - 2, at - 1, at]
                } else {
                    [at - 1, at - 2, at]
                }
            });
            facets.add(listed(own, 2)?, "fan", |at| [0, at - 1, at]);
        } else {
            facets.add(listed(own, 1)?, "triangle", |at| [at - 2, at - 1, at]);
        }
        if facets.triangles.is_empty() {
            let none = || Problem::Invalid("it has no triangles".to_owned());
            return Err(facets.problem.unwrap_or_else(none));
        }
        if let Some(problem) = facets.problem.take() {
            let text = match facets.skipped {
                1 => format!("one of its triangles, strips and fans is skipped: {problem}"),
                count => {
                    format!("{count} of its triangles, strips and fans are skipped: {problem}")
                }
            };
            self.note(id, Problem::Invalid(text));
        }
        let normals = facets.normals(listed(base, 2)?).unwrap_or_else(|problem| {
            let text = format!("its normals are not used: {problem}");
            self.note(id, Problem::Invalid(text));
            Vec::new()
        });
        facets.turn(&normals, &points);
        let positions = facets.corners.iter().map(|corner| points[corner.point]);
        let mesh = Mesh::new(positions.collect(), normals, Vec::new(), facets.triangles);
        mesh.map_err(Problem::Geometry)
    }

    /// The points of a list of coordinates, which many faces may have in common.
    fn coordinates(&mut self, id: u64) -> Result<Rc<[DVec3]>, Problem> {
        if let Some(known) = self.tessellations.points.get(&id) {
            return known.clone();
        }
        let points = self.new_coordinates(id);
        let points = points.map_err(|problem| self.geometry().within(id, problem));
        self.tessellations.points.insert(id, points.clone());
        points
    }

    fn new_coordinates(&mut self, id: u64) -> Result<Rc<[DVec3]>, Problem> {
        let record = self.geometry().get(id)?;
        if record.name() != "COORDINATES_LIST" {
            return Err(self.geometry().unread(id, "list of coordinates"));
        }
        let at = record.attributes();
        let list = at.list(2)?;
        let limit = self.limits.points;
        if list.len() > limit {
            let text = format!("{} points; the limit is {limit}", list.len());
            return Err(Problem::TooLarge(text));
        }
        let points: Result<Rc<[DVec3]>, Problem> = list.iter().map(vector).collect();
        let points = points?;
        if at.count(1).is_ok_and(|count| count != points.len()) {
            let text = "it announces another number of points than it has; those that it has count";
            self.note(id, Problem::Invalid(text.to_owned()));
        }
        Ok(points)
    }
}

/// A list that may be left out.
fn listed<'r, 'a>(at: Attributes<'r, 'a>, place: usize) -> Result<&'r [Value<'a>], Problem> {
    match at.get(place) {
        None | Some(Value::Nothing) => Ok(&[]),
        Some(_) => at.list(place),
    }
}

/// A point or direction of three numbers.
fn vector(value: &Value<'_>) -> Result<DVec3, Problem> {
    let at = Attributes(std::slice::from_ref(value));
    match at.numbers(0)?.as_slice() {
        &[x, y, z] => Ok(DVec3::new(x, y, z)),
        other => {
            let text = format!(
                "a point or a direction has {} numbers; three are needed",
                other.len()
            );
            Err(Problem::Invalid(text))
        }
    }
}

/// A corner of triangles, by its number and that of its point, both from zero on.
#[derive(Clone, Copy, Debug)]
struct Corner {
    number: usize,
    point: usize,
}

/// Triangles that are being collected.
struct Facets<'r, 'a> {
    points: usize,
    /// The points that numbers stand for; if there are none, numbers are those of points.
    index: &'r [Value<'a>],
    /// The corners that triangles have.
    corners: Vec<Corner>,
    /// Where among these a number is.
    places: HashMap<usize, u32>,
    triangles: Vec<[u32; 3]>,
    /// How many lists are skipped, and what is wrong with the first.
    skipped: usize,
    problem: Option<Problem>,
}

impl<'r, 'a> Facets<'r, 'a> {
    fn new(points: &[DVec3], index: &'r [Value<'a>]) -> Self {
        Self {
            points: points.len(),
            index,
            corners: Vec::new(),
            places: HashMap::new(),
            triangles: Vec::new(),
            skipped: 0,
            problem: None,
        }
    }

    /// How many numbers there are for corners.
    fn numbers(&self) -> usize {
        if self.index.is_empty() {
            self.points
        } else {
            self.index.len()
        }
    }

    /// Adds the triangles of lists of corners: `of` tells those of the triangle that ends at a place in
    /// the list.
    fn add(&mut self, lists: &[Value<'_>], what: &str, of: impl Fn(usize) -> [usize; 3]) {
        for list in lists {
            match self.corners_of(list, what) {
                Ok(corners) => {
                    let all = (2..corners.len()).map(|at| of(at).map(|place| corners[place]));
                    // Strips turn round corners by triangles without an area.
                    let real = all.filter(|[a, b, c]| a != b && b != c && c != a);
                    self.triangles.extend(real);
                }
                Err(problem) => {
                    self.skipped += 1;
                    self.problem.get_or_insert(problem);
                }
            }
        }
    }

    fn corners_of(&mut self, list: &Value<'_>, what: &str) -> Result<Vec<u32>, Problem> {
        let list = Attributes(std::slice::from_ref(list)).list(0)?;
        let is_right = list.len() == 3 || list.len() > 3 && what != "triangle";
        if !is_right {
            let text = format!("a {what} has {} corners", list.len());
            return Err(Problem::Invalid(text));
        }
        let corners = (0..list.len()).map(|at| self.corner(Attributes(list), at));
        let corners = corners.collect::<Result<Vec<_>, _>>()?;
        corners
            .into_iter()
            .map(|corner| self.place(corner))
            .collect()
    }

    fn corner(&self, list: Attributes<'_, '_>, at: usize) -> Result<Corner, Problem> {
        let number = one_of(list, at, self.numbers())?;
        let point = if self.index.is_empty() {
            number
        } else {
            one_of(Attributes(self.index), number, self.points)?
        };
        Ok(Corner { number, point })
    }

    /// Where a corner is among those that triangles have.
    fn place(&mut self, corner: Corner) -> Result<u32, Problem> {
        if let Some(&known) = self.places.get(&corner.number) {
            return Ok(known);
        }
        let place = u32::try_from(self.corners.len());
        let place = place.map_err(|_| Problem::TooLarge("2^32 corners".to_owned()))?;
        self.corners.push(corner);
        self.places.insert(corner.number, place);
        Ok(place)
    }

    /// A normal for each corner, of lists with one for each number, or one for all; none of none.
    fn normals(&self, given: &[Value<'_>]) -> Result<Vec<DVec3>, Problem> {
        let (count, needed) = (given.len(), self.numbers());
        if count == 0 {
            return Ok(Vec::new());
        }
        if count != 1 && count != needed {
            let text = format!("there are {count} for {needed} corners");
            return Err(Problem::Invalid(text));
        }
        let normal = |corner: &Corner| {
            let at = if count == 1 { 0 } else { corner.number };
            let normal = vector(&given[at])?.try_normalize();
            let text = "one of them has no direction";
            normal.ok_or_else(|| Problem::Invalid(text.to_owned()))
        };
        self.corners.iter().map(normal).collect()
    }

    /// Turns all triangles round if normals look to their other side: writers do not agree about the
    /// direction of strips and fans.
    fn turn(&mut self, normals: &[DVec3], points: &[DVec3]) {
        let along = self.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|at| points[self.corners[at as usize].point]);
            let [n, m, o] = corners.map(|at| normals.get(at as usize).copied().unwrap_or_default());
            (b - a).cross(c - a).dot(n + m + o)
        });
        if along.sum::<f64>() < 0.0 {
            for corners in &mut self.triangles {
                corners.swap(1, 2);
            }
        }
    }
}

/// The number at a place in a list as one of so many, from one on in the file, from zero on here.
fn one_of(list: Attributes<'_, '_>, at: usize, count: usize) -> Result<usize, Problem> {
    let number = list.count(at)?;
    let found = number.checked_sub(1).filter(|&found| found < count);
    found.ok_or_else(|| Problem::Invalid(format!("the index {number} is not from 1 to {count}")))
}
