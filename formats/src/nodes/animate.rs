//! What a scene looks like at a time: sensors of time, interpolators, and the routes between
//! them and the fields that they move.
//!
//! The tree is kept, and its fields are changed before it becomes a scene once more: so
//! everything that can be read can move, and nothing has to be written twice.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};
use kernel::Scene;

use super::scene::{Converter, turn};
use super::{Field, Node, Tree, spline, text};
use crate::pictures::Pictures;
use crate::{Error, Limits, NoFiles, ReadOptions, Warnings};

/// A route from a field of a node to a field of another one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Route {
    /// The node that sends.
    pub from: usize,
    /// Its field, with or without `_changed`.
    pub from_field: Arc<str>,
    /// The node that receives.
    pub to: usize,
    /// Its field, with or without `set_`.
    pub to_field: Arc<str>,
}

/// A scene that changes with time.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    tree: Tree,
    /// What has been decoded already.
    pictures: Pictures,
    limits: Limits,
}

impl Animation {
    /// The animation of a tree, if a sensor of time has a route to anything.
    pub(super) fn of(tree: &Tree, pictures: Pictures, limits: &Limits) -> Option<Self> {
        let moves = |route: &Route| &*tree.nodes[route.from].kind == "TimeSensor";
        tree.routes.iter().any(moves).then(|| Self {
            tree: tree.clone(),
            pictures,
            limits: limits.clone(),
        })
    }

    /// The scene `seconds` after the file has been opened, which is the time zero of its
    /// sensors. Scripts and what a user does are left out.
    ///
    /// # Errors
    /// If a limit is passed.
    pub fn scene_at(&self, seconds: f64) -> Result<Scene, Error> {
        let options = ReadOptions {
            limits: &self.limits,
            resolver: &NoFiles,
        };
        let mut tree = self.tree.clone();
        for change in self.changes(seconds, &options) {
            tree.nodes[change.node].fields.push(change.field);
        }
        let (warnings, mut pictures) = (Warnings::default(), self.pictures.clone());
        let import = super::scene::convert(&tree, warnings, &mut pictures, &options)?;
        Ok(import.scene)
    }

    /// The fields that have other values at a time than in the file. Each route is followed
    /// once.
    fn changes(&self, seconds: f64, options: &ReadOptions<'_>) -> Vec<Change> {
        let tree = &self.tree;
        let mut routes: HashMap<(usize, &str), Vec<&Route>> = HashMap::new();
        for route in &tree.routes {
            let start = (route.from, plain_name(&route.from_field));
            routes.entry(start).or_default().push(route);
        }
        let mut converter = Converter::new(tree, Warnings::default(), options);
        let mut events: VecDeque<(usize, &str, Vec<f64>)> = VecDeque::new();
        for (index, node) in tree.nodes.iter().enumerate() {
            if &*node.kind == "TimeSensor" && routes.contains_key(&(index, "fraction")) {
                let warnings = &mut converter.warnings;
                let fraction = fraction(node, seconds, warnings).into_iter();
                events.extend(fraction.map(|f| (index, "fraction", vec![f])));
            }
        }
        let mut changes = Vec::new();
        while let Some((from, field, value)) = events.pop_front() {
            for route in routes.remove(&(from, field)).unwrap_or_default() {
                let (node, name) = (&tree.nodes[route.to], plain_name(&route.to_field));
                if name == "fraction" {
                    let sent = interpolated(&mut converter, node, &value);
                    events.extend(
                        sent.into_iter()
                            .map(|(name, value)| (route.to, name, value)),
                    );
                    continue;
                }
                let text: Vec<String> = value.iter().map(|x| format!("{x:e}")).collect();
                changes.push(Change {
                    node: route.to,
                    field: Field {
                        name: name.into(),
                        value: text.join(" ").into(),
                    },
                });
                events.push_back((route.to, name, value.clone()));
            }
        }
        changes
    }
}

/// A new value of a field.
struct Change {
    node: usize,
    field: Field,
}

/// The name of a field without what marks it as sent or received.
pub(super) fn plain_name(field: &str) -> &str {
    let field = field.strip_prefix("set_").unwrap_or(field);
    field.strip_suffix("_changed").unwrap_or(field)
}

