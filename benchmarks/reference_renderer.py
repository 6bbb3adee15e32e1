"""Time and memory of the reference renderer; every scene in a fresh process.

Run ``OMP_NUM_THREADS=1 python benchmarks/reference_renderer.py``. Scenes, with plain colour:
``aligned`` has one Gaussian per pixel on a smooth depth map (sigma half a pixel, opacity 0.999);
``cloud`` fills the frustum with nearly isotropic Gaussians (3-sigma radius 3 to 6 px with the
dilation, opacity 0.1 to 0.9).
"""

import multiprocessing
import time
from collections.abc import Callable
from dataclasses import fields, replace

import torch

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.depth import unproject
from diff4splat.render.api import render
from diff4splat.report.phases import peak_memory_bytes
from diff4splat.scene.gaussians import Gaussians

SCENES = {"aligned": (65_536, 256), "cloud 10k": (10_000, 512), "cloud 100k": (100_000, 512)}
REPEATS = 5


def aligned(camera: Camera) -> Gaussians:
    generator = torch.Generator().manual_seed(0)
    knots = 4 + torch.rand(1, 1, 8, 8, generator=generator)
    depth = torch.nn.functional.interpolate(knots, camera.size_px, mode="bicubic")[0, 0]
    means = unproject(camera, depth).flatten(0, 1)
    count = len(means)
    return Gaussians(
        means=means,
        quats=torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(count, 1),
        scales=(0.5 * depth / camera.focal_px[0]).flatten()[:, None].repeat(1, 3),
        opacities=torch.full((count,), 0.999),
        sh=torch.rand(count, 1, 3, generator=generator),
    )


def cloud(camera: Camera, count: int) -> Gaussians:
    generator = torch.Generator().manual_seed(0)

    def uniform(*shape: int, low: float, high: float) -> torch.Tensor:
        return low + (high - low) * torch.rand(count, *shape, generator=generator)

    depth = uniform(1, low=1.0, high=5.0)
    sigma_px = (uniform(1, low=1.0, high=2.0).square() - 0.3).sqrt()
    return Gaussians(
        means=torch.cat([uniform(2, low=-0.5, high=0.5) * depth, depth], 1),
        quats=torch.randn(count, 4, generator=generator),
        scales=sigma_px * depth / camera.focal_px[0] * uniform(3, low=0.8, high=1.2),
        opacities=uniform(low=0.1, high=0.9),
        sh=uniform(1, 3, low=0.0, high=1.0),
    )


def best_ms(work: Callable[[], None]) -> float:
    times_s = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        work()
        times_s.append(time.perf_counter() - began)
    return 1000 * min(times_s)


def measure(name: str) -> str:
    count, size = SCENES[name]
    camera = pinhole(float(size), (size, size))
    scene = aligned(camera) if name == "aligned" else cloud(camera, count)
    leaves = {f.name: getattr(scene, f.name).clone().requires_grad_() for f in fields(scene)}
    watched = replace(scene, **leaves)
    before = peak_memory_bytes()
    forward_ms = best_ms(lambda: render(scene, camera))
    forward_mb = (peak_memory_bytes() - before) >> 20
    both_ms = best_ms(lambda: render(watched, camera).rgb.sum().backward())
    both_mb = (peak_memory_bytes() - before) >> 20
    return (
        f"{name:<11} {count:>7} {size:>5}²  forward {forward_ms:>6.0f} ms {forward_mb:>4} MiB   "
        f"with backward {both_ms:>6.0f} ms {both_mb:>4} MiB"
    )


if __name__ == "__main__":
    print(f"torch {torch.__version__}, {torch.get_num_threads()} thread(s), best of {REPEATS}")
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        for line in pool.imap(measure, SCENES, chunksize=1):
            print(line, flush=True)
