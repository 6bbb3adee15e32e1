"""Write a photograph-like picture: a mountain lake at dusk, made of 1/f noise, nothing downloaded.

Usage: python examples/make_picture.py picture.jpg [--width 960] [--seed 7]
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

FOCAL_35MM = 28
EXIF_IFD, EXIF_FOCAL_35MM = 0x8769, 0xA405


def fractal(size: tuple[int, int], rng: np.random.Generator, power: float = 1.6) -> np.ndarray:
    """Noise with a 1/f^power amplitude spectrum, scaled to [0, 1]."""
    frequency = np.hypot(
        np.fft.fftfreq(size[0])[:, None] * size[0] / size[1], np.fft.rfftfreq(size[1])
    )
    frequency[0, 0] = 1
    spectrum = np.fft.rfft2(rng.standard_normal(size)) / frequency**power
    values = np.fft.irfft2(spectrum, s=size)
    low, high = np.quantile(values, [0.005, 0.995])
    return np.clip((values - low) / (high - low), 0, 1)


def blend(below: np.ndarray, above: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Alpha blending with a per-pixel weight."""
    return below * (1 - weight[..., None]) + above * weight[..., None]


def sky(size: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """A dusk gradient with a low sun and stretched clouds."""
    height, width = size
    y, x = np.mgrid[0:height, 0:width] / height
    stops = [[0.20, 0.33, 0.58], [0.55, 0.62, 0.75], [0.98, 0.78, 0.58]]
    picture = np.stack([np.interp(y, [0, 0.32, 0.55], [s[c] for s in stops]) for c in range(3)], -1)
    sun = np.hypot(x - 0.62 * width / height, y - 0.40)
    picture += np.exp(-((sun / 0.16) ** 2))[..., None] * [0.35, 0.24, 0.10]
    clouds = cv2.resize(
        fractal((height, width // 4), rng, 1.5), (width, height), interpolation=cv2.INTER_CUBIC
    )
    weight = np.clip((clouds - 0.5) * 2.2, 0, 1) * np.clip(1 - y / 0.6, 0, 1)
    return blend(
        picture, np.array([1.0, 0.90, 0.84]) * (0.75 + 0.25 * clouds[..., None]), 0.75 * weight
    )


def ridge_line(width: int, rng: np.random.Generator, roughness: float) -> np.ndarray:
    """A mountain silhouette in [-1, 1] over the columns."""
    frequency = np.fft.rfftfreq(width)
    frequency[0] = 1
    spectrum = np.fft.rfft(rng.standard_normal(width)) / frequency**roughness
    spectrum[0] = 0
    line = np.fft.irfft(spectrum, n=width)
    return line / np.abs(line).max()


def mountains(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Four ridges, each nearer, darker and less hazy than the one behind."""
    height, width = picture.shape[:2]
    rows = np.arange(height)[:, None]
    for depth, (base, swing, haze) in enumerate(
        [(0.44, 0.12, 0.62), (0.49, 0.09, 0.42), (0.53, 0.06, 0.2), (0.565, 0.035, 0.05)]
    ):
        top = height * (base + swing * ridge_line(width, rng, 1.25 + 0.1 * depth))
        rock = fractal((height, width), rng, 1.2)
        light = np.clip(
            0.5 + 3 * np.gradient(cv2.GaussianBlur(rock, (0, 0), 1.2), axis=1) * 6, 0, 1
        )
        tint = np.array(
            [[0.42, 0.44, 0.52], [0.33, 0.38, 0.42], [0.22, 0.30, 0.28], [0.12, 0.19, 0.15]][depth]
        )
        surface = tint * (0.55 + 0.5 * light[..., None] + 0.35 * rock[..., None])
        snow = np.clip((height * 0.40 - rows) / (0.05 * height) + 2 * rock - 0.9, 0, 1) * (
            depth < 2
        )
        surface = blend(
            surface, np.array([0.93, 0.91, 0.95]) * (0.7 + 0.3 * light[..., None]), snow
        )
        surface = surface * (1 - haze) + haze * np.array([0.83, 0.72, 0.68])
        picture = blend(picture, surface, np.clip(rows - top[None], 0, 1))
    return picture


def lake(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Everything below the shore mirrors what is above it, broken by ripples."""
    height, width = picture.shape[:2]
    shore = int(0.60 * height)
    y, x = np.mgrid[shore:height, 0:width].astype(np.float32)
    near = (y - shore) / (height - shore)
    ripples = cv2.resize(fractal((height - shore, width // 6), rng, 1.0), (width, height - shore))
    source_y = 2 * shore - y + (ripples - 0.5) * (4 + 40 * near)
    mirrored = cv2.remap(
        picture.astype(np.float32),
        x + (ripples - 0.5).astype(np.float32) * 10,
        np.clip(source_y, 0, shore - 1).astype(np.float32),
        cv2.INTER_LINEAR,
    )
    water = (
        mirrored * (0.82 - 0.25 * near[..., None]) + np.array([0.02, 0.05, 0.08]) * near[..., None]
    )
    water += 0.10 * (ripples[..., None] - 0.5) * (0.4 + near[..., None])
    picture = picture.copy()
    picture[shore:] = water
    return picture


def pines(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A dark bank with ragged pines in the lower corners."""
    height, width = picture.shape[:2]
    mask = np.zeros((height, width), np.float32)
    rows, columns = np.mgrid[0:height, 0:width]
    bank = height * (0.97 - 0.16 * np.abs(np.linspace(-1, 1, width)) ** 3) + 4 * ridge_line(
        width, rng, 1.0
    )
    mask = np.maximum(mask, np.clip(rows - bank[None], 0, 1))
    ragged = 0.75 + 0.5 * rng.random((height, width))
    for side in (-1, 1):
        for x in rng.uniform(0.0, 0.28, 14) ** 1.2:
            column = int((width - 1) * (x if side < 0 else 1 - x))
            tall = height * rng.uniform(0.20, 0.48) * (1 - 1.8 * x)
            reach = (rows - (bank[column] + 8 - tall)) / tall
            branches = 0.35 + 0.65 * (
                (reach * rng.uniform(9, 15) + 0.04 * np.abs(columns - column)) % 1
            )
            inside = (reach > 0) & (reach < 1)
            half = np.where(
                inside, 0.18 * tall * np.clip(reach, 0, 1) ** 0.8 * branches * ragged, 0
            )
            mask = np.maximum(mask, np.clip(half - np.abs(columns - column) + 0.7, 0, 1) * inside)
    needles = fractal((height, width), rng, 0.6)[..., None]
    return blend(picture, np.array([0.05, 0.075, 0.06]) * (0.5 + 1.4 * needles), mask)


def develop(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Lens softness, vignette, tone curve and grain."""
    height, width = picture.shape[:2]
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    picture = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 0.7)
    picture *= (1 - 0.18 * (x**2 + y**2))[..., None]
    picture = picture + 0.012 * rng.standard_normal(picture.shape)
    return (255 * np.clip(picture, 0, 1) ** 0.95).astype(np.uint8)


def make_picture(width: int, seed: int) -> Image.Image:
    """The whole picture at 3:2."""
    rng = np.random.default_rng(seed)
    size = (width * 2 // 3, width)
    picture = mountains(sky(size, rng), rng)
    return Image.fromarray(develop(pines(lake(picture, rng), rng), rng))


def main() -> None:
    """Write the picture with the focal length that a phone would record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--width", type=int, default=960)
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    picture = make_picture(options.width, options.seed)
    exif = picture.getexif()
    exif.get_ifd(EXIF_IFD)[EXIF_FOCAL_35MM] = FOCAL_35MM
    options.file.parent.mkdir(parents=True, exist_ok=True)
    picture.save(options.file, exif=exif, quality=95)


if __name__ == "__main__":
    main()
