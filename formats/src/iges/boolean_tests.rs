//! Boolean trees: what is made of solids, and what is told where nothing is.

use glam::DVec3;
use kernel::{Aabb, Integrals, Patch, Scene, Shape};

use super::testing::{Made, file, made, part, read, read_within, square};
use crate::Limits;

/// How far sizes may be off, as a share of them.
const NEAR: f64 = 1e-6;

/// A block from 0 to 2, and one that comes out of its side: from 1 to 3 and half as wide.
fn blocks() -> [Made; 2] {
    let turned = ",1.,0.,0.,0.,0.,1.";
    [
        part(150, 0, &format!("2.,2.,2.,0.,0.,0.{turned}")),
        part(150, 0, &format!("2.,1.,1.,1.,0.5,0.5{turned}")),
    ]
}

fn tree(terms: &str) -> Made {
    made(180, terms)
}

fn moved(x: f64) -> Made {
    made(124, &format!("1.,0.,0.,{x:?},0.,1.,0.,0.,0.,0.,1.,0."))
}

/// All faces in their places.
fn faces(scene: &Scene) -> Vec<Patch> {
    let placements = scene.placements();
    let face = |placement: &kernel::Placement| {
        let Shape::Patch(id) = placement.shape else {
            panic!("a mesh")
        };
        Patch {
            material: placement.material,
            ..scene.patch(id).transformed(&placement.world_from_object)
        }
    };
    placements.iter().map(face).collect()
}

/// The area of all faces, and where they begin and end along x.
fn size(scene: &Scene) -> [f64; 3] {
    let faces = faces(scene);
    let area = |face: &Patch| Integrals::of(face, DVec3::ZERO).area();
    let all = faces
        .iter()
        .fold(Aabb::EMPTY, |all, face| all.union(face.bounds()));
    [faces.iter().map(area).sum(), all.min.x, all.max.x]
}

fn is_near(found: [f64; 3], wanted: [f64; 3]) -> bool {
    found
        .iter()
        .zip(wanted)
        .all(|(a, b)| (a - b).abs() <= NEAR * b.abs().max(1.0))
}

#[test]

fn the_first_solid_is_the_one_that_stays() {
    for (terms, wanted) in [
        ("3,-1,-3,1", [28.0, 0.0, 3.0]),
        ("3,-1,-3,2", [6.0, 1.0, 2.0]),
        ("3,-1,-3,3", [28.0, 0.0, 2.0]),
        ("3,-3,-1,3", [6.0, 2.0, 3.0]),
        // What the first has alone, and what both have.
        ("7,-1,-3,3,-1,-3,2,1", [24.0, 0.0, 2.0]),
    ] {
        let [first, second] = blocks();
        let (scene, warnings) = read(&[first, second, tree(terms)]);
        assert!(warnings.is_empty(), "{terms}: {warnings:?}");
        assert!(is_near(size(&scene), wanted), "{terms}: {:?}", size(&scene));
        let root = scene.node(scene.root().unwrap());
        let [kernel::Child::Node(solid)] = root.children[..] else {
            panic!("{terms}")
        };
        assert_eq!(scene.node(solid).voids, Some(0), "{terms}");
        assert_eq!(scene.patches().len(), scene.placements().len(), "{terms}");
    }
}

#[test]

fn trees_of_trees_are_moved_as_a_whole() {
    let [first, mut second] = blocks();
    // It ends at 3.5 then, and the tree of both begins at 10.
    second.transform = 7;
    let inner = Made {
        transform: 9,
        ..part(180, 0, "3,-1,-3,1")
    };
    let outer = Made {
        transform: 9,
        ..tree("3,-5,-13,3")
    };
    let far = part(158, 0, "1.,100.");
    let entities = [first, second, inner, moved(0.5), moved(10.0), outer, far];
    let (scene, warnings) = read(&entities);
    assert!(warnings.is_empty(), "{warnings:?}");
    let found = size(&scene);
    assert!(is_near(found, [30.0, 20.0, 23.5]), "{found:?}");
}

#[test]

fn faces_keep_their_names_and_colours() {
    let [mut first, mut second] = blocks();
    first.color = 2;
    second.label = "TOOL";
    let (scene, _) = read(&[
        first,
        second,
        Made {
            color: 4,
            ..tree("3,-1,-3,3")
        },
    ]);
    for face in faces(&scene) {
        let own = face.source.starts_with("block D1 ");
        assert_eq!(face.name, if own { "" } else { "TOOL" });
        let color = scene.material(face.material.unwrap()).name.clone();
        assert_eq!(color, if own { "red" } else { "blue" });
    }
    let is_tool = |face: &Patch| face.name == "TOOL";
    assert_eq!(faces(&scene).iter().filter(|face| is_tool(face)).count(), 5);
}

#[test]

fn assemblies_and_instances_are_solids() {
    let [first, second] = blocks();
    let assembly = part(184, 0, "2,1,3,0,0");
    let instance = Made {
        transform: 9,
        ..part(430, 0, "5")
    };
    let (scene, warnings) = read(&[
        first,
        second,
        assembly,
        instance,
        moved(2.5),
        tree("3,-5,-7,2"),
    ]);
    assert!(warnings.is_empty(), "{warnings:?}");
    let found = size(&scene);
    assert!(is_near(found, [4.0, 2.5, 3.0]), "{found:?}");
}

#[test]

