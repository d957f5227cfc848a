//! Pictures of surfaces and mesh from one camera, in one light, and what differs in them.

use std::time::{Duration, Instant};

use glam::{DVec2, DVec3};
use kernel::{Camera, Child, Item, MaterialId, Node, Projection, Scene, Shape};
use rayon::prelude::*;

use super::deviation::Worst;
use super::draw;
use super::exact::Exact;
use super::images::{flip_map, psnr, psnr_linear, ssim};
use super::soup::{Smooth, Soup};
use crate::accelerator::{Accelerator, Workspace};
use crate::film::{Film, Picture};
use crate::intersect::METHODS;
use crate::render::{Eye, FilmRays, RenderOptions, render};

/// Rays along the side of a pixel where silhouettes are compared finely.
const FINE: u32 = 4;

/// The size of a zoomed crop, unless the pictures are smaller.
const CROP: (u32, u32) = (400, 300);

/// A crop shows this many times the deviation, but at least and at most these shares of the
/// size of the scene.
const ZOOM: f64 = 24.0;
const ZOOMED: [f64; 2] = [4e-3, 0.25];

/// Crops of one mesh.
const CROPS: usize = 4;

/// How pictures are taken.
#[derive(Clone, Debug)]
pub struct View {
    /// The camera; `None` frames the surfaces.
    pub camera: Option<Camera>,
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// `samples x samples` rays per pixel.
    pub samples: u32,
    /// Linear colour behind everything.
    pub background: DVec3,
}

/// The surfaces, ready to be seen, and their picture.
pub(crate) struct Stage<'a> {
    pub(crate) scene: &'a Scene,
    accelerator: Accelerator<'a>,
    camera: Camera,
    view: &'a View,
    pub(crate) film: Film,
    pub(crate) picture: Picture,
    /// Time to prepare the surfaces, and to render them.
    pub(crate) build: Duration,
    pub(crate) render: Duration,
}

impl<'a> Stage<'a> {
    pub(crate) fn new(scene: &'a Scene, view: &'a View) -> Self {
        let started = Instant::now();
        let accelerator = Accelerator::build(scene, &METHODS[0]);
        let build = started.elapsed();
        let aspect = f64::from(view.width) / f64::from(view.height);
        let camera = view.camera.clone().unwrap_or_else(|| {
            Camera::framing(&accelerator.outline(), scene.up.direction(), aspect)
        });
        let started = Instant::now();
        let film = shoot(&accelerator, &camera, view);
        let render = started.elapsed();
        Self {
            scene,
            accelerator,
            camera,
            view,
            picture: Picture::of(&film),
            film,
            build,
            render,
        }
    }

    fn size(&self) -> DVec2 {
        DVec2::new(f64::from(self.view.width), f64::from(self.view.height))
    }
}

fn shoot(accelerator: &Accelerator<'_>, camera: &Camera, view: &View) -> Film {
    let options = RenderOptions {
        width: view.width,
        height: view.height,
        samples: view.samples,
        ..RenderOptions::default()
    };
    render(accelerator, camera, &options, &|_| {})
        .0
        .over(view.background)
}

/// How pictures of a mesh differ from those of the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageDifference {
    /// Pixels whose middle one side covers and the other does not.
    pub silhouette_pixels: usize,
    /// The same for any of 16 places in the pixel.
    pub silhouette_pixels_16: usize,
    /// How far such a pixel is from the outline of the surfaces at most, in pixels.
    pub silhouette_distance: f64,
    /// The largest difference of depth where both are seen, in units of the scene, and what
    /// 99 % of the pixels do not exceed; `None` if no pixel shows both.
    pub depth: Option<[f64; 2]>,
    /// The same of the distance between the points.
    pub position: Option<[f64; 2]>,
    /// PSNR of the sRGB values, in decibels.
    pub psnr: f64,
    /// PSNR of linear light, in decibels.
    pub psnr_linear: f64,
    /// Mean structural similarity.
    pub ssim: f64,
    /// Mean of FLIP.
    pub flip: f64,
}

