//! Files made to exhaust a reader: all end in an error or a warning, at once.

use std::time::{Duration, Instant};

use super::testing::{self, Made, file, made, read_within, square};
use crate::{Error, Import, Limits};

/// Longest time for one file.
const PATIENCE: Duration = Duration::from_secs(1);

fn read(entities: &[Made]) -> Result<Import, Error> {
    let text = file(entities);
    let started = Instant::now();
    let result = read_within(&text, &Limits::default());
    let took = started.elapsed();
    assert!(took < PATIENCE, "{took:?}");
    result
}

/// Whether something is told of a file.
fn tells(entities: &[Made]) -> bool {
    read(entities).map_or(true, |import| !import.warnings.as_slice().is_empty())
}

#[test]
fn announced_counts_are_held_against_the_record() {
    let billion = "1000000000";
    for (kind, parameters) in [
        (102, billion.to_owned()),
        (106, format!("1,{billion},0.,1.,1.")),
        (112, format!("3,1,3,{billion},0.,1.")),
        (114, format!("3,1,{billion},{billion},0.,1.")),
        (126, format!("{billion},3,0,0,0,0,0.,1.")),
        (126, format!("3,{billion},0,0,0,0,0.,1.")),
        (128, format!("{billion},{billion},3,3,0,0,0,0,0,0.")),
        (143, format!("0,3,{billion},5")),
        (144, format!("3,1,{billion},5,7")),
        (186, format!("3,1,{billion}")),
        (402, billion.to_owned()),
        (510, format!("3,{billion},1,5")),
        (514, format!("{billion},3,1")),
        (9_223_372_036_854_775_807, "1".to_owned()),
    ] {
        assert!(
            tells(&[made(kind, &parameters), square(1.0)]),
            "{kind} {parameters}"
        );
    }
    for (kind, parameters) in [
        (141, format!("1,2,1,{billion},0,1,{billion},5")),
        (142, "0,1,99999999,0,1".to_owned()),
        (508, format!("{billion},0,5,1,1,{billion}")),
        (508, format!("1,0,5,{billion},1,0")),
    ] {
        let face = if kind == 508 {
            made(510, "1,1,1,3")
        } else {
            made(143, "1,1,1,3")
        };
        let entities = [square(1.0), made(kind, &parameters), face];
        assert!(tells(&entities), "{kind} {parameters}");
    }
}

#[test]
fn cycles_and_deep_nesting_end() {
    // A composite curve, an offset curve, surfaces and groups that contain themselves.
    assert!(tells(&[made(102, "1,1"), square(1.0)]));
    assert!(tells(&[
        made(130, "1,1,0,0,0,1.,0.,0.,0.,0.,0.,1.,0.,1."),
        square(1.0)
    ]));
    assert!(tells(&[made(140, "0.,0.,1.,1.,1"), square(1.0)]));
    assert!(tells(&[made(144, "1,0,0,0"), square(1.0)]));
    assert!(tells(&[made(402, "1,1"), square(1.0)]));
    // Each composite curve holds the next one twice.
    let mut doubling: Vec<Made> = (1..40)
        .map(|k| made(102, &format!("2,{},{}", 2 * k + 1, 2 * k + 1)))
        .collect();
    doubling.push(made(110, "0.,0.,0.,1.,0.,0."));
    doubling.push(square(1.0));
    assert!(tells(&doubling));
    // A deep chain of groups.
    let mut deep: Vec<Made> = (1..3000)
        .map(|k| made(402, &format!("1,{}", 2 * k + 1)))
        .collect();
    for group in &mut deep {
        group.form = 7;
    }
    deep.push(square(1.0));
    assert!(tells(&deep));
}

#[test]
fn wild_numbers_make_no_wild_surfaces() {
    for numbers in [
        "1.E308,-1.E308,1.E308",
        "1.E-308,0.,0.",
        "0.,0.,0.",
        "1.E200,1.E200,1.E-200",
    ] {
        let point = || made(116, numbers);
        let axis = || made(123, numbers);
        for surface in [
            made(190, "1,3"),
            made(192, "1,3,1.E300"),
            made(194, "1,3,0.,89.9999999"),
            made(196, "1,1.E300"),
            made(198, "1,3,1.E-300,1.E300"),
            made(108, &format!("{numbers},1.,0,0.,0.,0.,0.")),
            made(120, "9,9,0.,1.E300"),
            made(118, "9,9,1,0"),
            made(122, &format!("9,{numbers}")),
        ] {
            // Whatever comes of it, it comes soon.
            let line = made(110, &format!("{numbers},1.,2.,3."));
            let _ = read(&[point(), axis(), surface, square(1.0), line]);
        }
    }
}

#[test]
fn what_passes_a_fixed_bound_is_refused_and_all_else_read() {
    let nested = |count: usize, depth: usize| {
        let mut entities = vec![square(0.0), made(110, "0.,0.,0.,1.,0.,0.")];
        for _ in 0..depth {
            let inner = 2 * entities.len() - 1;
            let members = vec![inner.to_string(); count].join(",");
            entities.push(made(102, &format!("{count},{members}")));
        }
        entities
    };
    let array = "1,1.,0.,0.,0.,2000,2000,1.,1.,0.,0,0";
    for (entities, text) in [
        (nested(1, 10), "nested more than 8 deep"),
        (nested(50, 3), "more than 100000 members"),
        (
            vec![square(0.0), square(1.0), made(412, array)],
            "more than 1000000 places",
        ),
    ] {
        let (scene, warnings) = testing::read(&entities);
        assert_eq!(scene.placement_count(), 1);
        assert!(warnings[0].ends_with(text), "{warnings:?}");
    }
}

#[test]
fn joined_curves_are_held_against_the_limit() {
    // A polyline raised to degree 30.
    let line: String = (0..100).map(|k| format!(",{k}.,0.,0.")).collect();
    let zeros = ",0.".repeat(31);
    let ones = ",1.".repeat(31);
    let points: String = (0..31).map(|k| format!(",99.,{k}.,0.")).collect();
    let entities = [
        made(106, &format!("2,100{line}")),
        made(
            126,
            &format!("30,30,0,0,1,0{zeros}{ones}{ones}{points},0.,1."),
        ),
        made(102, "2,1,3"),
        made(122, "5,0.,0.,1."),
    ];
    let problem = |points: usize| {
        let limits = Limits {
            points,
            ..Limits::default()
        };
        read_within(&file(&entities), &limits).map_err(|e| e.problem.to_string())
    };
    let text = "3100 control points; the limit leaves 1000";
    assert_eq!(problem(1000).unwrap_err(), text);
    assert!(problem(10_000).is_ok());
}
