//! Times build and trace as the rivals of `make peers` do: the same teapots, the same camera.
//!
//! Arguments: folder of the shared geometry, scene (`teapot`, or `inst` or `arr` and the number
//! of teapots in a cube, each placed or each stored), width, height, runs, and the name of a set
//! of instructions where it is not to be the widest. Prints medians of milliseconds, and what was
//! hit.

#![expect(clippy::print_stdout, reason = "the result of the program")]

#[path = "../benches/common/mod.rs"]
#[expect(
    dead_code,
    reason = "shared with the benches, which have their own camera"
)]
mod common;

use std::hint::black_box;
use std::time::Instant;

use common::{View, array};
use glam::DVec3;
use nurbray::formats::{Limits, open};
use nurbray::{Accelerator, Instructions, METHODS, Workspace};
use serde_json::Value;

type Failure = Box<dyn std::error::Error>;

fn vector(value: &Value) -> Result<DVec3, Failure> {
    let number = |k: usize| {
        value[k]
            .as_f64()
            .ok_or("camera.json: three numbers are wanted")
    };
    Ok(DVec3::new(number(0)?, number(1)?, number(2)?))
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (arguments, set) = arguments.split_at(arguments.len().min(5));
    let ([folder, name, width, height, runs], [] | [_]) = (arguments, set) else {
        return Err("usage: peers FOLDER SCENE WIDTH HEIGHT RUNS [INSTRUCTIONS]".into());
    };
    let instructions = match set.first() {
        Some(set) => *(Instructions::ALL.iter())
            .find(|known| known.name() == set && known.is_available())
            .ok_or_else(|| format!("{set}: no instructions of this processor"))?,
        None => Instructions::best(),
    };
    let (width, height, runs) = (width.parse()?, height.parse()?, runs.parse::<usize>()?);
    let camera = std::fs::read_to_string(format!("{folder}/camera.json"))?;
    let camera: Value = serde_json::from_str(&camera)?;
    let half = camera["tan_half_vfov"]
        .as_f64()
        .ok_or("camera.json: no tan_half_vfov")?;
    let mut view = View {
        eye: vector(&camera["eye"])?,
        forward: vector(&camera["forward"])?,
        right: vector(&camera["right"])? * half,
        up: vector(&camera["up_ortho"])? * half,
    };
    let mut scene = open(format!("{folder}/teapot.obj"), &Limits::default())?.scene;
    // A cube of teapots; the rival's distances belong to two of them.
    let teapots: f64 = match name.trim_start_matches(char::is_alphabetic) {
        "" => 1.0,
        number => number.parse()?,
    };
    let n = (1..=50)
        .find(|n| f64::from(n * n * n) >= teapots)
        .unwrap_or(50);
    let back = match n {
        3 => 3.0,
        _ => 0.9 * f64::from(n),
    };
    if n > 1 {
        // The eye goes back until the array fits.
        let aim = vector(&camera["look_at"])?;
        view.eye = aim - view.forward * aim.distance(view.eye) * back;
        scene = array(&scene, n, name.starts_with("arr"));
    }
    let ranges = vec![0.0..f64::INFINITY; 64];
    let (mut build, mut trace, mut bytes) = (Vec::new(), Vec::new(), 0);
    let mut count = 0;
    for _ in 0..runs {
        let start = Instant::now();
        let accelerator = Accelerator::build(&scene, &METHODS[0]).with_instructions(instructions);
        build.push(start.elapsed().as_secs_f64() * 1e3);
        let start = Instant::now();
        let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
        count = 0;
        // Rays are made within the time, as the rivals do.
        view.packets(width, height, &mut |rays| {
            accelerator.nearest_many(rays, &ranges[..rays.len()], &mut workspace, &mut hits);
            count += hits.iter().filter(|hit| hit.is_some()).count();
            black_box(&hits);
        });
        trace.push(start.elapsed().as_secs_f64() * 1e3);
        bytes = accelerator.bytes();
    }
    let median = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    let (build, trace) = (median(&mut build), median(&mut trace));
    println!(
        "{name},{width},{height},{build:.3},{trace:.3},{:.3},{:.1},{count}",
        build + trace,
        bytes as f64 / f64::from(1 << 20)
    );
    Ok(())
}
