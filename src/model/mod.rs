//! Bodies from measured points: from a [`PointSet`] to a [`Scene`].
//!
//! The surfaces are `kernel`'s (`modelling`); here points are looked over, faces are joined to
//! bodies with caps, and named. Points that make no body are refused with their place.

use formats::{Error, Layer, Place, PointBody, PointSet, Problem, Warnings};
use glam::DVec3;
use kernel::modelling::{self, Along, Cap, TubeEnd, Twist};
use kernel::{Child, Item, Material, Node, NodeId, Patch, Scene, Shape, Surface, UpAxis};

mod branches;
mod contour;
mod grid;
mod synthetic;

pub use synthetic::{Synthetic, synthetic};

/// How surfaces are made of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModelMethod {
    /// Bicubic pieces between neighbours of a grid.
    Coons(Twist),
    /// One B-spline surface through a grid: along its rows, and from row to row.
    Interpolate([Along; 2]),
    /// Blended contours: smooth, and smaller than the contours.
    Contours,
    /// Surfaces through contours.
    Loft,
}

/// What closes the ends of bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Caps {
    /// Nothing.
    None,
    /// Planes.
    Flat,
    /// Domes of a height, or half as high as the last two layers are apart.
    Rounded(Option<f64>),
}

/// How bodies are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelOptions {
    /// How surfaces are made of points.
    pub method: ModelMethod,
    /// Whether rows of a grid are closed, and whether the last row is followed by the first one.
    pub closed: [bool; 2],
    /// What closes the ends of bodies.
    pub caps: Caps,
    /// Bodies that branch become several, instead of being refused.
    pub split: bool,
    /// Points that repeat are left out, layers are put in order and open contours closed, with a
    /// warning each, instead of being refused.
    pub repair: bool,
}

/// Bodies that were made.
#[derive(Clone, Debug, PartialEq)]
pub struct Modelled {
    /// A node for each body, with its faces and a material of its own.
    pub scene: Scene,
    /// What was repaired.
    pub warnings: Warnings,
}

/// Colours of bodies that have none: bone first.
const COLORS: [[f64; 3]; 6] = [
    [0.78, 0.73, 0.60],
    [0.62, 0.10, 0.08],
    [0.12, 0.30, 0.58],
    [0.16, 0.45, 0.18],
    [0.60, 0.36, 0.08],
    [0.36, 0.16, 0.50],
];

/// Makes bodies of points; normals point outwards where rows are closed.
///
/// # Errors
/// With the place in the file if points make no body: too few of them, rows of a grid that
/// differ in length, contours that are open, cross themselves or do not lie in order, points
/// that repeat, bodies that branch.
pub fn model(points: &PointSet, options: &ModelOptions) -> Result<Modelled, Error> {
    let mut warnings = Warnings::default();
    let mut scene = Scene::default();
    scene.unit.clone_from(&points.unit);
    scene.up = UpAxis::Z;
    let mut children = Vec::new();
    for (number, body) in points.bodies.iter().enumerate() {
        let about = About {
            format: points.format,
            body: &body.name,
        };
        let color = body.color.unwrap_or(COLORS[number % COLORS.len()].into());
        let material = scene.add_material(Material {
            name: body.name.clone(),
            ambient: color,
            diffuse: color,
            opacity: 1.0 - body.transparency,
            ..Material::default()
        });
        for (name, faces) in parts(body, &about, options, &mut warnings)? {
            let mut items = Vec::new();
            for (number, face) in (1..).zip(faces) {
                let face = Patch {
                    name: format!("{name} {number}").trim_start().to_owned(),
                    material: Some(material),
                    ..face
                };
                let shape = Shape::Patch(scene.add_patch(face).map_err(|e| about.geometry(e))?);
                items.push(Child::Item(Item {
                    shape,
                    material: None,
                }));
            }
            let node = node(&mut scene, name, items).map_err(|e| about.geometry(e))?;
            children.push(Child::Node(node));
        }
    }
    let root = node(&mut scene, String::new(), children);
    let root = root.and_then(|root| scene.set_root(root));
    root.map_err(|error| About::default().geometry(error))?;
    Ok(Modelled { scene, warnings })
}

fn node(scene: &mut Scene, name: String, children: Vec<Child>) -> Result<NodeId, kernel::Error> {
    scene.add_node(Node {
        name,
        children,
        ..Node::default()
    })
}

/// Makes surfaces between contours.
type Join = fn(&[Vec<DVec3>]) -> Result<Vec<Surface>, kernel::Error>;

