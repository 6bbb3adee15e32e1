"""PSNR along a camera path with true depth, and with true disparity as depth networks give it.

    python -m benchmarks.out_of_domain views --out FOLDER --images 20
    python -m benchmarks.out_of_domain priors --images FOLDER --out priors.md

Every row hands one map over as ``--depth`` does. Networks know disparity up to a factor and an
offset, at their own size, and files hold it in 8 or 16 bits. True depth at the same size is the row
to compare with. Axes: ``h w`` pixels.
"""

import argparse
import statistics
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry.camera import focal_from_fov, pinhole
from diff4splat.io.atomic import write_text
from diff4splat.io.photos.images import write_png
from diff4splat.metrics.image import psnr
from diff4splat.models.depth_priors.kinds import DepthKind, DepthMap
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render

Item = dict[str, np.ndarray]
Distort = Callable[[np.ndarray, np.random.Generator], np.ndarray]
REFLECTED = ("true depth, size of the image", "the model's own")
"""Ways that are also measured without image inpainting."""
HEADER = (
    "| depth | PSNR [dB] | mean difference | median difference | worst scene |\n"
    "|---|---:|---:|---:|---:|\n"
)


class ArrayDepth:
    """A map in memory, as a file would hold it."""

    def __init__(self, values: np.ndarray, kind: DepthKind) -> None:
        self.values, self.kind = values, kind

    def depth_map(self, image: InputImage) -> DepthMap:
        return DepthMap(values=self.values, kind=self.kind, source="array")

    def record(self) -> dict[str, Any]:
        return {}


