//! Build and rays of several kinds, on scenes of several sizes: `cargo bench`.

mod common;

use std::hint::black_box;
use std::ops::Range;

use common::{SIZE, View, array, sample};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use nurbray::kernel::{Ray, Scene};
use nurbray::{Accelerator, Hit, METHODS, Start, Workspace};

const FOREVER: Range<f64> = 0.0..f64::INFINITY;

fn scenes() -> Vec<(&'static str, Scene)> {
    let teapot = sample("teapot.obj");
    vec![
        ("27 teapots, instanced", array(&teapot, 3, false)),
        ("1000 teapots, instanced", array(&teapot, 10, false)),
        ("1000 teapots, flattened", array(&teapot, 10, true)),
        ("100,000 patches", array(&teapot, 15, true)),
        ("trimmed can, IGES", sample("can.igs")),
        ("teapot", teapot),
    ]
}

fn trace(accelerator: &Accelerator<'_>, rays: &[Ray], starts: &[Start]) -> Vec<Option<Hit>> {
    let (mut workspace, mut hits) = (Workspace::default(), Vec::new());
    let ranges = vec![FOREVER; rays.len()];
    accelerator.nearest_leaving(rays, &ranges, starts, &mut workspace, &mut hits);
    hits
}

/// Rays that leave hits, and where they start.
type Leaving = (Vec<Ray>, Vec<Start>);

/// Rays that leave the hits towards a light, and into pseudo-random directions of the
/// cosine distribution.
fn secondary(hits: &[Option<Hit>], rays: &[Ray], diagonal: f64) -> (Leaving, Leaving) {
    let mut state = 1_u64;
    let mut number = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let light = DVec3::new(0.4, -0.5, 0.8);
    let met = hits.iter().zip(rays);
    met.filter_map(|(hit, ray)| Some((hit.as_ref()?, ray)))
        .map(|(hit, ray)| {
            let normal = hit.normal * -hit.normal.dot(ray.direction).signum();
            let origin = hit.point + normal * diagonal * 1e-9;
            let any = DVec3::new(number(), number(), number()).normalize_or_zero();
            let towards = |direction| {
                let ray = Ray { origin, direction };
                (ray, Start::of(hit, &ray))
            };
            (towards(light), towards(normal + any * 0.999))
        })
        .unzip()
}

fn all(c: &mut Criterion) {
    for (name, scene) in scenes() {
        let mut group = c.benchmark_group("build");
        group.sample_size(10);
        group.bench_function(BenchmarkId::from_parameter(name), |b| {
            b.iter(|| black_box(Accelerator::build(&scene, &METHODS[0])));
        });
        group.finish();
        let accelerator = Accelerator::build(&scene, &METHODS[0]);
        let rays = View::of(&scene).rays(SIZE, SIZE);
        let hits = trace(&accelerator, &rays, &[]);
        let ((shadow, shadow_starts), (bounce, bounce_starts)) =
            secondary(&hits, &rays, accelerator.bounds().diagonal());
        let mut measure = |kind: &str, rays: &[Ray], run: &mut dyn FnMut(&[Ray])| {
            let mut group = c.benchmark_group(kind);
            group.sample_size(10);
            group.throughput(Throughput::Elements(rays.len() as u64));
            group.bench_function(BenchmarkId::from_parameter(name), |b| b.iter(|| run(rays)));
            group.finish();
        };
        measure("coherent", &rays, &mut |rays| {
            black_box(trace(&accelerator, rays, &[]));
        });
        let (mut workspace, mut blocked) = (Workspace::default(), Vec::new());
        let ranges = vec![FOREVER; shadow.len()];
        measure("shadow", &shadow, &mut |rays| {
            let starts = &shadow_starts;
            accelerator.any_leaving(rays, &ranges, starts, &mut workspace, &mut blocked);
        });
        measure("cosine bounce", &bounce, &mut |rays| {
            black_box(trace(&accelerator, rays, &bounce_starts));
        });
        measure("cosine bounce, one by one", &bounce, &mut |rays| {
            for ray in rays {
                black_box(accelerator.nearest(ray, FOREVER, &mut workspace));
            }
        });
    }
}

criterion_group!(benches, all);
criterion_main!(benches);
