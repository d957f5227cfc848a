use super::*;
use crate::KnotVector;

fn line(from: [f64; 2], to: [f64; 2]) -> Curve<DVec2> {
    Curve::line(from.into(), to.into(), 2.0..5.0).unwrap()
}

fn assert_closed(trim: &TrimLoop) {
    let segments = trim.segments();
    let next = segments.iter().cycle().skip(1);
    for (segment, next) in segments.iter().zip(next) {
        assert_eq!(segment.end(), next.start());
    }
}

#[test]
fn curves_that_meet_stay_as_they_are() {
    let corners = [[0.1, 0.2], [0.7, 0.3], [0.3, 0.9]];
    let sides = [0, 1, 2].map(|i| line(corners[i], corners[(i + 1) % 3]));
    let trim = TrimLoop::new(sides.to_vec(), 0.0).unwrap();
    assert_eq!(trim.segments(), sides);
    assert_closed(&trim);
}

#[test]
fn small_gaps_are_bridged_to_the_last_bit() {
    let sides = vec![
        line([0.0, 0.0], [1.0, 1e-9]),
        line([1.0, 0.0], [0.3, 0.7]),
        line([0.3, 0.7 + 1e-9], [1e-10, 1e-10]),
    ];
    let trim = TrimLoop::new(sides, 1e-8).unwrap();
    assert_eq!(trim.segments().len(), 6);
    assert_closed(&trim);
}

/// What is said about loops in the unit square.
fn inside(loops: &[TrimLoop], closed: [bool; 2]) -> Result<(), Error> {
    TrimLoop::check_inside(loops, &(0.0..1.0), &(0.0..1.0), closed)
}

#[test]
fn loops_outside_are_told_unless_the_surface_is_closed_there() {
    let square = |u: Range<f64>, v: Range<f64>| TrimLoop::border(&u, &v).unwrap();
    let beside = [square(2.0..2.5, 0.25..0.75), square(3.0..4.0, -1.0..0.5)];
    let outside = Error::LoopsOutside {
        found: [[2.0, -1.0], [4.0, 0.75]],
        domain: [[0.0, 0.0], [1.0, 1.0]],
    };
    assert_eq!(inside(&beside, [false; 2]), Err(outside));
    assert_eq!(inside(&beside, [true, false]), Ok(()));
    // Next to the domain, and around a corner of it.
    for loops in [square(1.0..2.0, 0.0..1.0), square(-1.0..0.0, -1.0..0.0)] {
        let told = inside(&[loops], [false; 2]);
        assert!(matches!(told, Err(Error::LoopsOutside { .. })), "{told:?}");
    }
    // What reaches over the domain is not outside; a hole of the same size leaves nothing.
    let over = square(-1.0..2.0, -1.0..2.0);
    let corner = square(0.5..2.0, -1.0..0.5);
    for loops in [
        &[over.clone()][..],
        &[corner],
        &[beside[0].clone(), over.clone()],
    ] {
        assert_eq!(inside(loops, [false; 2]), Ok(()));
    }
    let larger = square(-2.0..3.0, -2.0..3.0);
    assert_eq!(
        inside(&[over, larger], [false; 2]),
        Err(Error::NothingInside)
    );
}

#[test]
fn loops_with_nothing_inside_are_told() {
    let along = [[0.3, 0.1], [0.6, 0.9]];
    let there_and_back = vec![line(along[0], along[1]), line(along[1], along[0])];
    let flat = TrimLoop::new(there_and_back, 0.0).unwrap();
    let check = |loops: &[TrimLoop]| inside(loops, [false; 2]);
    assert_eq!(check(&[]), Ok(()));
    assert_eq!(
        check(std::slice::from_ref(&flat)),
        Err(Error::NothingInside)
    );
    let border = TrimLoop::border(&(0.0..1.0), &(0.0..1.0)).unwrap();
    assert_eq!(check(&[flat, border]), Ok(()));
    // Around the whole domain twice.
    let corners = [0.0, 1.0]
        .map(|u| [[u, 0.0], [u, 1.0]])
        .as_flattened()
        .to_vec();
    let around = [0, 2, 3, 1, 0, 2, 3, 1, 0].map(|k| corners[k]);
    let sides = around.windows(2).map(|w| line(w[0], w[1]));
    let twice = TrimLoop::new(sides.collect(), 0.0).unwrap();
    assert_eq!(check(&[twice]), Err(Error::NothingInside));
    // The halves of an eight have no area together.
    let corners = [[0.2, 0.2], [0.8, 0.8], [0.8, 0.2], [0.2, 0.8]];
    let sides = [0, 1, 2, 3].map(|i| line(corners[i], corners[(i + 1) % 4]));
    let eight = TrimLoop::new(sides.to_vec(), 0.0).unwrap();
    assert!(eight.signed_area().abs() < 1e-15);
    assert_eq!(check(&[eight]), Ok(()));
}

