//! Scenes and rays that are measured.

use glam::{DAffine3, DVec3};
use nurbray::formats::{Limits, open};
use nurbray::kernel::{Child, Item, Node, NodeId, Patch, Ray, Scene, Shape};

/// Side of a picture in pixels.
pub(crate) const SIZE: usize = 512;

/// A sample of the repository.
pub(crate) fn sample(name: &str) -> Scene {
    let path = format!("{}/samples/{name}", env!("CARGO_MANIFEST_DIR"));
    open(path, &Limits::default())
        .expect("samples are sound")
        .scene
}

fn shown(scene: &mut Scene, children: Vec<Child>, place: DVec3) -> NodeId {
    let node = Node {
        parent_from_node: DAffine3::from_translation(place),
        children,
        ..Node::default()
    };
    scene.add_node(node).expect("children stand before")
}

/// `n x n x n` of the patches of a scene, each once and placed often, or each for itself.
pub(crate) fn array(scene: &Scene, n: u32, flat: bool) -> Scene {
    let middle = f64::from(n - 1) * 0.5;
    let place = |k: u32| f64::from(k) - middle;
    let places = (0..n * n * n).map(|k| {
        let [x, y, z] = [k / (n * n), k / n % n, k % n].map(place);
        DVec3::new(7.0 * x, 5.0 * y, 4.0 * z)
    });
    let mut out = Scene::default();
    let add = |out: &mut Scene, offset: DVec3| -> Vec<Child> {
        let patches = scene.patches().iter().map(|patch| {
            let moved = DAffine3::from_translation(offset);
            Patch::from(patch.surface.transformed(&moved))
        });
        let ids: Vec<_> = patches.map(|patch| out.add_patch(patch)).collect();
        ids.into_iter()
            .map(|id| {
                Child::Item(Item {
                    shape: Shape::Patch(id.expect("a sound patch")),
                    material: None,
                })
            })
            .collect()
    };
    let children = if flat {
        places.flat_map(|place| add(&mut out, place)).collect()
    } else {
        let children = add(&mut out, DVec3::ZERO);
        let one = shown(&mut out, children, DVec3::ZERO);
        let again = |place| Child::Node(shown(&mut out, vec![Child::Node(one)], place));
        places.map(again).collect()
    };
    let root = shown(&mut out, children, DVec3::ZERO);
    out.set_root(root).expect("it was just added");
    out
}

/// A camera as rays want it: eye, forward, right and up, the last two as long as half the
/// picture at distance one.
pub(crate) struct View {
    pub(crate) eye: DVec3,
    pub(crate) forward: DVec3,
    pub(crate) right: DVec3,
    pub(crate) up: DVec3,
}

impl View {
    /// Looks at a scene from the upper right, so that it fills the picture.
    pub(crate) fn of(scene: &Scene) -> Self {
        let hull = scene.hull_bounds();
        let forward = DVec3::new(-0.45, 0.84, -0.32).normalize();
        let right = forward.cross(DVec3::Z).normalize() * 0.36;
        Self {
            eye: hull.center() - forward * hull.diagonal() * 1.4,
            forward,
            right,
            up: right.cross(forward),
        }
    }

    /// One ray for each pixel, in the order of [`Self::packets`].
    pub(crate) fn rays(&self, width: usize, height: usize) -> Vec<Ray> {
        let mut all = Vec::new();
        self.packets(width, height, &mut |rays| all.extend_from_slice(rays));
        all
    }

    /// Visits the rays of 8 by 8 pixels, those in parts of 4 by 4, square by square.
    pub(crate) fn packets(&self, width: usize, height: usize, visit: &mut dyn FnMut(&[Ray])) {
        let aspect = width as f64 / height as f64;
        let across = |x: usize| (2.0 * (x as f64 + 0.5) / width as f64 - 1.0) * aspect;
        let along = |y: usize| 1.0 - 2.0 * (y as f64 + 0.5) / height as f64;
        let columns: Vec<DVec3> = (0..width).map(|x| self.right * across(x)).collect();
        let rows: Vec<DVec3> = (0..height)
            .map(|y| self.forward + self.up * along(y))
            .collect();
        let mut rays = vec![
            Ray {
                origin: self.eye,
                direction: DVec3::ZERO,
            };
            64
        ];
        squares(width, height, 32, &mut |x, y| {
            let (w, h) = (width.min(x + 32) - x, height.min(y + 32) - y);
            squares(w, h, 8, &mut |i, j| {
                let mut count = 0;
                for part in 0..4 {
                    let (x, y) = (x + i + part % 2 * 4, y + j + part / 2 * 4);
                    let columns = &columns[x.min(width)..width.min(x + 4)];
                    for row in &rows[y.min(height)..height.min(y + 4)] {
                        // As many as nearly always, for the compiler to unroll.
                        if let (Ok(rays), Ok(columns)) = (
                            <&mut [Ray; 4]>::try_from(&mut rays[count..count + 4]),
                            <&[DVec3; 4]>::try_from(columns),
                        ) {
                            for (ray, column) in rays.iter_mut().zip(columns) {
                                ray.direction = *row + *column;
                            }
                        } else {
                            for (ray, column) in rays[count..].iter_mut().zip(columns) {
                                ray.direction = *row + *column;
                            }
                        }
                        count += columns.len();
                    }
                }
                visit(&rays[..count]);
            });
        });
    }
}

/// The corners of the squares of a rectangle.
fn squares(width: usize, height: usize, side: usize, visit: &mut dyn FnMut(usize, usize)) {
    for y in (0..height).step_by(side) {
        for x in (0..width).step_by(side) {
            visit(x, y);
        }
    }
}