/// How far the cycle of a sensor has come, from 0 to 1; nothing before it starts.
fn fraction(sensor: &Node, seconds: f64, warnings: &mut Warnings) -> Option<f64> {
    let mut number = |field, default| sensor.number(field, default, warnings);
    let (start, stop) = (number("startTime", 0.0), number("stopTime", 0.0));
    let cycle = number("cycleInterval", 1.0);
    let enabled = sensor.flag("enabled", true, warnings);
    let since = if stop > start {
        seconds.min(stop)
    } else {
        seconds
    } - start;
    if !enabled || since < 0.0 || cycle <= 0.0 {
        return None;
    }
    let cycles = since / cycle;
    match sensor.flag("loop", false, warnings) {
        // A cycle that has just ended is at its end.
        true if cycles > 0.0 && cycles.fract() <= 0.0 => Some(1.0),
        true => Some(cycles.fract()),
        false => Some(cycles.min(1.0)),
    }
}

/// The warnings, and what is wrong with the nodes that act through routes.
pub(super) fn checked(tree: &Tree, warnings: Warnings, options: &ReadOptions<'_>) -> Warnings {
    let mut converter = Converter::new(tree, warnings, options);
    for node in tree.nodes.iter().filter(|node| is_driver(&node.kind)) {
        check(&mut converter, node);
    }
    converter.warnings
}

fn check(converter: &mut Converter<'_>, node: &Node) {
    if &*node.kind == "TimeSensor" {
        fraction(node, 0.0, &mut converter.warnings);
        return;
    }
    let [keys, values] = ["key", "keyValue"].map(|field| node.text(field).unwrap_or_default());
    let [keys, values] = [keys, values].map(|text| text::words(text).count());
    let sent = interpolated(converter, node, &[0.0; 2]);
    let keyed = KEYED.iter().find(|keyed| keyed.kind == &*node.kind);
    let fits = keyed.is_none_or(|keyed| {
        let size = values.checked_div(keys).unwrap_or(0);
        let is_one = size == keyed.unit || keyed.is_list && size.is_multiple_of(keyed.unit);
        is_one && size * keys == values
    });
    if keys + values > 0 && !fits {
        let text = format!("{values} numbers of values do not belong to {keys} keys");
        converter.warnings.invalid(node.place(), text);
    } else if sent.is_empty() && keyed.is_none() && (values > 0 || !node.children.is_empty()) {
        let text = "its points make no curve or surface; it moves nothing";
        converter.warnings.invalid(node.place(), text);
    }
}

/// What an interpolator sends for a fraction: the plain name of the field and its value.
fn interpolated<'n>(
    converter: &mut Converter<'_>,
    node: &Node,
    fraction: &[f64],
) -> Vec<(&'n str, Vec<f64>)> {
    let value = |value| vec![("value", value)];
    let at = |i: usize| fraction.get(i).copied().unwrap_or(0.0);
    let warnings = &mut converter.warnings;
    if let Some(keyed) = KEYED.iter().find(|keyed| keyed.kind == &*node.kind) {
        return (keyed.at)(node, at(0), warnings).map_or_else(Vec::new, value);
    }
    match &*node.kind {
        "NurbsPositionInterpolator" | "NurbsOrientationInterpolator" => {
            let Ok(Ok(curve)) = converter.curve_3d(node) else {
                return Vec::new();
            };
            let domain = curve.domain();
            let found = curve.derivatives(at(0).clamp(domain.start, domain.end));
            if &*node.kind == "NurbsPositionInterpolator" {
                return value(found.point.to_array().to_vec());
            }
            let along = found.first.normalize_or(DVec3::X);
            value(axis_angle(DQuat::from_rotation_arc(DVec3::X, along), node))
        }
        "NurbsSurfaceInterpolator" => {
            let Ok(Ok(patches)) = converter.patches(node) else {
                return Vec::new();
            };
            let Some(surface) = patches.first().map(|patch| &patch.surface) else {
                return Vec::new();
            };
            let (u, v) = (surface.knots_u().domain(), surface.knots_v().domain());
            let uv = DVec2::new(at(0).clamp(u.start, u.end), at(1).clamp(v.start, v.end));
            let normal = surface.normal(uv).unwrap_or(DVec3::Z);
            let position = surface.evaluate(uv).to_array().to_vec();
            vec![
                ("position", position),
                ("normal", normal.to_array().to_vec()),
            ]
        }
        _ => Vec::new(),
    }
}

