//! Structural similarity \[Wang 04\].

use super::{Edge, Picture, Plane};

/// Standard deviation of the window, in pixels.
const SIGMA: f64 = 1.5;

/// Pixels on each side of the middle of the window.
const REACH: usize = 5;

/// The constants of the formula, squared, for values from 0 to 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// The mean structural similarity of the luminance (Rec. 601) of two sRGB pictures of the same
/// size: a Gaussian window of 11 by 11 pixels, without those nearer than that to the border;
/// 1 for equal pictures.
pub fn ssim(a: &Picture, b: &Picture) -> f64 {
    let weights = window();
    let smooth = |plane: &Plane<f64>| plane.filtered(&weights, &weights, Edge::Mirror);
    let (x, y) = (luminance(a), luminance(b));
    let product = |p: &Plane<f64>, q: &Plane<f64>| Plane {
        values: p.values.iter().zip(&q.values).map(|(p, q)| p * q).collect(),
        ..*p
    };
    let (mean_x, mean_y) = (smooth(&x), smooth(&y));
    let (xx, yy, xy) = (product(&x, &x), product(&y, &y), product(&x, &y));
    let (xx, yy, xy) = (smooth(&xx), smooth(&yy), smooth(&xy));
    let (mut sum, mut count) = (0.0, 0.0);
    let margin = if x.width > 2 * REACH && x.height > 2 * REACH {
        REACH
    } else {
        0
    };
    for row in margin..x.height - margin {
        for column in margin..x.width - margin {
            let k = row * x.width + column;
            let (mx, my) = (mean_x.values[k], mean_y.values[k]);
            let (vx, vy) = (xx.values[k] - mx * mx, yy.values[k] - my * my);
            let both = xy.values[k] - mx * my;
            let value = (2.0 * mx * my + C1) * (2.0 * both + C2)
                / ((mx * mx + my * my + C1) * (vx + vy + C2));
            sum += value;
            count += 1.0;
        }
    }
    sum / count
}

fn window() -> Vec<f64> {
    let weight = |k: usize| {
        let x = k as f64 - REACH as f64;
        (-0.5 * x * x / (SIGMA * SIGMA)).exp()
    };
    let weights: Vec<f64> = (0..=2 * REACH).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

fn luminance(picture: &Picture) -> Plane<f64> {
    let luma = |pixel: &[f32; 3]| {
        let [r, g, b] = pixel.map(f64::from);
        0.299 * r + 0.587 * g + 0.114 * b
    };
    Plane {
        width: picture.width(),
        height: picture.height(),
        values: picture.pixels().iter().map(luma).collect(),
    }
}