/// The bodies that one of the file becomes: names and faces.
fn parts(
    body: &PointBody,
    about: &About<'_>,
    options: &ModelOptions,
    warnings: &mut Warnings,
) -> Result<Vec<(String, Vec<Patch>)>, Error> {
    let layers = &body.layers;
    // What joins contours, and how many points these have at least.
    let (join, least) = match options.method {
        ModelMethod::Coons(_) | ModelMethod::Interpolate(_) => {
            let faces = grid::faces(layers, about, options, warnings)?;
            return Ok(vec![(body.name.clone(), faces)]);
        }
        ModelMethod::Contours => (modelling::blend as Join, 4),
        ModelMethod::Loft => (modelling::loft as Join, 3),
    };
    let mut layers = layers.clone();
    contour::check(&mut layers, (about, least), options.repair, warnings)?;
    let stacks = branches::stacks(layers, about, options, warnings)?;
    let count = stacks.len();
    let mut parts = Vec::new();
    for (number, stack) in (1..).zip(stacks) {
        let contours: Vec<Vec<DVec3>> = stack.into_iter().map(|layer| layer.points).collect();
        let strips = join(&contours).map_err(|error| about.geometry(error))?;
        let rise = |below: &[DVec3], above: &[DVec3]| middle(below).distance(middle(above));
        let last = contours.len() - 1;
        let rises = [
            rise(&contours[0], &contours[1]),
            rise(&contours[last], &contours[last - 1]),
        ];
        let faces = closed(strips, options.caps, rises).map_err(|error| about.geometry(error))?;
        let name = match count {
            1 => body.name.clone(),
            _ => format!("{} {number}", body.name).trim().to_owned(),
        };
        parts.push((name, faces));
    }
    Ok(parts)
}

/// Strips, the lowest first, and the caps below and above; `rises` is how far the layers at both
/// ends are from their neighbours.
fn closed(strips: Vec<Surface>, caps: Caps, rises: [f64; 2]) -> Result<Vec<Patch>, kernel::Error> {
    let kind = |rise: f64| match caps {
        Caps::None => None,
        Caps::Flat => Some(Cap::Flat),
        Caps::Rounded(height) => Some(Cap::Rounded {
            height: height.unwrap_or(0.5 * rise),
        }),
    };
    let mut ends = Vec::new();
    if let (Some(lowest), Some(highest)) = (strips.first(), strips.last()) {
        let both = [(lowest, TubeEnd::Start), (highest, TubeEnd::End)];
        for ((strip, end), rise) in both.into_iter().zip(rises) {
            if let Some(kind) = kind(rise).filter(|_| !is_point(strip, end)) {
                ends.push(modelling::cap(strip, end, kind)?);
            }
        }
    }
    Ok(strips.into_iter().map(Patch::from).chain(ends).collect())
}

/// Whether a tube ends in one point.
fn is_point(strip: &Surface, end: TubeEnd) -> bool {
    let v = strip.knots_v().domain();
    let rim = strip.iso_curve_v(match end {
        TubeEnd::Start => v.start,
        TubeEnd::End => v.end,
    });
    let bounds = rim.hull_bounds();
    bounds.diagonal() <= 1e-12 * strip.hull_bounds().diagonal()
}

fn middle(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

/// What errors are about.
#[derive(Clone, Copy, Debug, Default)]
struct About<'a> {
    format: &'static str,
    body: &'a str,
}

impl About<'_> {
    /// A place with the name of the body before it.
    fn place(&self, place: &Place) -> Place {
        let what = match (self.body, place.what.as_str()) {
            ("", what) => what.to_owned(),
            (body, what) if what.contains(body) => what.to_owned(),
            (body, "") => format!("\"{body}\""),
            (body, what) => format!("\"{body}\", {what}"),
        };
        Place::item(place.line, what)
    }

    fn error(&self, place: &Place, text: impl Into<String>) -> Error {
        Error {
            format: self.format,
            place: self.place(place),
            problem: Problem::Invalid(text.into()),
        }
    }

    fn geometry(&self, error: kernel::Error) -> Error {
        let hint = match error {
            kernel::Error::NotStarShaped => "; flat caps close it",
            _ => "",
        };
        self.error(&Place::default(), format!("{error}{hint}"))
    }
}

/// Takes repeated points out of a line, or refuses them; of a closed line also the first one at
/// its end, which only says that it is closed.
fn distinct(
    layer: &mut Layer,
    is_closed: bool,
    about: &About<'_>,
    repair: bool,
    warnings: &mut Warnings,
) -> Result<(), Error> {
    let bounds = kernel::Aabb::around(layer.points.iter().copied());
    let near = bounds.diagonal() * 1e-9;
    let ends = [layer.points.first(), layer.points.last()];
    let [Some(first), Some(last)] = ends else {
        return Ok(());
    };
    if is_closed && layer.points.len() > 1 && first.distance(*last) <= near {
        layer.points.pop();
        layer.lines.truncate(layer.points.len());
        layer.is_closed = Some(true);
    }
    let mut k = 1;
    while k < layer.points.len() {
        if layer.points[k].distance(layer.points[k - 1]) > near {
            k += 1;
            continue;
        }
        let text = format!("point {} is the same as the one before", k + 1);
        if !repair {
            return Err(about.error(&layer.point_place(k), text));
        }
        warnings.invalid(
            about.place(&layer.point_place(k)),
            "a point that repeats is left out",
        );
        layer.points.remove(k);
        if k < layer.lines.len() {
            layer.lines.remove(k);
        }
    }
    Ok(())
}