/// Pictures of a mesh beside the surfaces.
pub(crate) struct Views {
    pub(crate) film: Film,
    pub(crate) smooth: Picture,
    pub(crate) flat: Picture,
    pub(crate) wire: Picture,
    pub(crate) difference: Picture,
    pub(crate) flip: Picture,
    pub(crate) heat: Picture,
    pub(crate) silhouette: Picture,
    /// The distance of every pixel of the surfaces from the mesh; negative where there is none.
    pub(crate) distances: Vec<f32>,
    pub(crate) crops: Vec<Crop>,
    pub(crate) result: ImageDifference,
    pub(crate) build: Duration,
    pub(crate) render: Duration,
}

/// A place seen from near by.
pub(crate) struct Crop {
    pub(crate) exact: Picture,
    pub(crate) mesh: Picture,
    /// What the width of the picture is in units of the scene.
    pub(crate) extent: f64,
}

/// For every triangle the number of the material of the surface that it is nearest to, counted
/// from one; zero for none.
fn materials(scene: &Scene, exact: &Exact<'_>, soup: &Soup) -> Vec<usize> {
    let placements = scene.placements();
    let faces = placements
        .iter()
        .filter(|at| matches!(at.shape, Shape::Patch(_)));
    let faces: Vec<usize> = faces
        .map(|at| at.material.map_or(0, |material| material.index() + 1))
        .collect();
    if faces.iter().all(|face| *face == faces[0]) {
        let group = faces.first().copied().unwrap_or(0);
        return vec![group; soup.triangles.len()];
    }
    let group = |[a, b, c]: &[DVec3; 3]| {
        let nearest = exact.nearest_triangle((*a + *b + *c) / 3.0);
        nearest.map_or(0, |k| faces[exact.face_of(k) as usize])
    };
    soup.tree.corners().par_iter().map(group).collect()
}

/// The same triangles as a scene with the lights of another one, and with its materials by their
/// numbers `groups`.
fn scene_of(scene: &Scene, soup: &Soup, groups: &[usize], smooth: Smooth) -> Scene {
    let mut made = Scene::default();
    made.lights.clone_from(&scene.lights);
    made.headlight = scene.headlight;
    let ids: Vec<MaterialId> = scene
        .materials()
        .iter()
        .cloned()
        .map(|m| made.add_material(m))
        .collect();
    let mut root = Node::default();
    for (group, mut mesh) in soup.meshes(groups, smooth) {
        mesh.material = group.checked_sub(1).map(|k| ids[k]);
        let mesh = made.add_mesh(mesh).expect("the material was added before");
        let (shape, material) = (Shape::Mesh(mesh), None);
        root.children.push(Child::Item(Item { shape, material }));
    }
    let root = made.add_node(root).expect("the meshes were added before");
    made.set_root(root).expect("it was added before");
    made
}

/// Takes all pictures of a mesh.
pub(crate) fn take(
    stage: &Stage<'_>,
    exact: &Exact<'_>,
    soup: &Soup,
    worst: &[Worst],
    largest: f64,
) -> Views {
    let groups = materials(stage.scene, exact, soup);
    let smooth_scene = scene_of(stage.scene, soup, &groups, Smooth::Yes);
    let flat_scene = scene_of(stage.scene, soup, &groups, Smooth::No);
    let started = Instant::now();
    let accelerator = Accelerator::build(&smooth_scene, &METHODS[0]);
    let build = started.elapsed();
    let started = Instant::now();
    let film = shoot(&accelerator, &stage.camera, stage.view);
    let render = started.elapsed();
    let smooth = Picture::of(&film);
    // What takes one thread runs beside what takes all.
    let (flat, (map, result, silhouette)) = rayon::join(
        || {
            let flat = Accelerator::build(&flat_scene, &METHODS[0]);
            Picture::of(&shoot(&flat, &stage.camera, stage.view))
        },
        || {
            let map = flip_map(&stage.picture, &smooth);
            let (silhouette, silhouettes) = silhouettes(stage, &accelerator, &film);
            let (depth, position) = geometry(&stage.film, &film);
            let result = ImageDifference {
                depth,
                position,
                psnr: psnr(&stage.picture, &smooth),
                psnr_linear: psnr_linear(&stage.picture, &smooth),
                ssim: ssim(&stage.picture, &smooth),
                flip: map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len() as f64,
                ..silhouettes
            };
            (map, result, silhouette)
        },
    );
    let (heat, distances) = heat(stage, soup, largest);
    let crops = worst.par_iter().take(CROPS);
    let crops = crops
        .map(|place| crop(stage, exact, &accelerator, soup, place))
        .collect();
    Views {
        wire: wire(stage, &smooth, &film, soup),
        difference: difference(&stage.picture, &smooth),
        flip: mapped(&smooth, map.iter().map(|v| draw::color(*v))),
        smooth,
        flat,
        heat,
        silhouette,
        distances,
        crops,
        result,
        film,
        build,
        render,
    }
}

