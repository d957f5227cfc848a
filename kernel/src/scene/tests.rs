use std::f64::consts::FRAC_PI_4;

use glam::{DAffine3, DMat3, DVec3};

use super::*;
use crate::TrimLoop;
use crate::modelling::plane;

fn square() -> Patch {
    let surface = plane(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0..1.0, 0.0..1.0).unwrap();
    Patch::from(surface)
}

fn triangle() -> Mesh {
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Z];
    Mesh::new(corners, Vec::new(), Vec::new(), vec![[0, 1, 2]]).unwrap()
}

fn shown(shape: Shape) -> Child {
    Child::Item(Item {
        shape,
        material: None,
    })
}

fn moved(by: DVec3, children: Vec<Child>) -> Node {
    Node {
        name: String::new(),
        parent_from_node: DAffine3::from_translation(by),
        children,
        ..Node::default()
    }
}

#[test]
fn instances_are_counted_and_placed_in_the_order_of_the_file() {
    let mut scene = Scene::default();
    let patch = Shape::Patch(scene.add_patch(square()).unwrap());
    let mesh = Shape::Mesh(scene.add_mesh(triangle()).unwrap());
    let pair = vec![shown(patch), shown(mesh)];
    let pair = scene.add_node(moved(DVec3::X, pair)).unwrap();
    let twice = vec![Child::Node(pair), shown(patch), Child::Node(pair)];
    let twice = scene.add_node(moved(DVec3::Y, twice)).unwrap();
    let root = vec![Child::Node(twice), Child::Node(pair)];
    let root = scene.add_node(moved(DVec3::ZERO, root)).unwrap();
    assert_eq!(scene.placement_count(), 0);
    assert_eq!(scene.placements(), []);
    scene.set_root(root).unwrap();
    let placements = scene.placements();
    assert_eq!(scene.placement_count(), 7);
    let shapes: Vec<_> = placements.iter().map(|p| p.shape).collect();
    assert_eq!(shapes, [patch, mesh, patch, patch, mesh, patch, mesh]);
    let numbered = scene.numbered_placements();
    let order = [0, 2, 3, 5, 1, 4, 6].map(|k| placements[k].clone());
    assert_eq!(numbered, order);
    let places: Vec<_> = placements
        .iter()
        .map(|p| p.world_from_object.translation)
        .collect();
    let (both, y) = (DVec3::X + DVec3::Y, DVec3::Y);
    assert_eq!(places, [both, both, y, both, both, DVec3::X, DVec3::X]);
    assert_eq!(placements[0].path, [root, twice, pair]);
    assert_eq!(placements[2].path, [root, twice]);
}

#[test]
fn a_tree_of_doublings_is_counted_without_being_flattened() {
    let mut scene = Scene::default();
    let patch = Shape::Patch(scene.add_patch(square()).unwrap());
    let mut node = scene
        .add_node(moved(DVec3::ZERO, vec![shown(patch)]))
        .unwrap();
    for _ in 0..100 {
        let both = vec![Child::Node(node); 2];
        node = scene.add_node(moved(DVec3::X, both)).unwrap();
    }
    scene.set_root(node).unwrap();
    assert_eq!(scene.placement_count(), u64::MAX);
    assert_eq!(scene.hull_bounds().max, DVec3::new(101.0, 1.0, 0.0));
}

#[test]
fn deep_trees_are_walked() {
    let mut scene = Scene::default();
    let patch = Shape::Patch(scene.add_patch(square()).unwrap());
    let mut node = scene
        .add_node(moved(DVec3::ZERO, vec![shown(patch)]))
        .unwrap();
    for _ in 0..20_000 {
        node = scene
            .add_node(moved(DVec3::X, vec![Child::Node(node)]))
            .unwrap();
    }
    scene.set_root(node).unwrap();
    let placements = scene.placements();
    assert_eq!(
        placements[0].world_from_object.translation,
        DVec3::X * 20_000.0
    );
    assert_eq!(placements[0].path.len(), 20_001);
}

#[test]
fn references_to_nothing_are_refused() {
    let (mut scene, mut other) = (Scene::default(), Scene::default());
    let material = other.add_material(Material::default());
    let patch = other.add_patch(square()).unwrap();
    let mesh = other.add_mesh(triangle()).unwrap();
    let node = other.add_node(Node::default()).unwrap();
    let refused = Error::Reference { index: 0, count: 0 };
    for child in [
        Child::Node(node),
        shown(Shape::Patch(patch)),
        shown(Shape::Mesh(mesh)),
    ] {
        assert_eq!(scene.add_node(moved(DVec3::X, vec![child])), Err(refused));
    }
    assert_eq!(scene.set_root(node), Err(refused));
    let mut painted = square();
    painted.material = Some(material);
    assert_eq!(scene.add_patch(painted.clone()), Err(refused));
    assert!(other.add_patch(painted).is_ok());
}

