//! Lights, at every place where they stand.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::{DAffine3, DVec3};
use kernel::{Falloff, Light, LightKind};

use super::Node;
use super::kinds::is_group;
use super::look::scale;
use super::scene::{Converter, Made};
use crate::Problem;

/// Opening angles of a `SpotLight` where the file gives none: full light, and no light.
const SPOT_3: [f64; 2] = [FRAC_PI_4, FRAC_PI_2];

/// As [`SPOT_3`], since X3D 4.0.
const SPOT_4: [f64; 2] = [0.589_049, FRAC_PI_2];

/// As [`SPOT_3`], in VRML 97.
const SPOT_97: [f64; 2] = [FRAC_PI_2, FRAC_PI_4];

/// What is said of a light that shines nowhere.
const AIMLESS: &str = "a light without a direction; it is left out";

/// How many surfaces take as long as a light: every point of a picture asks every light.
const SURFACES_OF_LIGHT: u64 = 1000;

/// A light in the coordinates of the node around it.
pub(super) struct Lamp {
    light: Light,
    /// Whether it shines in that node only.
    is_local: bool,
}

impl Converter<'_> {
    /// A light in the coordinates of the node around it.
    pub(super) fn light(&mut self, node: &Node) -> Made {
        if !node.flag("on", true, &mut self.warnings) {
            return Made::Nothing;
        }
        let directional = &*node.kind == "DirectionalLight";
        let global = node.flag("global", !directional, &mut self.warnings);
        let Some(kind) = self.light_kind(node) else {
            self.warnings.invalid(node.place(), AIMLESS);
            return Made::Nothing;
        };
        let color = self.color(node, "color", DVec3::ONE);
        // Since X3D 4.0 intensities may be above one.
        let intensity = node.size("intensity", 1.0, &mut self.warnings);
        let ambient = node.size("ambientIntensity", 0.0, &mut self.warnings);
        let light = Light {
            kind,
            color: color * intensity,
            ambient: color * ambient,
            scope: Vec::new(),
        };
        self.lights.push(Lamp {
            light,
            is_local: !global,
        });
        Made::Light(self.lights.len() - 1)
    }

    fn light_kind(&mut self, node: &Node) -> Option<LightKind> {
        let position = node.vector("location", DVec3::ZERO, &mut self.warnings);
        let direction = node.vector("direction", DVec3::NEG_Z, &mut self.warnings);
        let direction = direction.try_normalize();
        match &*node.kind {
            "DirectionalLight" => direction.map(|direction| LightKind::Directional { direction }),
            "PointLight" => Some(LightKind::Point {
                position,
                falloff: self.falloff(node),
            }),
            _ => {
                let [beam, cut_off] = match &*node.file.version {
                    "2.0" => SPOT_97,
                    version if version.starts_with('4') => SPOT_4,
                    _ => SPOT_3,
                };
                let outer = self.angle(node, "cutOffAngle", cut_off).clamp(0.0, PI);
                let inner = self.angle(node, "beamWidth", beam).clamp(0.0, outer);
                Some(LightKind::Spot {
                    position,
                    direction: direction?,
                    inner,
                    outer,
                    falloff: self.falloff(node),
                })
            }
        }
    }

    /// How a light weakens.
    fn falloff(&mut self, node: &Node) -> Falloff {
        Falloff {
            attenuation: node.vector("attenuation", DVec3::X, &mut self.warnings),
            radius: node.size("radius", 100.0, &mut self.warnings),
        }
    }

    /// Adds every light to the scene once for each place where it stands, in the order of the
    /// file, but not more than a picture has time for.
    pub(super) fn place_lights(&mut self, root: usize) {
        let tree = self.tree;
        // The children of groups that are lights, or groups with a light in them.
        let mut lit: HashMap<usize, Vec<usize>> = HashMap::new();
        for index in 0..=root {
            let node = &tree.nodes[index];
            if !is_group(&node.kind) {
                continue;
            }
            let mut inside = self.shown_inside(node);
            inside.retain(|child| {
                matches!(self.made[*child], Made::Light(_)) || lit.contains_key(child)
            });
            if !inside.is_empty() {
                lit.insert(index, inside);
            }
        }
        let most = self.options.limits.placements / SURFACES_OF_LIGHT;
        let most = usize::try_from(most).unwrap_or(usize::MAX);
        let mut count = 0;
        // An explicit stack: files may nest deeper than ours reaches.
        let mut open = Vec::new();
        let inside = |index: usize| lit.get(&index).map(|list| list.iter());
        open.extend(inside(root).map(|list| (root, self.parent_from_node(root), list)));
        while let Some((_, world, list)) = open.last_mut() {
            let (world, next) = (*world, list.next());
            match next.map(|&child| (child, self.made[child])) {
                None => {
                    open.pop();
                }
                Some((child, Made::Light(_))) if count >= most => {
                    let text =
                        format!("more than {most} places of lights; the others do not shine");
                    let problem = Problem::TooLarge(text);
                    return self.warnings.add(tree.nodes[child].place(), problem);
                }
                Some((child, Made::Light(lamp))) => {
                    count += 1;
                    let Lamp { light, is_local } = &self.lights[lamp];
                    let path = if *is_local && open.len() > 1 {
                        let group = |&(index, ..): &(usize, _, _)| match self.made[index] {
                            Made::Node(id) => Some(id),
                            _ => None,
                        };
                        open.iter().map(group).collect()
                    } else {
                        Some(Vec::new())
                    };
                    // Else nothing is in its group.
                    let Some(scope) = path else { continue };
                    match placed(light, &world) {
                        Some(light) => self.scene.lights.push(Light { scope, ..light }),
                        None => self.warnings.invalid(tree.nodes[child].place(), AIMLESS),
                    }
                }
                Some((child, _)) => {
                    let world = world * self.parent_from_node(child);
                    open.extend(inside(child).map(|list| (child, world, list)));
                }
            }
        }
    }
}

/// A light where a map brings it; nothing if it has no direction there.
pub(super) fn placed(light: &Light, world: &DAffine3) -> Option<Light> {
    let direction = |direction| world.transform_vector3(direction).try_normalize();
    let kind = match light.kind {
        LightKind::Directional { direction: along } => LightKind::Directional {
            direction: direction(along)?,
        },
        LightKind::Point { position, falloff } => LightKind::Point {
            position: world.transform_point3(position),
            falloff: stretched(falloff, scale(world)),
        },
        LightKind::Spot {
            position,
            direction: along,
            inner,
            outer,
            falloff,
        } => LightKind::Spot {
            position: world.transform_point3(position),
            direction: direction(along)?,
            inner,
            outer,
            falloff: stretched(falloff, scale(world)),
        },
    };
    Some(Light {
        kind,
        ..light.clone()
    })
}

/// How light weakens where all is larger by a factor.
fn stretched(falloff: Falloff, scale: f64) -> Falloff {
    let attenuation = falloff.attenuation / DVec3::new(1.0, scale, scale * scale);
    Falloff {
        attenuation: if attenuation.is_finite() {
            attenuation
        } else {
            DVec3::X
        },
        radius: falloff.radius * scale,
    }
}