/// An interpolator between values at keys.
struct Keyed {
    kind: &'static str,
    /// How many numbers there are for each key, or any number of times as many.
    unit: usize,
    is_list: bool,
    /// Its value for a fraction.
    at: fn(&Node, f64, &mut Warnings) -> Option<Vec<f64>>,
}

const KEYED: &[Keyed] = &[
    keyed("ColorInterpolator", 3, linear),
    listed("CoordinateInterpolator", 3),
    listed("CoordinateInterpolator2D", 2),
    listed("NormalInterpolator", 3),
    keyed("OrientationInterpolator", 4, turned),
    keyed("PositionInterpolator", 3, linear),
    keyed("PositionInterpolator2D", 2, linear),
    keyed("ScalarInterpolator", 1, linear),
    keyed("SplinePositionInterpolator", 3, spline::hermite),
    keyed("SplinePositionInterpolator2D", 2, spline::hermite),
    keyed("SplineScalarInterpolator", 1, spline::hermite),
    keyed("SquadOrientationInterpolator", 4, squad),
];

const fn keyed(
    kind: &'static str,
    unit: usize,
    at: fn(&Node, f64, &mut Warnings) -> Option<Vec<f64>>,
) -> Keyed {
    Keyed {
        kind,
        unit,
        is_list: false,
        at,
    }
}

/// One with a list of values at each key.
const fn listed(kind: &'static str, unit: usize) -> Keyed {
    Keyed {
        is_list: true,
        ..keyed(kind, unit, linear)
    }
}

/// Nodes that act through routes and show nothing.
pub(super) fn is_driver(kind: &str) -> bool {
    KEYED.iter().any(|keyed| keyed.kind == kind)
        || matches!(
            kind,
            "NurbsOrientationInterpolator"
                | "NurbsPositionInterpolator"
                | "NurbsSurfaceInterpolator"
                | "TimeSensor"
        )
}

/// The values of an interpolator mixed between the two keys around a fraction.
fn between(
    node: &Node,
    fraction: f64,
    mix: impl Fn(&[f64], &[f64], f64) -> Vec<f64>,
    warnings: &mut Warnings,
) -> Option<Vec<f64>> {
    let keys = node.numbers("key", warnings);
    let values = node.numbers("keyValue", warnings);
    let size = values
        .len()
        .checked_div(keys.len())
        .filter(|&size| size > 0)?;
    let value = |i: usize| &values[i * size..(i + 1) * size];
    let after = keys.partition_point(|&key| key <= fraction);
    let Some(before) = after.checked_sub(1) else {
        return Some(value(0).to_vec());
    };
    if after == keys.len() {
        return Some(value(before).to_vec());
    }
    let share = (fraction - keys[before]) / (keys[after] - keys[before]);
    Some(mix(value(before), value(after), share))
}

/// Each number changes evenly.
fn linear(node: &Node, fraction: f64, warnings: &mut Warnings) -> Option<Vec<f64>> {
    let mix = |a: &[f64], b: &[f64], share: f64| {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| a + (b - a) * share).collect()
    };
    between(node, fraction, mix, warnings)
}

/// The rotation on the shortest way between two.
fn turned(node: &Node, fraction: f64, warnings: &mut Warnings) -> Option<Vec<f64>> {
    let rotation = |values: &[f64]| {
        let values = <[f64; 4]>::try_from(values);
        values.map_or(DQuat::IDENTITY, |values| turn(values, node))
    };
    let mix = |a: &[f64], b: &[f64], share| axis_angle(rotation(a).slerp(rotation(b), share), node);
    between(node, fraction, mix, warnings)
}

/// The rotation that goes smoothly through all.
fn squad(node: &Node, fraction: f64, warnings: &mut Warnings) -> Option<Vec<f64>> {
    spline::squad(node, fraction, warnings).map(|turn| axis_angle(turn, node))
}

/// A rotation as the node's file would write it.
fn axis_angle(rotation: DQuat, node: &Node) -> Vec<f64> {
    let (axis, angle) = rotation.to_axis_angle();
    vec![axis.x, axis.y, axis.z, angle / node.file.angle]
}
