//! How much two pictures differ: PSNR, SSIM and FLIP.

mod flip;
mod ssim;

pub use flip::{PIXELS_PER_DEGREE, flip, flip_map};
pub use ssim::ssim;

use std::ops::{Add, Mul};

use crate::film::Picture;

/// Peak signal to noise ratio in decibels over all channels, of the sRGB values of two pictures of
/// the same size; infinite for equal pictures.
pub fn psnr(a: &Picture, b: &Picture) -> f64 {
    decibels(a.pixels(), b.pixels())
}

/// [`psnr`] of linear light.
pub fn psnr_linear(a: &Picture, b: &Picture) -> f64 {
    decibels(&a.linear(), &b.linear())
}

fn decibels(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    let square = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
    let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), pair| {
        (sum + square(pair), count + 1.0)
    });
    -10.0 * (sum / count).log10()
}

/// A picture with one value per pixel.
#[derive(Clone, Debug)]
struct Plane<T> {
    width: usize,
    height: usize,
    values: Vec<T>,
}

/// The sum of products.
fn dot<T: Copy + Default + Add<Output = T> + Mul<Output = T>>(a: &[T], b: &[T]) -> T {
    let products = a.iter().zip(b).map(|(p, w)| *p * *w);
    products.fold(T::default(), |sum, product| sum + product)
}

/// What stands beyond the edge of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Edge {
    /// The last pixel, again and again.
    Repeat,
    /// The picture mirrored, the last pixel twice.
    Mirror,
}

impl Edge {
    /// The place in a row of `count` that stands at `k`.
    fn at(self, k: isize, count: usize) -> usize {
        let last = isize::try_from(count).unwrap_or(isize::MAX) - 1;
        let place = match self {
            Self::Repeat => k,
            Self::Mirror if k < 0 => -k - 1,
            Self::Mirror if k > last => 2 * last + 1 - k,
            Self::Mirror => k,
        };
        place.clamp(0, last).unsigned_abs()
    }
}

impl<T: Copy + Default + Send + Sync + Add<Output = T> + Mul<Output = T>> Plane<T> {
    /// The plane filtered along rows with one kernel, then along columns with another; both
    /// have an odd number of weights.
    fn filtered(&self, along_x: &[T], along_y: &[T], edge: Edge) -> Self {
        use rayon::prelude::*;
        let (width, height) = (self.width, self.height);
        let offset = |weights: &[T], k: usize| {
            isize::try_from(k).unwrap_or(0) - isize::try_from(weights.len() / 2).unwrap_or(0)
        };
        let signed = |k: usize| isize::try_from(k).unwrap_or(0);
        let mut across = vec![T::default(); self.values.len()];
        across
            .par_chunks_mut(width)
            .zip(self.values.par_chunks(width))
            .for_each(|(to, from)| {
                let reach = along_x.len() / 2;
                let mut padded = Vec::new();
                padded.extend(
                    (0..width + 2 * reach).map(|k| from[edge.at(signed(k) - signed(reach), width)]),
                );
                for (x, value) in to.iter_mut().enumerate() {
                    let window = &padded[x..x + along_x.len()];
                    *value = dot(window, along_x);
                }
            });
        let mut values = vec![T::default(); self.values.len()];
        values
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(y, to)| {
                for (k, weight) in along_y.iter().enumerate() {
                    let row = edge.at(signed(y) + offset(along_y, k), height);
                    let from = &across[row * width..(row + 1) * width];
                    for (value, p) in to.iter_mut().zip(from) {
                        *value = *value + *weight * *p;
                    }
                }
            });
        Self {
            values,
            width,
            height,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_pictures_do_not_differ_and_a_known_step_has_a_known_ratio() {
        let flat = |value: f32| Picture::new(16, 12, vec![[value; 3]; 16 * 12]).unwrap();
        let (a, b) = (flat(0.5), flat(0.6));
        assert!(psnr(&a, &a).is_infinite());
        assert!((psnr(&a, &b) - 20.0).abs() < 1e-5);
        assert!((ssim(&a, &a) - 1.0).abs() < 1e-9);
        assert!(flip(&a, &a) < 1e-9);
        assert!(Picture::new(3, 2, vec![[0.0; 3]; 5]).is_none());
    }

    #[test]
    fn black_and_white_are_as_far_apart_as_can_be_nearly() {
        let flat = |value: f32| Picture::new(32, 32, vec![[value; 3]; 32 * 32]).unwrap();
        let value = flip(&flat(0.0), &flat(1.0));
        assert!((0.9..=1.0).contains(&value), "{value}");
    }
}
