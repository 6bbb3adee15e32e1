"""Renders random scenes: images and depth z, one NumPy file each."""

import argparse

import numpy as np

from benchmarks.out_of_domain.scenes import random_scene

EXPOSED = 0.92
"""The brightest fiftieth is burnt out."""


def render_images(arguments: argparse.Namespace) -> None:
    """Render ``arguments.images`` scenes; files that exist are kept."""
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    textures = photographs()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for index in range(arguments.images):
        file = arguments.out / f"{index:04d}.npz"
        if file.exists():
            continue
        rng = np.random.default_rng([arguments.seed, index])
        scene = mitsuba.load_dict(random_scene(rng, textures, arguments.side))
        layers = np.array(mitsuba.render(scene, seed=index))
        rgb, depth = tonemapped(layers[..., :3]), depth_z(layers[..., -1], _fov_deg(scene))
        np.savez_compressed(file, rgb=np.round(255 * rgb).astype(np.uint8), depth=depth)
        print(f"{index + 1}/{arguments.images}", flush=True)


def photographs() -> list[np.ndarray]:
    """Scanned and photographed surfaces of scikit-image, as textures."""
    from skimage import color, data, img_as_float

    images = [data.brick(), data.grass(), data.gravel(), data.coffee(), data.immunohistochemistry()]
    return [img_as_float(color.gray2rgb(image) if image.ndim == 2 else image) for image in images]


def tonemapped(linear: np.ndarray) -> np.ndarray:
    """sRGB in [0, 1] at an exposure that burns out the brightest fiftieth."""
    linear = np.nan_to_num(linear, posinf=0.0)
    scaled = np.clip(linear, 0, None) * EXPOSED / max(np.quantile(linear, 0.98), 1e-6)
    encoded = np.where(
        scaled <= 0.0031308,
        12.92 * scaled,
        1.055 * np.clip(scaled, 1e-9, None) ** (1 / 2.4) - 0.055,
    )
    return np.clip(encoded, 0, 1)


def depth_z(distance: np.ndarray, fov_deg: float) -> np.ndarray:
    """Z of pixels at ``distance`` along their rays; 0 stays 0, where there is no surface."""
    height, width = distance.shape
    half = np.tan(np.radians(fov_deg) / 2)
    x = half * ((2 * np.arange(width) + 1) / width - 1)
    y = half * ((2 * np.arange(height) + 1) / height - 1) * height / width
    return (distance / np.sqrt(1 + x[None] ** 2 + y[:, None] ** 2)).astype(np.float32)


def _fov_deg(scene: object) -> float:
    import mitsuba

    return float(np.ravel(mitsuba.traverse(scene.sensors()[0])["x_fov"])[0])
