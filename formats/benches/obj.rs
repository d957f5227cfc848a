//! How fast OBJ files of a million lines are read, beside `tobj`, and what memory it takes.
//!
//! `tobj` does less: it knows no free-form statements, checks no polygon for being concave, and
//! stops at the first mistake. What both do is read, triangulate and weld.
#![expect(clippy::print_stderr, reason = "a bench says what it measured")]

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nurbray_formats::{Limits, NoFiles, ReadOptions, read};

/// Lines of each file.
const LINES: usize = 1_000_000;
/// How often both readers are timed one after the other.
const PAIRS: usize = 21;

/// A wavy field of quads with normals and texture vertices.
fn polygons() -> String {
    let side = (LINES / 4).isqrt();
    let mut text = String::new();
    for k in 0..side * side {
        let (x, y) = ((k % side) as f64, (k / side) as f64);
        let z = (x * 0.05).sin() * (y * 0.07).cos();
        let (u, v) = (x / side as f64, y / side as f64);
        // Writing into a string cannot fail.
        let _ = writeln!(text, "v {x:.6} {y:.6} {z:.6}\nvt {u:.6} {v:.6}");
        let _ = writeln!(text, "vn {:.6} {:.6} {:.6}", -0.05 * u, -0.07 * v, 0.9975);
    }
    for k in (1..side * (side - 1)).filter(|k| k % side != 0) {
        let corners = [k, k + 1, k + side + 1, k + side];
        let [a, b, c, d] = corners.map(|c| format!("{c}/{c}/{c}"));
        let _ = writeln!(text, "f {a} {b} {c} {d}");
    }
    text
}

/// Bicubic patches, one in three of them rational and trimmed.
fn free_form() -> String {
    let mut text = String::from("g field\n");
    let (mut lines, mut number) = (1, 0);
    while lines < LINES {
        let (x, y) = ((number % 200) as f64, (number / 200) as f64);
        let is_trimmed = number % 3 == 0;
        for k in 0..16 {
            let (u, v) = (f64::from(k % 4) / 3.0, f64::from(k / 4) / 3.0);
            let z = (x + u).sin() * (y + v).cos();
            let _ = write!(text, "v {:.6} {:.6} {z:.6}", x + u, y + v);
            text += if is_trimmed { " 1.25\n" } else { "\n" };
        }
        if is_trimmed {
            text += "vp 0.2 0.2\nvp 0.8 0.2\nvp 0.8 0.8\nvp 0.2 0.8\ncstype bspline\ndeg 2\n\
                     curv2 -4 -3 -2 -1 -4\nparm u 0 0 0 1 2 3 3 3\nend\n";
            lines += 9;
        }
        text += if is_trimmed {
            "cstype rat bspline\n"
        } else {
            "cstype bezier\n"
        };
        text += "deg 3 3\nsurf 0 1 0 1";
        for k in (1..=16).rev() {
            let _ = write!(text, " -{k}");
        }
        text += if is_trimmed {
            "\nparm u 0 0 0 0 1 1 1 1\nparm v 0 0 0 0 1 1 1 1\nhole 0 3 -1\nend\n"
        } else {
            "\nparm u 0 1\nparm v 0 1\nend\n"
        };
        lines += if is_trimmed { 23 } else { 22 };
        number += 1;
    }
    text
}

fn ours(text: &str) -> usize {
    let limits = Limits::default();
    let options = ReadOptions {
        limits: &limits,
        resolver: &NoFiles,
    };
    let import = read(text.as_bytes(), Some("obj"), &options).expect("a good file");
    assert!(import.warnings.as_slice().is_empty());
    let scene = import.scene;
    scene.patches().len()
        + scene
            .meshes()
            .iter()
            .map(|m| m.triangles().len())
            .sum::<usize>()
}

fn tobj(text: &str) -> usize {
    let options = tobj::LoadOptions {
        single_index: true,
        triangulate: true,
        ..tobj::LoadOptions::default()
    };
    let nothing = |_: &std::path::Path| Err(tobj::LoadError::GenericFailure);
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, nothing).expect("a file");
    models.iter().map(|m| m.mesh.indices.len() / 3).sum()
}

/// Reads a text and counts what is in it.
type Reader = fn(&str) -> usize;

fn memory(name: &str, text: &str, reader: Reader) {
    let used = allocation_counter::measure(|| {
        black_box(reader(text));
    });
    let share = used.bytes_max as f64 / text.len() as f64;
    eprintln!(
        "{name}: {:.0} MB at most for {:.0} MB of text, {share:.1} bytes per byte",
        used.bytes_max as f64 / 1e6,
        text.len() as f64 / 1e6
    );
}

/// How many times as long as `tobj` we take, from runs one after the other; a machine that is
/// busy with something else slows down both.
fn ratio(text: &str) {
    let time = |reader: Reader| {
        let start = Instant::now();
        black_box(reader(text));
        start.elapsed().as_secs_f64()
    };
    let mut ratios: Vec<f64> = (0..PAIRS).map(|_| time(ours) / time(tobj)).collect();
    ratios.sort_by(f64::total_cmp);
    let [low, median, high] = [PAIRS / 4, PAIRS / 2, PAIRS - 1 - PAIRS / 4].map(|k| ratios[k]);
    eprintln!(
        "polygons, our time by that of tobj: {median:.2} (half of {PAIRS} pairs in {low:.2} .. {high:.2})"
    );
}

fn obj(c: &mut Criterion) {
    let (polygons, free_form) = (polygons(), free_form());
    assert_eq!(ours(&polygons), tobj(&polygons));
    ratio(&polygons);
    let cases: [(&str, &str, Reader); 3] = [
        ("polygons", &polygons, ours),
        ("polygons, tobj", &polygons, tobj),
        ("free-form", &free_form, ours),
    ];
    let mut group = c.benchmark_group("obj of 1,000,000 lines");
    group.sample_size(10);
    for (name, text, reader) in cases {
        memory(name, text, reader);
        group.throughput(Throughput::Bytes(text.len() as u64));
        group.bench_function(name, |b| b.iter(|| black_box(reader(text))));
    }
    group.finish();
}

criterion_group!(benches, obj);
criterion_main!(benches);
