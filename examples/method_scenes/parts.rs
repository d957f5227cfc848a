//! Shapes with materials, until they become a scene.

use glam::{DAffine3, DVec3};
use nurbray::kernel::{
    Child, Item, KnotVector, Material, MaterialId, Node, Patch, Scene, Shape, Surface, UpAxis,
    linear_from_srgb,
};

use super::Outcome;

/// Surfaces in groups, each group with its places.
#[derive(Default)]
pub(crate) struct Parts {
    scene: Scene,
    children: Vec<Child>,
    material: Option<MaterialId>,
}

impl Parts {
    /// Nothing yet, with this axis upwards.
    pub(crate) fn upwards(up: UpAxis) -> Self {
        let mut parts = Self::default();
        parts.scene.up = up;
        parts
    }

    /// The material of what follows; the colour as sRGB.
    pub(crate) fn material(&mut self, name: &str, color: [f64; 3], shine: f64) {
        let color = linear_from_srgb(DVec3::from_array(color));
        self.material = Some(self.scene.add_material(Material {
            name: name.to_owned(),
            ambient: color,
            diffuse: color,
            specular: DVec3::splat(shine),
            shininess: 60.0,
            ..Material::default()
        }));
    }

    /// Adds a face.
    pub(crate) fn face(&mut self, name: &str, patch: impl Into<Patch>) -> Outcome<()> {
        let mut patch = patch.into();
        patch.name = name.to_owned();
        patch.material = self.material;
        let shape = Shape::Patch(self.scene.add_patch(patch)?);
        let item = Item {
            shape,
            material: None,
        };
        self.children.push(Child::Item(item));
        Ok(())
    }

    /// Shows all that has been added so far at these places instead of once.
    pub(crate) fn repeat(&mut self, name: &str, places: &[DVec3]) -> Outcome<()> {
        let one = self.scene.add_node(Node {
            name: name.to_owned(),
            children: std::mem::take(&mut self.children),
            ..Node::default()
        })?;
        for &place in places {
            let node = self.scene.add_node(Node {
                parent_from_node: DAffine3::from_translation(place),
                children: vec![Child::Node(one)],
                ..Node::default()
            })?;
            self.children.push(Child::Node(node));
        }
        Ok(())
    }

    /// The scene of all parts.
    pub(crate) fn into_scene(mut self) -> Outcome<Scene> {
        let root = self.scene.add_node(Node {
            children: self.children,
            ..Node::default()
        })?;
        self.scene.set_root(root)?;
        Ok(self.scene)
    }
}

/// Coordinates with five decimals, so that files stay short.
pub(crate) fn short(point: DVec3) -> DVec3 {
    (point * 1e5).round() / 1e5
}

/// A bicubic surface clamped on all sides, `rows[i][j]` along u and v.
pub(crate) fn sheet(rows: &[Vec<DVec3>]) -> Outcome<Surface> {
    let [u, v] = [rows.len(), rows[0].len()]
        .map(|count| KnotVector::clamped_uniform(3, count, 0.0..(count - 3) as f64));
    let points: Vec<_> = rows.iter().flatten().map(|&p| short(p)).collect();
    Ok(Surface::new(u?, v?, &points, None)?)
}

/// A bicubic surface around closed rings of control points: clamped along u, periodic and
/// smooth along v.
pub(crate) fn tube(rings: &[Vec<DVec3>]) -> Outcome<Surface> {
    let around = rings[0].len();
    let u = KnotVector::clamped_uniform(3, rings.len(), 0.0..(rings.len() - 3) as f64)?;
    // Before and after the domain as in it.
    let v = (0..around + 7).map(|k| k as f64 - 3.0).collect();
    let points: Vec<_> = rings
        .iter()
        .flat_map(|ring| (0..around + 3).map(|k| ring[k % around]))
        .collect();
    let periodic = Surface::new(u, KnotVector::new(3, v)?, &points, None)?;
    let clamped = periodic.restricted_v(0.0..around as f64)?;
    let (knots_u, knots_v) = (clamped.knots_u().clone(), clamped.knots_v().clone());
    let points: Vec<_> = clamped.points().map(short).collect();
    Ok(Surface::new(knots_u, knots_v, &points, None)?)
}

/// A ring of `count` points around `center`, with the two half axes `a` and `b`.
pub(crate) fn ring(center: DVec3, a: DVec3, b: DVec3, count: usize) -> Vec<DVec3> {
    let angle = |k: usize| std::f64::consts::TAU * k as f64 / count as f64;
    (0..count)
        .map(|k| center + a * angle(k).cos() + b * angle(k).sin())
        .collect()
}

/// Pseudo-random numbers from -1 to 1, the same in every run.
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
