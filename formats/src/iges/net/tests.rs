use glam::DVec2;

use super::*;
use crate::iges::parameters::Delimiters;

fn read_one(record: &str) -> (Result<Vec<Surface>, Problem>, Vec<String>) {
    let mut repairs = Vec::new();
    let mut parameters = Parameters::new(record.as_bytes(), Delimiters::default(), 1);
    let result = read(&mut parameters, 1000, false, &mut repairs);
    (result, repairs.iter().map(ToString::to_string).collect())
}

/// A flat surface of degree 1 over the points (i, j, 0).
fn flat(counts: [usize; 2], knots: [&str; 2], weights: &str, tail: &str) -> String {
    let points: String = (0..counts[1])
        .flat_map(|j| (0..counts[0]).map(move |i| format!("{i}.,{j}.,0.,")))
        .collect();
    let [k1, k2] = counts.map(|c| c - 1);
    format!(
        "{k1},{k2},1,1,0,0,1,0,0,{},{},{weights},{points}{tail};",
        knots[0], knots[1]
    )
}

const UNIT: &str = "0.,0.,1.,1.";

fn one(record: &str) -> (Surface, Vec<String>) {
    let (result, repairs) = read_one(record);
    (result.unwrap().remove(0), repairs)
}

#[test]
fn u_runs_fastest() {
    let (surface, repairs) = one(&flat(
        [3, 2],
        ["0.,0.,1.,2.,2.", UNIT],
        "1,1,1,1,1,1",
        "0.,2.,0.,1.",
    ));
    assert_eq!(
        surface.evaluate(DVec2::new(1.5, 0.25)),
        DVec3::new(1.5, 0.25, 0.0)
    );
    assert_eq!(repairs, [""; 0]);
    // The range at the end may be missing.
    let (surface, repairs) = one(&flat([2, 2], [UNIT, UNIT], "1,1,1,1", ""));
    assert_eq!(repairs, [""; 0]);
    assert_eq!(surface.knots_u().domain(), 0.0..1.0);
}

#[test]
fn a_period_is_all_of_a_closed_surface() {
    let triangle = |z: f64| format!("0.,0.,{z},1.,0.,{z},0.,1.,{z},0.,0.,{z},");
    let points = triangle(0.0) + &triangle(1.0);
    let prism = |range: &str| {
        let knots = format!("0.,0.,1.,2.,3.,3.,{UNIT}");
        one(&format!(
            "3,1,1,1,1,0,1,1,0,{knots},1,1,1,1,1,1,1,1,{points}{range},0.,1.;"
        ))
    };
    let (surface, repairs) = prism("0.5,3.5");
    assert_eq!(surface.knots_u().domain(), 0.0..3.0);
    assert_eq!(repairs, [""; 0]);
    assert_eq!(prism("0.5,3.25").1.len(), 1);
}

#[test]
fn ranges_restrict() {
    let (surface, repairs) = one(&flat([2, 2], [UNIT, UNIT], "1,1,1,1", "0.25,0.5,0.,1."));
    assert_eq!(surface.knots_u().domain(), 0.25..0.5);
    assert_eq!(repairs, [""; 0]);
    // Beside a knot, nothing is left of its span.
    let knots = ["0.,0.,1.,2.,2.", UNIT];
    let range = "0.999999999999999,2.,0.,1.";
    let (surface, repairs) = one(&flat([3, 2], knots, "1,1,1,1,1,1", range));
    assert_eq!(surface.knots_u().as_slice(), [1.0, 1.0, 2.0, 2.0]);
    assert_eq!(repairs, [""; 0]);
    let (surface, repairs) = one(&flat([2, 2], [UNIT, UNIT], "1,1,1,1", "0.5,0.25,0.,7."));
    assert_eq!(surface.knots_u().domain(), 0.0..1.0);
    assert_eq!(repairs.len(), 2);
}

