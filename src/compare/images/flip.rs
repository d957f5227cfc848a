//! LDR-FLIP \[Andersson 20\]: how different two pictures look when one flips to the other.

use std::f32::consts::PI;

use super::{Edge, Picture, Plane};

/// Pixels per degree of vision: a screen of 0.7 m with 3840 pixels, seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f32 = 67.020_64;

/// Exponents of the colour and of the feature difference.
const COLOR_POWER: f32 = 0.7;
const FEATURE_POWER: f32 = 0.5;

/// Where the range of colour differences is bent, and what it becomes there.
const BEND: (f32, f32) = (0.4, 0.95);

/// Width of a feature in degrees.
const FEATURE_WIDTH: f32 = 0.082;

/// A sum of Gaussians: amplitudes and widths of the contrast sensitivity.
type Sensitivity = [(f32, f32); 2];

/// Contrast sensitivity of lightness, of red against green and of blue against yellow.
const SENSITIVITIES: [Sensitivity; 3] = [
    [(1.0, 0.0047), (0.0, 1e-5)],
    [(1.0, 0.0053), (0.0, 1e-5)],
    [(34.1, 0.04), (13.5, 0.025)],
];

/// XYZ from linear sRGB, and the white point that follows.
const XYZ: [[f32; 3]; 3] = [
    [
        10_135_552.0 / 24_577_794.0,
        8_788_810.0 / 24_577_794.0,
        4_435_075.0 / 24_577_794.0,
    ],
    [
        2_613_072.0 / 12_288_897.0,
        8_788_810.0 / 12_288_897.0,
        887_015.0 / 12_288_897.0,
    ],
    [
        1_425_312.0 / 73_733_382.0,
        8_788_810.0 / 73_733_382.0,
        70_074_185.0 / 73_733_382.0,
    ],
];
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];

/// The mean of [`flip_map`]: 0 for equal pictures, at most 1.
pub fn flip(reference: &Picture, test: &Picture) -> f64 {
    let map = flip_map(reference, test);
    map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len() as f64
}

/// The difference of every pixel of two pictures of the same size, from 0 to 1, seen at
/// [`PIXELS_PER_DEGREE`].
pub fn flip_map(reference: &Picture, test: &Picture) -> Vec<f32> {
    let a = Seen::new(reference);
    let b = Seen::new(test);
    let hunted = |linear: [f32; 3]| hunt(lab(linear));
    let largest = distance(hunted([0.0, 1.0, 0.0]), hunted([0.0, 0.0, 1.0])).powf(COLOR_POWER);
    let bend = BEND.0 * largest;
    let pixel = |k: usize| {
        let color = distance(a.colors[k], b.colors[k]).powf(COLOR_POWER);
        let color = if color < bend {
            color * BEND.1 / bend
        } else {
            BEND.1 + (color - bend) / (largest - bend) * (1.0 - BEND.1)
        };
        let edges = (a.edges[k] - b.edges[k]).abs();
        let points = (a.points[k] - b.points[k]).abs();
        let feature = (edges.max(points) * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_POWER);
        color.clamp(0.0, 1.0).powf((1.0 - feature).clamp(0.0, 1.0))
    };
    (0..a.colors.len().min(b.colors.len())).map(pixel).collect()
}

/// A picture as an eye takes it in.
struct Seen {
    /// Filtered colours, in Lab with the effect of Hunt.
    colors: Vec<[f32; 3]>,
    /// Strength of edges and of points in the lightness.
    edges: Vec<f32>,
    points: Vec<f32>,
}

impl Seen {
    fn new(picture: &Picture) -> Self {
        let opponent: Vec<[f32; 3]> = picture.linear().into_iter().map(opponent).collect();
        let plane = |channel: usize| Plane {
            width: picture.width(),
            height: picture.height(),
            values: opponent.iter().map(|p| p[channel]).collect(),
        };
        let filtered: Vec<Plane<f32>> = (0..3).map(|c| blurred(&plane(c), c)).collect();
        let colors = (0..opponent.len()).map(|k| {
            let values = [0, 1, 2].map(|c| filtered[c].values[k]);
            let linear = from_opponent(values).map(|v| v.clamp(0.0, 1.0));
            hunt(lab(linear))
        });
        let mut lightness = plane(0);
        lightness
            .values
            .iter_mut()
            .for_each(|y| *y = (*y + 16.0) / 116.0);
        let [flat, edge, point] = features();
        let strength = |kernel: &[f32]| -> Vec<f32> {
            let x = lightness.filtered(kernel, &flat, Edge::Repeat);
            let y = lightness.filtered(&flat, kernel, Edge::Repeat);
            x.values
                .iter()
                .zip(&y.values)
                .map(|(x, y)| x.hypot(*y))
                .collect()
        };
        Self {
            colors: colors.collect(),
            edges: strength(&edge),
            points: strength(&point),
        }
    }
}

