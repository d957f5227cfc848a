//! Prints the tables of docs/bodies.md: volumes of synthetic bodies by all methods, and orders of
//! convergence. `cargo run --release --example volumes`
#![allow(clippy::print_stdout, reason = "that is all it does")]

use nurbray::formats::{Error, PointSet};
use nurbray::kernel::modelling::{Along, Spacing, Twist};
use nurbray::kernel::{Scene, VolumeRule};
use nurbray::{
    Caps, Measure, ModelMethod, ModelOptions, SliceRule, Synthetic, VolumeMethod, measure, model,
    synthetic, volumes,
};

const KINDS: [(&str, Synthetic); 3] = [
    ("sphere", Synthetic::Sphere),
    ("skull", Synthetic::Skull),
    ("pathology", Synthetic::Pathology),
];

fn along(degree: usize, is_closed: bool) -> Along {
    Along {
        degree,
        is_closed,
        spacing: Spacing::ChordLength,
    }
}

/// A body of so many layers and points, its true volume, and what is measured of it.
fn body(
    kind: Synthetic,
    layers: usize,
    points: usize,
    method: ModelMethod,
) -> Result<(Scene, f64, Measure), Error> {
    let (body, volume) = synthetic(kind, 1, layers, points);
    let set = PointSet {
        bodies: vec![body],
        ..PointSet::default()
    };
    let options = ModelOptions {
        method,
        closed: [true, false],
        caps: Caps::Flat,
        split: false,
        repair: false,
    };
    let scene = model(&set, &options)?.scene;
    let found = measure(&scene);
    Ok((scene, volume, found))
}

/// The body as Table 6 has it: a B-spline surface, measured by all methods.
fn methods() -> Result<(), Box<dyn std::error::Error>> {
    println!("| volume | sphere | skull | pathology |");
    println!("|---|---|---|---|");
    let cubic = ModelMethod::Interpolate([along(3, true), along(3, false)]);
    let methods = [
        ("gauss", None),
        ("formula", Some(VolumeMethod::Pieces(VolumeRule::Formula))),
        (
            "midpoint 10 x 10",
            Some(VolumeMethod::Pieces(VolumeRule::Midpoint(10))),
        ),
        (
            "midpoint 100 x 100",
            Some(VolumeMethod::Pieces(VolumeRule::Midpoint(100))),
        ),
        (
            "printed 10 x 10",
            Some(VolumeMethod::Pieces(VolumeRule::Printed(10))),
        ),
        (
            "printed 100 x 100",
            Some(VolumeMethod::Pieces(VolumeRule::Printed(100))),
        ),
        (
            "trapezoid, 12 slabs",
            Some(VolumeMethod::Slices(SliceRule::Trapezoid, 12)),
        ),
        (
            "cavalieri, 12 slabs",
            Some(VolumeMethod::Slices(SliceRule::Cavalieri, 12)),
        ),
    ];
    let mut bodies = Vec::new();
    for (_, kind) in KINDS {
        let (scene, _, found) = body(kind, 13, 40, cubic)?;
        bodies.push((scene, found));
    }
    for (name, method) in methods {
        print!("| {name} |");
        for (scene, found) in &bodies {
            let [body] = found.bodies.as_slice() else {
                print!(" no body |");
                continue;
            };
            let exact = body.volume;
            match method {
                None => print!(" {exact:.4} |"),
                Some(method) => {
                    let volume = volumes(scene, &found.bodies, method)?[0];
                    print!(
                        " {volume:.4} ({:.2e} %) |",
                        (volume / exact - 1.0).abs() * 100.0
                    );
                }
            }
        }
        println!();
    }
    Ok(())
}

/// How rules over pieces converge to the volume of one surface.
fn rules() -> Result<(), Box<dyn std::error::Error>> {
    let cubic = ModelMethod::Interpolate([along(3, true), along(3, false)]);
    let (scene, _, found) = body(Synthetic::Pathology, 13, 40, cubic)?;
    println!("| nodes | midpoint | order | printed | order |");
    println!("|---|---|---|---|---|");
    let mut before: Option<[f64; 2]> = None;
    for nodes in [5, 10, 20, 40, 80] {
        let mut errors = [0.0; 2];
        let rules = [VolumeRule::Midpoint(nodes), VolumeRule::Printed(nodes)];
        for (error, rule) in errors.iter_mut().zip(rules) {
            let volume = volumes(&scene, &found.bodies, VolumeMethod::Pieces(rule))?;
            *error = (volume[0] / found.bodies[0].volume - 1.0).abs();
        }
        let orders = before.map(|before| [0, 1].map(|k| (before[k] / errors[k]).log2()));
        print!("| {nodes} |");
        for k in 0..2 {
            let order = orders.map_or(String::new(), |orders| format!("{:.2}", orders[k]));
            print!(" {:.2e} | {order} |", errors[k]);
        }
        println!();
        before = Some(errors);
    }
    Ok(())
}

/// How surfaces of more and more points converge to the body.
fn surfaces() -> Result<(), Box<dyn std::error::Error>> {
    let methods = [
        ("coons", ModelMethod::Coons(Twist::Catmull)),
        (
            "interpolate, degree 3",
            ModelMethod::Interpolate([along(3, true), along(3, false)]),
        ),
        (
            "interpolate, degree 5",
            ModelMethod::Interpolate([along(5, true), along(5, false)]),
        ),
        ("loft", ModelMethod::Loft),
        ("contours", ModelMethod::Contours),
    ];
    for (name, kind) in KINDS {
        println!(
            "\n| {name}: layers x points | {} |",
            methods.map(|m| m.0).join(" | order | ")
        );
        println!("|---|{}", "---|".repeat(2 * methods.len() - 1));
        let mut before = [None; 5];
        for (layers, points) in [(7, 24), (13, 48), (25, 96), (49, 192)] {
            print!("| {layers} x {points} |");
            for (k, (_, method)) in methods.into_iter().enumerate() {
                let (_, volume, found) = body(kind, layers, points, method)?;
                let error = found
                    .bodies
                    .first()
                    .map(|body| (body.volume / volume - 1.0).abs());
                let order = before[k]
                    .zip(error)
                    .map(|(before, now): (f64, f64)| (before / now).log2());
                let show =
                    |x: Option<f64>, text: &dyn Fn(f64) -> String| x.map_or(String::new(), text);
                print!(" {} |", show(error, &|x| format!("{x:.2e}")));
                print!(" {} |", show(order, &|x| format!("{x:.2}")));
                before[k] = error;
            }
            println!();
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    methods()?;
    println!();
    rules()?;
    surfaces()
}