#[test]
fn one_closed_curve_is_a_loop() {
    let knots = KnotVector::clamped_uniform(2, 5, 0.0..1.0).unwrap();
    let points = [[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9], [0.1, 0.1]];
    let weights = [0.3, 1.0, 2.0, 1.0, 0.7];
    let closed = Curve::new(knots, &points.map(DVec2::from), Some(&weights)).unwrap();
    let trim = TrimLoop::new(vec![closed], 1e-12).unwrap();
    assert_closed(&trim);
}

#[test]
fn large_gaps_are_refused() {
    let sides = vec![line([0.0, 0.0], [1.0, 0.0]), line([1.0, 0.5], [0.0, 0.0])];
    let refused = Error::LoopGap {
        index: 0,
        gap: 0.5,
        allowed: 0.1,
    };
    assert_eq!(TrimLoop::new(sides.clone(), 0.1), Err(refused));
    for tolerance in [f64::NAN, -1.0] {
        let refused = TrimLoop::new(sides.clone(), tolerance);
        assert!(matches!(refused, Err(Error::LoopGap { index: 0, .. })));
    }
    assert_eq!(TrimLoop::new(Vec::new(), 1.0), Err(Error::EmptyLoop));
    let nowhere = Curve::line(DVec2::NAN, DVec2::ONE, 0.0..1.0);
    assert_eq!(nowhere, Err(Error::NotFinite { index: 0 }));
}

#[test]
fn loops_are_clipped_to_a_range() {
    let square = TrimLoop::border(&(-10.0..10.0), &(-10.0..10.0)).unwrap();
    let [strip] = &square.clipped(0, 0.0..1.0).unwrap()[..] else {
        panic!("one strip");
    };
    assert!((strip.signed_area() - 20.0).abs() < 1e-12);
    let cells = strip.clipped(1, 2.0..5.0).unwrap();
    assert_eq!(cells.len(), 1);
    assert!((cells[0].signed_area() - 3.0).abs() < 1e-12);
    assert_closed(&cells[0]);
    assert_eq!(cells[0].clipped(1, 2.0..5.0).unwrap(), cells);
    assert_eq!(square.clipped(1, 11.0..12.0).unwrap(), []);
}

#[test]
fn loops_that_leave_a_range_twice_become_two() {
    // A comb of three teeth on a back: each tooth above the line is a loop of its own.
    let mut corners = vec![DVec2::new(7.0, -1.0), DVec2::new(0.0, -1.0)];
    for tooth in [0.0, 2.0, 4.0] {
        corners.extend(
            [[0.0, 1.0], [1.0, 1.0], [1.0, -0.5], [2.0, -0.5]]
                .map(|[x, y]| DVec2::new(tooth + x, y)),
        );
    }
    corners.push(DVec2::new(7.0, -0.5));
    let sides = corners
        .windows(2)
        .map(|w| Curve::line(w[0], w[1], 0.0..1.0).unwrap());
    let trim = TrimLoop::new(sides.collect(), f64::INFINITY).unwrap();
    let teeth = trim.clipped(1, 0.0..2.0).unwrap();
    assert_eq!(teeth.len(), 3);
    for tooth in &teeth {
        assert_closed(tooth);
        assert!((tooth.signed_area().abs() - 1.0).abs() < 1e-12);
    }
    let [back] = &trim.clipped(1, -2.0..0.0).unwrap()[..] else {
        panic!("one back");
    };
    assert_closed(back);
    assert!((back.signed_area().abs() - (7.0 * 0.5 + 3.0 * 0.5)).abs() < 1e-12);
}

#[test]
fn what_is_clipped_is_not_clipped_again() {
    // The loop leaves the range by little more than rounding.
    let corners = [[0.3, -2e-9], [1.0, 0.2], [0.0, 0.4], [0.3, -2e-9]].map(DVec2::from);
    let sides = vec![Curve::polyline(&corners).unwrap()];
    let trim = TrimLoop::new(sides, 0.0).unwrap();
    let clipped = trim.clipped(1, 0.0..1.0).unwrap();
    assert_eq!(clipped.len(), 1);
    assert_closed(&clipped[0]);
    let points = clipped[0].segments().iter().flat_map(Curve::points);
    assert!(points.into_iter().all(|p| p.y >= 0.0));
    assert_eq!(trim.clipped(1, -1.0..0.0).unwrap(), []);
}

#[test]
fn roots_are_found_also_in_the_middle() {
    for (polynomial, root) in [
        (vec![-1.0, 1.0], Some(0.5)),
        (vec![-1.0, 3.0], Some(0.25)),
        (vec![-3.0, -1.0, 1.0, 3.0], Some(0.5)),
        (vec![0.0, 0.0], None),
    ] {
        let mut found = Vec::new();
        monotone::roots(polynomial, &mut found);
        assert_eq!(found.len(), usize::from(root.is_some()));
        let mut pairs = found.iter().zip(root);
        assert!(
            pairs.all(|(found, root)| (found - root).abs() < 1e-15),
            "{found:?}"
        );
    }
}