/// A channel seen with its contrast sensitivity.
fn blurred(plane: &Plane<f32>, channel: usize) -> Plane<f32> {
    let widest = SENSITIVITIES
        .iter()
        .flatten()
        .map(|s| s.1)
        .fold(0.0, f32::max);
    let reach = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil();
    let gauss = |width: f32| -> Vec<f32> {
        offsets(reach)
            .map(|x| (-PI * PI * (x / PIXELS_PER_DEGREE).powi(2) / width).exp())
            .collect()
    };
    let terms = SENSITIVITIES[channel].iter().filter(|term| term.0 > 0.0);
    let terms: Vec<(f32, Vec<f32>)> = terms
        .map(|&(amplitude, width)| (amplitude * (PI / width).sqrt(), gauss(width)))
        .collect();
    let total: f32 = terms
        .iter()
        .map(|(a, g)| a * g.iter().sum::<f32>().powi(2))
        .sum();
    let mut sum = Plane {
        values: vec![0.0; plane.values.len()],
        ..*plane
    };
    for (amplitude, kernel) in terms {
        let part = plane.filtered(&kernel, &kernel, Edge::Repeat);
        for (sum, part) in sum.values.iter_mut().zip(part.values) {
            *sum += amplitude / total * part;
        }
    }
    sum
}

/// The kernels of features: the Gaussian, its first and its second derivative, with weights
/// of each sign that sum to one.
fn features() -> [Vec<f32>; 3] {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let reach = (3.0 * deviation).ceil();
    let gauss = |x: f32| (-x * x / (2.0 * deviation * deviation)).exp();
    let kernel = |weight: &dyn Fn(f32) -> f32| -> Vec<f32> {
        let weights: Vec<f32> = offsets(reach).map(|x| weight(x) * gauss(x)).collect();
        let sum = |sign: f32| weights.iter().map(|w| (w * sign).max(0.0)).sum::<f32>();
        let (plus, minus) = (sum(1.0), sum(-1.0));
        let scaled = weights.iter().map(|w| {
            if *w > 0.0 {
                w / plus
            } else {
                w / minus.max(1e-12)
            }
        });
        scaled.collect()
    };
    [
        kernel(&|_| 1.0),
        kernel(&|x| -x),
        kernel(&|x| x * x / (deviation * deviation) - 1.0),
    ]
}

/// Whole numbers from `-reach` to `reach`.
fn offsets(reach: f32) -> impl Iterator<Item = f32> {
    std::iter::successors(Some(-reach), move |x| (*x < reach).then_some(x + 1.0))
}

fn xyz(linear: [f32; 3]) -> [f32; 3] {
    XYZ.map(|row| row[0] * linear[0] + row[1] * linear[1] + row[2] * linear[2])
}

/// Lightness, red against green, blue against yellow.
fn opponent(linear: [f32; 3]) -> [f32; 3] {
    let xyz = xyz(linear);
    let [x, y, z] = [0, 1, 2].map(|k| xyz[k] / WHITE[k]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_opponent([lightness, red, blue]: [f32; 3]) -> [f32; 3] {
    let y = (lightness + 16.0) / 116.0;
    let xyz = [y + red / 500.0, y, y - blue / 200.0];
    let xyz = glam::Vec3::from([0, 1, 2].map(|k| xyz[k] * WHITE[k]));
    let rows = glam::Mat3::from_cols_array_2d(&XYZ).transpose();
    (rows.inverse() * xyz).to_array()
}

/// CIE L*a*b*.
fn lab(linear: [f32; 3]) -> [f32; 3] {
    const STEP: f32 = 6.0 / 29.0;
    let bent = |t: f32| {
        if t > STEP * STEP * STEP {
            t.cbrt()
        } else {
            t / (3.0 * STEP * STEP) + 4.0 / 29.0
        }
    };
    let xyz = xyz(linear);
    let [x, y, z] = [0, 1, 2].map(|k| bent(xyz[k] / WHITE[k]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Colours fade with the light: the effect of Hunt.
fn hunt([lightness, a, b]: [f32; 3]) -> [f32; 3] {
    let share = 0.01 * lightness;
    [lightness, a * share, b * share]
}

/// The distance `HyAB`: along lightness and across it.
fn distance(p: [f32; 3], q: [f32; 3]) -> f32 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}