fn solids_of_which_nothing_is_left_are_told() {
    let [first, second] = blocks();
    let far = part(158, 0, "1.,100.");
    let entities = |terms: &str| [first.clone(), second.clone(), far.clone(), tree(terms)];
    // The second block is in no tree.
    let (scene, warnings) = read(&entities("3,-1,-5,2"));
    assert_eq!(scene.placements().len(), 6);
    let text = "an empty solid: nothing is left of those that it is made of";
    assert!(
        warnings.iter().any(|found| found.ends_with(text)),
        "{warnings:?}"
    );
    let (scene, warnings) = read(&entities("5,-1,-5,2,-3,1"));
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(scene.patches().len(), 6);
}

/// How many faces are shown, and what is told, of three spheres, more, and a tree.
fn failing(more: &[Made], terms: &str) -> (usize, Vec<String>) {
    let sphere = || made(158, "1.");
    let entities = [&[sphere(), sphere(), sphere()], more, &[tree(terms)]].concat();
    let (scene, warnings) = read(&entities);
    assert_eq!(scene.patches().len(), scene.placements().len());
    (scene.placements().len(), warnings)
}

#[test]
fn unions_that_fail_are_their_bodies_and_others_are_refused() {
    let whole = "its bodies are shown whole, also inside each other: ";
    let face = Made {
        status: "00010000",
        ..square(0.0)
    };
    let curve = part(110, 0, "0.,0.,0.,1.,0.,0.");
    for (more, operand, reason) in [
        (Some(face), 7, "surface D7 (type 128) is no solid"),
        (Some(curve), 7, "line D7 (type 110) is no solid"),
        (
            Some(part(150, 0, "-1.")),
            7,
            "block D7 (type 150) is not read",
        ),
        (None, 99, "one of its solids is not there"),
    ] {
        let more: Vec<Made> = more.into_iter().collect();
        for operation in 1..=3 {
            let terms = format!("3,-1,-{operand},{operation}");
            let (shown, warnings) = failing(&more, &terms);
            let told = warnings.iter().filter(|text| text.ends_with(reason));
            let is_whole = |text: &&String| text.contains(whole);
            if operation == 1 {
                // With two others, and what is no solid.
                assert!((3..=4).contains(&shown), "{terms}: {shown}");
                assert_eq!(told.filter(is_whole).count(), 1, "{warnings:?}");
            } else {
                assert_eq!(shown, 2, "{terms}");
                assert_eq!(told.count(), 1, "{warnings:?}");
                assert!(!warnings.iter().any(|text| text.contains(whole)));
            }
        }
    }
}

#[test]
fn the_operation_that_fails_is_named() {
    let face = Made {
        status: "00010000",
        ..square(0.0)
    };
    let (shown, warnings) = failing(&[face], "5,-1,-7,2,-3,3");
    assert_eq!(shown, 1);
    let text = "term 3, an intersection: surface D7 (type 128) is no solid";
    assert!(warnings[0].ends_with(text), "{warnings:?}");
}

#[test]
fn malformed_trees_are_told_and_unions_shown() {
    for (terms, shown, told) in [
        (
            "2,-1,-3",
            3,
            "shown whole, also inside each other: its terms leave 2 solids; they must leave one",
        ),
        ("3,-1,-3,4", 1, "term 3 is 4; terms are negative pointers"),
        ("2,-1,3", 2, "term 2 is a difference of two solids, but 1"),
        ("0", 3, "it has no terms"),
        ("1,1", 3, "term 1 is a union of two solids, but 0"),
    ] {
        let (found, warnings) = failing(&[], terms);
        assert_eq!(found, shown, "{terms}");
        assert!(
            warnings.iter().any(|text| text.contains(told)),
            "{terms}: {warnings:?}"
        );
    }
}

#[test]
fn a_tree_of_one_solid_is_that() {
    let (shown, warnings) = failing(&[], "1,-1");
    assert_eq!(shown, 3);
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn a_tree_in_itself_is_told() {
    let (shown, warnings) = failing(&[], "3,-1,-7,1");
    assert_eq!(shown, 2);
    assert!(warnings[0].ends_with("it contains itself"), "{warnings:?}");
    let other = part(180, 0, "3,-1,-9,3");
    let (shown, warnings) = failing(&[other], "3,-3,-7,3");
    assert_eq!(shown, 1);
    assert!(
        warnings
            .iter()
            .any(|text| text.ends_with("it contains itself")),
        "{warnings:?}"
    );
}

#[test]
fn solids_of_too_many_faces_are_not_combined() {
    let [block, _] = blocks();
    // 200 blocks have 1200 faces.
    let many = format!("200{}{}", ",1".repeat(200), ",0".repeat(200));
    let (scene, warnings) = read(&[
        block,
        part(158, 0, "1."),
        part(184, 0, &many),
        made(158, "1."),
        tree("3,-5,-3,3"),
    ]);
    assert_eq!(scene.placements().len(), 1);
    let text = "solid assembly D5 (type 184) has more than 1000 faces";
    assert!(warnings[0].ends_with(text), "{warnings:?}");
}

#[test]
fn the_ledger_counts_what_trees_are_made_of() {
    let face = Made {
        status: "00010000",
        ..square(0.0)
    };
    let entities = [made(158, "1."), face, made(158, "1."), tree("3,-1,-3,3")];
    let import = read_within(&file(&entities), &Limits::default()).unwrap();
    assert_eq!(import.scene.patches().len(), 1);
    let row = |kind: &str| {
        let found = import.ledger.iter().find(|row| row.kind.starts_with(kind));
        found.unwrap().clone()
    };
    assert_eq!(row("180").refused, [7]);
    assert!(row("180").used.is_empty());
    assert_eq!(row("158").used, [1, 5]);
    assert!(row("158").refused.is_empty());
}
