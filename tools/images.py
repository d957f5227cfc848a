#!/usr/bin/env python3
"""Prints the values of tests/images.rs by other implementations: tools/images.py

Needs scikit-image and flip-evaluator (pip install scikit-image flip-evaluator)."""
import pathlib

import flip_evaluator
from skimage import io
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

PAIRS = pathlib.Path(__file__).resolve().parent.parent / "tests" / "pairs"


def linear(x):
    return ((x + 0.055) / 1.055) ** 2.4 * (x > 0.04045) + x / 12.92 * (x <= 0.04045)


def row(names):
    a, b = (io.imread(name)[..., :3] / 255.0 for name in names)
    luminance = [image @ [0.299, 0.587, 0.114] for image in (a, b)]
    return [
        peak_signal_noise_ratio(a, b, data_range=1),
        peak_signal_noise_ratio(linear(a), linear(b), data_range=1),
        structural_similarity(*luminance, data_range=1, gaussian_weights=True, sigma=1.5,
                              use_sample_covariance=False),
        flip_evaluator.evaluate(*map(str, names), "LDR")[1],
    ]


if __name__ == "__main__":
    for first in sorted(PAIRS.glob("*a.png")):
        print("{:.6f}, {:.6f}, {:.7f}, {:.7f}".format(*row([first, first.with_stem(first.stem[:-1] + "b")])))