fn mapped(like: &Picture, pixels: impl Iterator<Item = [f32; 3]>) -> Picture {
    let made = Picture::new(like.width(), like.height(), pixels.collect());
    made.expect("one pixel for each of a picture")
}

/// Four times the difference of two pictures, on black.
fn difference(a: &Picture, b: &Picture) -> Picture {
    let pairs = a.pixels().iter().zip(b.pixels());
    let pixel =
        |(a, b): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|c| (4.0 * (a[c] - b[c]).abs()).min(1.0));
    mapped(a, pairs.map(pixel))
}

/// The edges of the triangles over the picture of the mesh.
fn wire(stage: &Stage<'_>, smooth: &Picture, film: &Film, soup: &Soup) -> Picture {
    let mut sides: Vec<[u32; 2]> = soup
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    sides.sort_unstable();
    sides.dedup();
    let segments: Vec<_> = sides
        .iter()
        .map(|s| s.map(|k| soup.points[k as usize]))
        .collect();
    let depths: Vec<f32> = film.data().iter().map(|d| d.depth).collect();
    let mut picture = smooth.clone();
    let eye = Eye::new(&stage.camera, picture.width(), picture.height());
    draw::lines(&mut picture, &eye, &depths, &segments, [0.05, 0.1, 0.2]);
    picture
}

/// The distance of every visible point of the surfaces from the mesh, as colours.
fn heat(stage: &Stage<'_>, soup: &Soup, largest: f64) -> (Picture, Vec<f32>) {
    let data = stage.film.data();
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a channel is single precision"
    )]
    let distance = |d: &crate::film::PixelData| {
        let point = DVec3::from(d.position.map(f64::from));
        let is_seen = d.shape >= 0.0;
        let found = is_seen.then(|| soup.tree.nearest(point)).flatten();
        found.map_or(-1.0, |found| found.distance as f32)
    };
    let distances: Vec<f32> = data.par_iter().map(distance).collect();
    let forward = stage.camera.forward().as_vec3();
    #[expect(
        clippy::cast_possible_truncation,
        reason = "colours are single precision"
    )]
    let scale = if largest > 0.0 {
        (1.0 / largest) as f32
    } else {
        0.0
    };
    let pixel = |(distance, d): (&f32, &crate::film::PixelData)| {
        if *distance < 0.0 {
            return [0.95; 3];
        }
        // A little shade shows the shape.
        let shade = 0.6 + 0.4 * glam::Vec3::from(d.normal).dot(forward).abs();
        draw::color(distance * scale).map(|c| c * shade)
    };
    let mut picture = mapped(&stage.picture, distances.iter().zip(data).map(pixel));
    draw::legend(&mut picture, largest);
    (picture, distances)
}

/// Largest and 99 % of the differences of depth and of position, where both are seen.
fn geometry(exact: &Film, mesh: &Film) -> (Option<[f64; 2]>, Option<[f64; 2]>) {
    let pairs = || {
        let both = exact.data().iter().zip(mesh.data());
        both.filter(|(a, b)| a.shape >= 0.0 && b.shape >= 0.0)
    };
    let extremes = |values: Vec<f64>| {
        let mut values = values;
        values.sort_by(f64::total_cmp);
        let most = *values.last()?;
        Some([most, values[values.len() * 99 / 100]])
    };
    let depths = pairs().map(|(a, b)| (f64::from(a.depth) - f64::from(b.depth)).abs());
    let point = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let ways = pairs().map(|(a, b)| point(a.position).distance(point(b.position)));
    (extremes(depths.collect()), extremes(ways.collect()))
}

