//! Differences of pictures against reference implementations: PSNR and SSIM of scikit-image 0.26,
//! FLIP of flip-evaluator 1.7, all on the PNG files in `tests/pairs`. `tools/images.py` prints
//! their values.
#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::path::Path;

use nurbray::Picture;
use nurbray::compare::{flip, psnr, psnr_linear, ssim};

/// PSNR of the sRGB values, of linear light, SSIM and FLIP.
const REFERENCE: [[f64; 4]; 5] = [
    [22.034639, 20.898255, 0.9076458, 0.0641350],
    [26.039108, 25.968796, 0.9440911, 0.1100339],
    [23.415716, 22.571369, 0.7530601, 0.2983724],
    [9.356662, 9.376627, 0.6266055, 0.5026804],
    [15.549739, 12.205403, 0.9569036, 0.5422744],
];

fn picture(name: &str) -> Picture {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pairs");
    let image = image::open(folder.join(name)).unwrap().into_rgb8();
    let pixels = image.pixels().map(|p| p.0.map(|c| f32::from(c) / 255.0));
    let (width, height) = (image.width() as usize, image.height() as usize);
    Picture::new(width, height, pixels.collect()).unwrap()
}

#[test]
fn five_pairs_agree_with_the_reference_implementations() {
    for (k, expected) in (1..).zip(REFERENCE) {
        let (a, b) = (picture(&format!("{k}a.png")), picture(&format!("{k}b.png")));
        let found = [
            psnr(&a, &b),
            psnr_linear(&a, &b),
            ssim(&a, &b),
            flip(&a, &b),
        ];
        for ((found, expected), within) in found
            .into_iter()
            .zip(expected)
            .zip([1e-4, 1e-4, 1e-5, 1e-4])
        {
            assert!(
                (found - expected).abs() < within,
                "pair {k}: {found} for {expected}"
            );
        }
    }
}

#[test]
fn pictures_say_that_they_are_srgb() {
    let file = nurbray::output::encode_png(&picture("1a.png")).unwrap();
    assert!(file.windows(4).any(|chunk| chunk == b"sRGB"));
}