def scaled(disparity: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Up to a factor; sky is 0, as Depth Anything gives it."""
    return disparity * np.exp(rng.uniform(-3, 3))


def affine(disparity: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Up to a factor and an offset of up to half of the range either way."""
    span = disparity.max() - disparity.min()
    moved = disparity + rng.uniform(-0.5, 0.5) * span
    return scaled(moved, rng)


def normalised(disparity: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """From 0, the farthest, to 1, the nearest: what most tools write."""
    del rng
    return (disparity - disparity.min()) / (disparity.max() - disparity.min())


def quantised(distort: Distort, bits: int) -> Distort:
    """The same in whole numbers."""

    def apply(disparity: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        values = normalised(distort(disparity, rng), rng)
        return np.round(values * (2**bits - 1))

    return apply


def levels(bits: int) -> Distort:
    """Whole numbers of which 0 is infinitely far."""

    def apply(disparity: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        del rng
        return np.round(disparity / disparity.max() * (2**bits - 1))

    return apply


DISPARITIES: dict[str, tuple[DepthKind, Distort]] = {
    "disparity, 0 at infinity stated": ("disparity", scaled),
    "the same, 16 bits": ("disparity", levels(16)),
    "the same, 8 bits": ("disparity", levels(8)),
    "disparity up to a factor": ("inverse", scaled),
    "disparity, affine": ("inverse", affine),
    "disparity, affine, 16 bits": ("inverse", quantised(affine, 16)),
    "disparity, affine, 8 bits": ("inverse", quantised(affine, 8)),
}


def write_prior_table(arguments: argparse.Namespace) -> None:
    """One row per way of handing depth over."""
    files = sorted(arguments.images.glob("*.npz"))
    pipeline = Diff4SplatPipeline.from_pretrained(arguments.model)
    rows: dict[str, list[float]] = {}
    for index, file in enumerate(files):
        with np.load(file, allow_pickle=False) as arrays:
            item = dict(arrays)
        given = sources(item, index)
        for name, source in given.items():
            rows.setdefault(name, []).append(path_psnr(pipeline, item, source))
        for name in REFLECTED:
            psnr_db = path_psnr(pipeline, item, given[name], without=("image_inpainting",))
            rows.setdefault(f"{name}, without image inpainting", []).append(psnr_db)
        print(
            f"{file.name}: {', '.join(f'{values[-1]:.2f}' for values in rows.values())}", flush=True
        )
    text = HEADER + "\n".join(table_rows(rows)) + "\n"
    write_text(arguments.out, f"{len(files)} scenes.\n\n{text}")
    print(text)


def sources(item: Item, index: int) -> dict[str, ArrayDepth | None]:
    """Every way of handing over one item's depth; None is the model's own."""
    depth = item["depth_518"]
    with np.errstate(divide="ignore"):
        disparity = np.where(depth > 0, 1 / depth, 0.0).astype(np.float64)
    found: dict[str, ArrayDepth | None] = {
        "true depth, 518 px": ArrayDepth(depth, "metric"),
        "true depth, size of the image": ArrayDepth(item["depth"], "metric"),
    }
    for name, (kind, distort) in DISPARITIES.items():
        values = distort(disparity, np.random.default_rng([7, index]))
        found[name] = ArrayDepth(values.astype(np.float32), kind)
    return found | {"the model's own": None}


def path_psnr(
    pipeline: Diff4SplatPipeline,
    item: Item,
    source: ArrayDepth | None,
    without: tuple[str, ...] = (),
) -> float:
    """Mean PSNR of the views along the path."""
    targets = torch.from_numpy(item["views"]).float() / 255
    found = path_views(pipeline, item, source, without)
    return statistics.mean(
        float(psnr(view, target)) for view, target in zip(found, targets, strict=True)
    )


def path_views(
    pipeline: Diff4SplatPipeline,
    item: Item,
    source: ArrayDepth | None,
    without: tuple[str, ...] = (),
) -> list[torch.Tensor]:
    """The scene as the cameras of the path see it, generated ``without`` some networks."""
    rgb = torch.from_numpy(item["rgb"]).float() / 255
    size_px = (rgb.shape[0], rgb.shape[1])
    camera = pinhole(focal_from_fov(float(item["fov_deg"]), size_px[1]), size_px).to(torch.float32)
    image = InputImage(rgb=rgb, camera=camera, focal_source="truth")
    poses = torch.cat([torch.eye(4)[None], torch.from_numpy(item["world_from_camera"]).float()])
    times_s = torch.arange(len(poses)) / 24
    path = CameraPath(cameras=camera.with_pose(poses), times_s=times_s)
    settings = GenerationSettings(without=without)
    scene = pipeline(image, path, settings=settings, log=RunLog(), depth=source)
    cameras = scene.path.cameras
    with torch.no_grad():
        return [render(scene, cameras[number], 0.0).rgb for number in range(1, len(cameras))]


def write_prior_picture(arguments: argparse.Namespace) -> None:
    """A row per item: input, target, with the model's own depth, with 8-bit disparity."""
    pipeline = Diff4SplatPipeline.from_pretrained(arguments.model)
    rows = []
    for number in arguments.items:
        with np.load(arguments.images / f"{number:04d}.npz", allow_pickle=False) as arrays:
            item = dict(arrays)
        given = sources(item, number)["disparity, affine, 8 bits"]
        cells = [torch.from_numpy(item[name]).float() / 255 for name in ("rgb", "views")]
        cells = [cells[0], cells[1][-1]]
        cells += [path_views(pipeline, item, source)[-1] for source in (None, given)]
        rows.append(torch.cat([cell.clamp(0, 1) for cell in cells], 1))
    write_png(torch.cat(rows), arguments.out)


def table_rows(rows: dict[str, list[float]]) -> list[str]:
    """Means, and differences to true depth of the same size."""
    truth = next(iter(rows.values()))
    lines = []
    for name, values in rows.items():
        gaps = [value - true for value, true in zip(values, truth, strict=True)]
        cells = (statistics.mean(gaps), statistics.median(gaps), min(gaps))
        shown = " | ".join(f"{cell:+.2f}" for cell in cells)
        lines.append(f"| {name} | {statistics.mean(values):.2f} | {shown} |")
    return lines