/// What one side covers and the other does not.
fn silhouettes(
    stage: &Stage<'_>,
    mesh: &Accelerator<'_>,
    film: &Film,
) -> (Picture, ImageDifference) {
    let (width, height) = (stage.picture.width(), stage.picture.height());
    let covered =
        |film: &Film| -> Vec<bool> { film.data().iter().map(|d| d.shape >= 0.0).collect() };
    let (own, other) = (covered(&stage.film), covered(film));
    let edges = |mask: &[bool]| -> Vec<bool> {
        let differs = |k: usize| {
            let (x, y) = (k % width, k / width);
            (x + 1 < width && mask[k] != mask[k + 1])
                || (x > 0 && mask[k] != mask[k - 1])
                || (y + 1 < height && mask[k] != mask[k + width])
                || (y > 0 && mask[k] != mask[k - width])
        };
        (0..mask.len()).map(differs).collect()
    };
    let (own_edges, other_edges) = (edges(&own), edges(&other));
    let away = distances_to(&own_edges, width);
    let differing: Vec<usize> = (0..own.len()).filter(|&k| own[k] != other[k]).collect();
    let distance = differing.iter().map(|&k| away[k]).fold(0.0, f64::max);
    // Pixels that may be partly covered are looked at again.
    let unsure: Vec<usize> = (0..own.len())
        .filter(|&k| own_edges[k] || other_edges[k] || own[k] != other[k])
        .collect();
    let film = FilmRays::new(&stage.camera, stage.size());
    let fine = |k: &usize| {
        let corner = DVec2::new((k % width) as f64, (k / width) as f64);
        let rays: Vec<_> = (0..FINE * FINE)
            .map(|j| {
                let within = DVec2::new(f64::from(j % FINE), f64::from(j / FINE)) + 0.5;
                film.through(corner + within / f64::from(FINE))
            })
            .collect();
        let ranges = vec![0.0..f64::INFINITY; rays.len()];
        let mut workspace = Workspace::default();
        let (mut a, mut b) = (Vec::new(), Vec::new());
        stage
            .accelerator
            .any_many(&rays, &ranges, &mut workspace, &mut a);
        mesh.any_many(&rays, &ranges, &mut workspace, &mut b);
        a != b
    };
    let count = unsure.par_iter().filter(|k| fine(k)).count();
    let pixel = |k: usize| {
        let [r, g, b] = stage.picture.pixels()[k].map(|c| 0.7 + 0.25 * c);
        match (own[k], other[k]) {
            (true, false) => [0.1, 0.3, 0.95],
            (false, true) => [0.9, 0.1, 0.1],
            _ if own_edges[k] && own[k] => [0.15; 3],
            _ => [r, g, b],
        }
    };
    let result = ImageDifference {
        silhouette_pixels: differing.len(),
        silhouette_pixels_16: count,
        silhouette_distance: distance,
        ..ImageDifference::default()
    };
    (mapped(&stage.picture, (0..own.len()).map(pixel)), result)
}

/// For every pixel how far it is from the nearest one that is marked \[Felzenszwalb 12\];
/// infinite if none is.
fn distances_to(marked: &[bool], width: usize) -> Vec<f64> {
    let mut squares: Vec<f64> = marked
        .iter()
        .map(|&m| if m { 0.0 } else { f64::INFINITY })
        .collect();
    let height = marked.len() / width;
    let mut line = Vec::new();
    for x in 0..width {
        line.clear();
        line.extend((0..height).map(|y| squares[y * width + x]));
        for (y, value) in lower_envelope(&line).into_iter().enumerate() {
            squares[y * width + x] = value;
        }
    }
    for row in squares.chunks_mut(width) {
        let found = lower_envelope(row);
        row.copy_from_slice(&found);
    }
    squares.into_iter().map(f64::sqrt).collect()
}

