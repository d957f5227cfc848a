//! What scenes have beside triangles, and formats of triangles do not hold.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

use formats::{Place, Warnings};
use glam::DVec3;
use kernel::{Light, LightKind, Material, Scene};

/// Something beside triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    /// What it is, in the plural.
    what: &'static str,
    /// The names of all that a scene has of it.
    list: fn(&Scene) -> Vec<String>,
}

/// What formats of shapes without names do not hold.
pub(crate) const LACKED_BY_SHAPES: &[Part] = &[
    WIRES, MATERIALS, PICTURES, COLORS, CAMERAS, LIGHTS, BACKGROUND, NAMES, UNIT,
];

/// What groups of polygons do not hold.
pub(crate) const LACKED_BY_GROUPS: &[Part] = &[
    MATERIALS, PICTURES, COLORS, CAMERAS, LIGHTS, BACKGROUND, NODE_NAMES, UNIT,
];

/// What glTF does not hold.
pub(crate) const LACKED_BY_GLTF: &[Part] = &[
    HIGHLIGHT_PICTURES,
    BACKS,
    ATTENUATIONS,
    WIDE_CONES,
    SCOPES,
    BACKGROUND,
];

const WIRES: Part = Part {
    what: "curves and points without a surface",
    list: |scene| {
        let wires = scene.wires().iter();
        wires
            .map(|wire| format!("\"{}\", {}", wire.name, wire.source))
            .collect()
    },
};

const MATERIALS: Part = Part {
    what: "materials",
    list: |scene| materials(scene, |material| !is_default(material)),
};

const PICTURES: Part = Part {
    what: "pictures on surfaces",
    list: |scene| materials(scene, |material| !material.maps.is_empty()),
};

const HIGHLIGHT_PICTURES: Part = Part {
    what: "pictures of highlights",
    list: |scene| materials(scene, |material| material.maps.specular.is_some()),
};

const BACKS: Part = Part {
    what: "looks from behind",
    list: |scene| materials(scene, |material| material.back.is_some()),
};

const COLORS: Part = Part {
    what: "colours of vertices",
    list: |scene| {
        let meshes = scene.meshes().iter();
        let coloured = meshes.filter(|mesh| !mesh.colors().is_empty());
        coloured.map(|mesh| called("mesh", &mesh.name)).collect()
    },
};

const CAMERAS: Part = Part {
    what: "cameras",
    list: |scene| {
        let cameras = scene.cameras.iter();
        cameras
            .map(|camera| called("camera", &camera.name))
            .collect()
    },
};

const LIGHTS: Part = Part {
    what: "lights",
    list: |scene| scene.lights.iter().map(|_| "light".to_owned()).collect(),
};

/// Lights of glTF weaken with the square of the distance.
const ATTENUATIONS: Part = Part {
    what: "attenuations of lights",
    list: |scene| {
        let lights = scene.lights.iter();
        let lost = lights.filter(|light| match light.kind {
            LightKind::Directional { .. } => false,
            LightKind::Point { falloff, .. } | LightKind::Spot { falloff, .. } => {
                falloff.attenuation != DVec3::Z
            }
        });
        lost.map(|_| "light".to_owned()).collect()
    },
};

/// Those of glTF end at a right angle from their axis, which files may round up.
const WIDE_CONES: Part = Part {
    what: "cones of lights that shine backwards, too,",
    list: |scene| {
        let lights = scene.lights.iter();
        let is_wide = |light: &&Light| match light.kind {
            LightKind::Spot { outer, .. } => outer > FRAC_PI_2 + 1e-6,
            _ => false,
        };
        lights.filter(is_wide).map(|_| "light".to_owned()).collect()
    },
};

const SCOPES: Part = Part {
    what: "bounds of lights that shine in one group only",
    list: |scene| {
        let lights = scene.lights.iter();
        let local = lights.filter(|light| !light.scope.is_empty());
        local.map(|_| "light".to_owned()).collect()
    },
};

const BACKGROUND: Part = Part {
    what: "backgrounds",
    list: |scene| {
        let color = scene.background.iter();
        color.map(|_| "the background".to_owned()).collect()
    },
};

const NAMES: Part = Part {
    what: "names",
    list: |scene| quoted(&(&names_of_nodes(scene) | &names_of_shapes(scene))),
};

const NODE_NAMES: Part = Part {
    what: "names of nodes",
    list: |scene| quoted(&(&names_of_nodes(scene) - &names_of_shapes(scene))),
};

const UNIT: Part = Part {
    what: "units of length",
    list: |scene| {
        let unit = scene.unit.iter();
        unit.map(|unit| format!("the unit {}", unit.name)).collect()
    },
};

/// Notes all that a scene has of these.
pub(crate) fn tell(parts: &[Part], scene: &Scene, warnings: &mut Warnings) {
    for part in parts {
        for name in (part.list)(scene) {
            warnings.unsupported(
                Place::item(0, name),
                format!("{} are not written", part.what),
            );
        }
    }
}

/// Whether a material says nothing but its name.
fn is_default(material: &Material) -> bool {
    let nameless = Material {
        name: String::new(),
        ..material.clone()
    };
    nameless == Material::default()
}

fn materials(scene: &Scene, is_meant: fn(&Material) -> bool) -> Vec<String> {
    let materials = scene.materials().iter();
    let meant = materials.filter(|material| is_meant(material));
    meant
        .map(|material| called("material", &material.name))
        .collect()
}

fn names_of_nodes(scene: &Scene) -> BTreeSet<&str> {
    distinct(scene.nodes().iter().map(|node| &node.name))
}

fn names_of_shapes(scene: &Scene) -> BTreeSet<&str> {
    let patches = scene.patches().iter().map(|patch| &patch.name);
    distinct(patches.chain(scene.meshes().iter().map(|mesh| &mesh.name)))
}

fn distinct<'a>(names: impl Iterator<Item = &'a String>) -> BTreeSet<&'a str> {
    let names = names.map(String::as_str);
    names.filter(|name| !name.is_empty()).collect()
}

fn quoted(names: &BTreeSet<&str>) -> Vec<String> {
    names.iter().map(|name| format!("\"{name}\"")).collect()
}

/// What something is, and its name if it has one.
fn called(what: &str, name: &str) -> String {
    if name.is_empty() {
        what.to_owned()
    } else {
        format!("{what} \"{name}\"")
    }
}