#[test]
fn spans_of_rounding_at_the_ends_are_dropped() {
    let (surface, repairs) = one(&flat(
        [4, 2],
        ["-1E-15,-1E-15,0.,2.,2.,2.000000000000001", UNIT],
        "1,1,1,1,1,1,1,1",
        "0.,2.,0.,1.",
    ));
    assert_eq!(surface.knots_u().as_slice(), [-1e-15, -1e-15, 2.0, 2.0]);
    let middle = surface.evaluate(DVec2::new(1.0, 0.5));
    assert!(middle.distance(DVec3::new(1.5, 0.5, 0.0)) < 1e-14);
    assert_eq!(repairs.len(), 1, "{repairs:?}");
}

#[test]
fn small_steps_back_are_levelled_and_large_ones_refused() {
    let (surface, repairs) = one(&flat(
        [3, 2],
        ["0.,0.,1.,2.,1.9999999", UNIT],
        "1,1,1,1,1,1",
        "0.,2.,0.,1.",
    ));
    assert_eq!(surface.knots_u().as_slice(), [0.0, 0.0, 1.0, 2.0, 2.0]);
    assert_eq!(repairs.len(), 1);
    let (result, _) = read_one(&flat([3, 2], ["0.,0.,1.,0.5,2.", UNIT], "1,1,1,1,1,1", ""));
    assert!(matches!(
        result,
        Err(Problem::Geometry(kernel::Error::KnotsDecrease { .. }))
    ));
}

#[test]
fn weights_that_are_not_positive_are_all_set_to_one() {
    let (surface, repairs) = one(&flat([2, 2], [UNIT, UNIT], "1,-0.3,2,1", "0.,1.,0.,1."));
    assert!(!surface.is_rational());
    assert_eq!(
        repairs,
        ["weight 1 is -0.3; weights must be positive, all are set to 1"]
    );
}

#[test]
fn surplus_knots_go_with_their_points() {
    // The first column has no influence.
    let (surface, repairs) = one(&flat(
        [3, 2],
        ["0.,0.,0.,1.,1.", UNIT],
        "1,1,1,1,1,1",
        "0.,1.,0.,1.",
    ));
    assert_eq!(surface.knots_u().as_slice(), [0.0, 0.0, 1.0, 1.0]);
    assert_eq!(surface.evaluate(DVec2::ZERO), DVec3::X);
    assert_eq!(repairs, ["u knot 0 stands 3 times; 2 are kept"]);
}

#[test]
fn torn_surfaces_are_cut() {
    let ones = "1,1,1,1,1,1,1,1";
    let (result, repairs) = read_one(&flat(
        [4, 2],
        ["0.,0.,1.,1.,2.,2.", UNIT],
        ones,
        "0.,2.,0.,1.",
    ));
    let pieces = result.unwrap();
    assert_eq!(pieces.len(), 2);
    assert_eq!(pieces[0].evaluate(DVec2::new(1.0, 0.0)), DVec3::X);
    assert_eq!(pieces[1].evaluate(DVec2::new(1.0, 0.0)), DVec3::X * 2.0);
    assert_eq!(repairs, ["it is torn at u = 1; it is cut there"]);
    // Equal rows hold it together.
    let whole = flat([4, 2], ["0.,0.,1.,1.,2.,2.", UNIT], ones, "0.,2.,0.,1.");
    let (surface, _) = one(&whole
        .replace("2.,0.,0.,3.", "1.,0.,0.,3.")
        .replace("2.,1.,0.,3.", "1.,1.,0.,3."));
    assert_eq!(surface.knots_u().count(), 3);
}

#[test]
fn counts_are_checked_before_use() {
    for record in [
        "1000000000,1000000000,3,3,0,0,1,0,0,0.;",
        "9223372036854775807,9223372036854775807,1,1,0,0,1,0,0;",
        "1,1,30,1,0,0,1,0,0,0.,0.;",
        "-1,1,1,1,0,0,1,0,0,0.,0.;",
        "",
    ] {
        assert!(
            matches!(read_one(record).0, Err(Problem::Invalid(_))),
            "{record}"
        );
    }
    let text = read_one("999999999,999999999,3,3,0,0,1,0,0,0.;")
        .0
        .unwrap_err();
    assert_eq!(
        text.to_string(),
        "4000000002000000008 knots, weights and coordinates are announced; \
         the record is too short for them"
    );
}