/// The least of `values[j] + (i - j)^2` for every `i`.
fn lower_envelope(values: &[f64]) -> Vec<f64> {
    // Parabolas that are lowest somewhere, and from where on.
    let mut lowest: Vec<(usize, f64)> = Vec::new();
    for (j, value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let high = value + (j * j) as f64;
        let mut from = f64::NEG_INFINITY;
        while let Some(&(k, start)) = lowest.last() {
            let other = values[k] + (k * k) as f64;
            from = (high - other) / (2.0 * (j - k) as f64);
            if from > start {
                break;
            }
            lowest.pop();
            from = f64::NEG_INFINITY;
        }
        lowest.push((j, from));
    }
    let mut at = 0;
    let value = |i: usize| {
        while at + 1 < lowest.len() && lowest[at + 1].1 <= i as f64 {
            at += 1;
        }
        match lowest.get(at) {
            Some(&(j, _)) => values[j] + (i as f64 - j as f64).powi(2),
            None => f64::INFINITY,
        }
    };
    (0..values.len()).map(value).collect()
}

/// A place from near by, across the surface, where a deviation shows as an outline.
fn crop(
    stage: &Stage<'_>,
    exact: &Exact<'_>,
    mesh: &Accelerator<'_>,
    soup: &Soup,
    place: &Worst,
) -> Crop {
    let size = exact.bounds().diagonal();
    let extent = (ZOOM * place.distance).clamp(ZOOMED[0] * size, ZOOMED[1] * size);
    let patch = &exact.faces[place.patch as usize].patch;
    let normal = patch.surface.normal(place.uv).unwrap_or(DVec3::Z);
    // From the side on which the camera of the other pictures is.
    let towards = stage.camera.eye() - place.from;
    let normal = if normal.dot(towards) < 0.0 {
        -normal
    } else {
        normal
    };
    let across =
        (towards - normal * towards.dot(normal)).normalize_or(normal.any_orthonormal_vector());
    let eye = place.from + (normal * 0.55 + across).normalize() * extent;
    let (width, height) = (CROP.0.min(stage.view.width), CROP.1.min(stage.view.height));
    let projection = Projection::Orthographic {
        extent: extent * f64::from(height) / f64::from(width),
    };
    let camera = Camera::look_at(eye, place.from, normal, projection);
    let camera = camera.unwrap_or_else(|| stage.camera.clone());
    let view = View {
        width,
        height,
        ..stage.view.clone()
    };
    let film = shoot(mesh, &camera, &view);
    let mut picture = Picture::of(&film);
    let depths: Vec<f32> = film.data().iter().map(|d| d.depth).collect();
    let mut segments = Vec::new();
    soup.tree.within(place.from, 2.0 * extent, |found| {
        let [a, b, c] = soup.corners(found.triangle as usize);
        segments.extend([[a, b], [b, c], [c, a]]);
    });
    let seen = Eye::new(&camera, picture.width(), picture.height());
    draw::lines(&mut picture, &seen, &depths, &segments, [0.05, 0.1, 0.2]);
    Crop {
        exact: Picture::of(&shoot(&stage.accelerator, &camera, &view)),
        mesh: picture,
        extent,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_to_the_nearest_mark() {
        let (width, height) = (13, 9);
        let marks = [(2_usize, 3_usize), (11, 8), (7, 0)];
        let mut marked = vec![false; width * height];
        marks
            .iter()
            .for_each(|&(x, y)| marked[y * width + x] = true);
        for (k, found) in distances_to(&marked, width).into_iter().enumerate() {
            let away = |&(x, y): &(usize, usize)| {
                (x as f64 - (k % width) as f64).hypot(y as f64 - (k / width) as f64)
            };
            let least = marks.iter().map(away).fold(f64::INFINITY, f64::min);
            assert!((found - least).abs() < 1e-12, "{k}: {found} for {least}");
        }
        assert!(distances_to(&[false; 6], 3).iter().all(|d| d.is_infinite()));
    }
}
