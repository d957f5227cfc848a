//! What is blanked, and what that hides.

use glam::DVec3;

use super::testing::{Made, corners, formed, made, part, read, square};

const NONE: [&str; 0] = [];

fn with_status(status: &'static str, made: Made) -> Made {
    Made { status, ..made }
}

/// Where the squares of a file land, along x, and what is told.
fn found(entities: &[Made]) -> (Vec<f64>, Vec<String>) {
    let (scene, warnings) = read(entities);
    let mut places: Vec<_> = corners(&scene).iter().map(|p| p.x).collect();
    places.sort_by(f64::total_cmp);
    (places, warnings)
}

const NOTHING_ELSE: &str = "all that could be shown is blanked; it is shown";

#[test]
fn blanked_groups_hide_their_members_unless_these_go_by_themselves() {
    let file = |status, more: &str| {
        let group = with_status(status, formed(402, 7, &format!("3,1,3,7{more}")));
        let blanked = with_status("01000000", square(3.0));
        // Line font, view, level, blank, weight, colour.
        let free = formed(406, 10, "6,0,0,0,1,0,0");
        let bound = formed(406, 10, "6,1,1,1,0,1,1");
        let others = [group, blanked, square(5.0), free, bound];
        [square(1.0), square(2.0)].into_iter().chain(others)
    };
    for (status, more, expected) in [
        ("01000000", "", vec![5.0]),
        ("01000001", "", vec![1.0, 2.0, 5.0]),
        ("01000002", "", vec![5.0]),
        ("01000002", ",0,1,11", vec![1.0, 2.0, 5.0]),
        ("01000002", ",0,1,13", vec![5.0]),
        ("00000001", "", vec![1.0, 2.0, 5.0]),
    ] {
        let (places, _) = found(&file(status, more).collect::<Vec<_>>());
        assert_eq!(places, expected, "{status}{more}");
    }
}

#[test]
fn instances_that_are_blanked_hide_what_goes_by_its_definition() {
    let file = |status| {
        let definition = with_status("00000200", made(308, "0,4Hpart,1,1"));
        let instance = with_status(status, made(408, "3,10.,0.,0.,1."));
        [part_square(), definition, instance, square(5.0)]
    };
    assert_eq!(found(&file("01000000")).0, [5.0]);
    assert_eq!(found(&file("01000001")).0, [5.0, 11.0]);
}

/// A square that is part of something.
fn part_square() -> Made {
    with_status("00010000", square(1.0))
}

#[test]
fn parts_of_bodies_that_are_blanked_are_hidden_in_any_case() {
    let shell = with_status("01000001", formed(514, 1, "1,1,1"));
    let (places, _) = found(&[part_square(), shell, square(5.0)]);
    assert_eq!(places, [5.0]);
}

#[test]
fn what_blanked_owners_hide_is_shown_where_there_is_nothing_else() {
    let group = || with_status("01000000", formed(402, 7, "2,1,3"));
    let (places, told) = found(&[square(1.0), square(2.0), group()]);
    assert_eq!(places, [1.0, 2.0]);
    let text = |place| format!("{place}: {NOTHING_ELSE}");
    assert_eq!(told, [text("line 7, group D5 (type 402)")]);
    // A line is not worth a picture without surfaces.
    let line = made(110, "0.,0.,0.,1.,0.,0.");
    let (places, told) = found(&[square(1.0), square(2.0), group(), line]);
    assert_eq!(places, [1.0, 2.0]);
    assert_eq!(told, [text("line 7, group D5 (type 402)")]);
    // Another surface is.
    let (places, told) = found(&[square(1.0), square(2.0), group(), square(3.0)]);
    assert_eq!((places, told.len()), (vec![3.0], 2), "{told:?}");
}

#[test]
fn a_definition_of_blanked_members_is_shown_where_there_is_nothing_else() {
    let file = || {
        let member = with_status("01010000", square(1.0));
        let definition = with_status("00000200", made(308, "0,4Hpart,1,1"));
        vec![member, definition, made(408, "3,10.,0.,0.,2.")]
    };
    let (places, told) = found(&file());
    assert_eq!(places, [12.0]);
    assert_eq!(
        told,
        [format!("line 3, surface D1 (type 128): {NOTHING_ELSE}")]
    );
    let mut more = file();
    more.push(square(5.0));
    assert_eq!(found(&more).0, [5.0]);
}

#[test]
fn blanked_entities_of_no_use_change_nothing() {
    // A hidden hole of nothing, beside a line: no surface is there, hidden or not.
    let hidden = with_status("01000200", square(1.0));
    let line = made(110, "0.,0.,0.,1.,0.,0.");
    let (scene, told) = read(&[hidden, line]);
    assert_eq!((scene.patches().len(), scene.wires().len()), (0, 1));
    assert!(told.iter().all(|t| !t.contains(NOTHING_ELSE)), "{told:?}");
    // Curves of trims are blanked in many files.
    let curve = with_status("01010000", part(110, 0, "0.,0.,0.,1.,0.,0."));
    let (scene, told) = read(&[square(1.0), curve]);
    assert_eq!(corners(&scene), [DVec3::X]);
    assert_eq!(told, NONE);
}

#[test]
fn a_mark_that_all_entities_have_means_nothing() {
    let marked = |x: f64| with_status("00010000", square(x));
    assert_eq!(read(&[marked(1.0), marked(3.0)]).1, NONE);
    let (scene, told) = read(&[marked(1.0), square(3.0)]);
    assert_eq!(scene.patches().len(), 2);
    let text = "line 3, surface D1 (type 128): marked as part of another entity, but none names it; \
                it is shown";
    assert_eq!(told, [text]);
}

#[test]
fn curves_that_are_marked_as_parts_are_shown_where_there_is_nothing_else() {
    let stray = || with_status("00010000", made(110, "0.,0.,0.,1.,0.,0."));
    let (scene, told) = read(&[stray()]);
    assert_eq!(scene.wires().len(), 1);
    assert_eq!(
        told,
        ["the file: there is no surface to show, only curves and points"]
    );
    let (scene, told) = read(&[stray(), square(0.0)]);
    assert_eq!((scene.wires().len(), scene.patches().len()), (0, 1));
    assert_eq!(told, NONE);
}