#[test]
fn maps_that_cannot_be_undone_are_refused() {
    let mut scene = Scene::default();
    for matrix3 in [
        DMat3::from_diagonal(DVec3::new(1.0, 0.0, 1.0)),
        DMat3::from_diagonal(DVec3::NAN),
        DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z),
    ] {
        let node = Node {
            parent_from_node: DAffine3 {
                matrix3,
                translation: DVec3::ZERO,
            },
            ..Node::default()
        };
        let refused = scene.add_node(node);
        assert!(matches!(refused, Err(Error::NotPositive { .. })));
    }
    let mirror = DMat3::from_diagonal(DVec3::new(-1e-6, 1e-6, 1e-6));
    let node = Node {
        parent_from_node: DAffine3::from_mat3(mirror),
        ..Node::default()
    };
    assert!(scene.add_node(node).is_ok());
}

#[test]
fn the_material_of_an_item_wins() {
    let mut scene = Scene::default();
    let [own, other] = [0, 1].map(|_| scene.add_material(Material::default()));
    let mut patch = square();
    patch.material = Some(own);
    let shape = Shape::Patch(scene.add_patch(patch).unwrap());
    for (material, expected) in [(None, own), (Some(other), other)] {
        let item = Item { shape, material };
        assert_eq!(scene.item_material(&item), Some(expected));
    }
}

#[test]
fn bounds_follow_rotations() {
    let mut scene = Scene::default();
    assert!(scene.hull_bounds().is_empty());
    let patch = Shape::Patch(scene.add_patch(square()).unwrap());
    let turned = Node {
        parent_from_node: DAffine3::from_rotation_z(FRAC_PI_4),
        children: vec![shown(patch)],
        ..Node::default()
    };
    let turned = scene.add_node(turned).unwrap();
    let empty = scene.add_node(Node::default()).unwrap();
    let children = vec![Child::Node(turned), Child::Node(empty)];
    let root = scene.add_node(moved(DVec3::Z, children)).unwrap();
    scene.set_root(root).unwrap();
    let (bounds, half) = (scene.hull_bounds(), 0.5_f64.sqrt());
    assert!(bounds.min.distance(DVec3::new(-half, 0.0, 1.0)) < 1e-15);
    assert!(bounds.max.distance(DVec3::new(half, 2.0 * half, 1.0)) < 1e-15);
}

#[test]
fn bounds_are_those_of_the_root_of_now() {
    let mut scene = Scene::default();
    let patch = Shape::Patch(scene.add_patch(square()).unwrap());
    let [near, far] = [0.0, 5.0].map(|x| {
        let node = moved(DVec3::X * x, vec![shown(patch)]);
        scene.add_node(node).unwrap()
    });
    assert!(scene.hull_bounds().is_empty());
    for (root, x) in [(near, 0.0), (far, 5.0), (near, 0.0)] {
        scene.set_root(root).unwrap();
        // A copy knows what the scene knows, and is equal to one that knows nothing.
        let copies = [scene.clone(), scene.clone()];
        let bounds = copies[0].hull_bounds();
        assert_eq!((bounds.min.x, bounds.max.x), (x, x + 1.0));
        assert_eq!(copies[0], copies[1]);
    }
}

#[test]
fn bounds_are_no_larger_for_turns_that_undo_each_other() {
    let mut scene = Scene::default();
    let mut patch = square();
    patch.loops = vec![TrimLoop::border(&(0.25..0.5), &(-1.0..0.75)).unwrap()];
    let shape = Shape::Patch(scene.add_patch(patch).unwrap());
    let mut children = vec![shown(shape)];
    for turn in [0.3, -0.5, 0.7, -0.5] {
        let node = Node {
            parent_from_node: DAffine3::from_rotation_z(turn),
            children,
            ..Node::default()
        };
        children = vec![Child::Node(scene.add_node(node).unwrap())];
    }
    let root = scene.add_node(moved(DVec3::X, children)).unwrap();
    scene.set_root(root).unwrap();
    let bounds = scene.hull_bounds();
    assert!(bounds.min.distance(DVec3::new(1.25, 0.0, 0.0)) < 1e-15);
    assert!(bounds.max.distance(DVec3::new(1.5, 0.75, 0.0)) < 1e-15);
}

#[test]
fn bounds_are_those_of_what_is_left_of_faces() {
    let mut patch = square();
    patch.loops = vec![TrimLoop::border(&(0.25..0.5), &(-1.0..0.75)).unwrap()];
    let bounds = patch.hull_bounds();
    assert_eq!(bounds.min, DVec3::new(0.25, 0.0, 0.0));
    assert_eq!(bounds.max, DVec3::new(0.5, 0.75, 0.0));
}

#[test]
fn what_nodes_put_too_far_away_is_refused() {
    for (away, is_held) in [(1e98, true), (1e100, false), (1e308, false)] {
        let mut scene = Scene::default();
        let patch = Shape::Patch(scene.add_patch(square()).unwrap());
        let mut node = scene.add_node(moved(DVec3::Y, vec![shown(patch)])).unwrap();
        for turn in [0.0, 1.0, 2.0] {
            let parent_from_node =
                DAffine3::from_rotation_x(turn) * DAffine3::from_translation(DVec3::splat(away));
            let children = vec![Child::Node(node)];
            let outer = Node {
                parent_from_node,
                ..moved(DVec3::ZERO, children)
            };
            node = scene.add_node(outer).unwrap();
        }
        let found = scene.set_root(node);
        assert_eq!(found, if is_held { Ok(()) } else { Err(Error::TooFar) });
        assert_eq!(scene.root().is_some(), is_held);
    }
}
