"""``card.json``: everything needed to make a scene again, what it cost and what was left out."""

import json
import math
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat import __version__
from diff4splat.io.atomic import write_text
from diff4splat.metrics.image import psnr
from diff4splat.outputs.compressed_scene import SceneFileFacts
from diff4splat.progress.phases import peak_memory_bytes
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.extent import depth_range
from diff4splat.scene.scene import Scene

LIBRARIES = ("torch", "numpy", "safetensors", "opencv-contrib-python-headless", "OpenEXR", "pillow")
BEST_PSNR_DB = 200.0
"""Identical images have an infinite PSNR, which JSON cannot hold."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """A scene, the photograph it came from, and how well its first view shows it."""

    scene: Scene
    photo: Float[Tensor, "h w 3"]
    first_view: Float[Tensor, "h w 3"]
    first_view_psnr_db: float
    """How well the photograph is copied; a flat copy has the most."""
    relief: float
    """Far over near depth, what a copy does not give: 1 is a flat picture."""

    @classmethod
    def of(
        cls, scene: Scene, photo: Float[Tensor, "h w 3"], first_view: Float[Tensor, "h w 3"]
    ) -> "Result":
        """Compare the first frame of the path with the photograph."""
        measured = min(float(psnr(first_view, photo)), BEST_PSNR_DB)
        depths = depth_range(scene)
        return cls(
            scene=scene,
            photo=photo,
            first_view=first_view,
            first_view_psnr_db=round(measured, 2),
            relief=round(depths.far / depths.near, 3),
        )


def describe(result: Result, camera: str, focal_source: str) -> tuple[tuple[str, str], ...]:
    """The few facts that belong beside the image."""
    scene, path = result.scene, result.scene.path
    height, width = path.cameras.size_px
    seconds = float(path.times_s[-1] - path.times_s[0])
    moving = len(scene.motion.moving_index)
    prompt = (("Prompt", scene.provenance.prompt),) if scene.provenance.prompt else ()
    return (
        ("Camera", f"{camera}, {len(path)} frames, {seconds:.2g} s"),
        *prompt,
        ("Lens", focal_source),
        ("Image", f"{width} by {height} px"),
        ("Gaussians", f"{len(scene.gaussians):,}, {moving:,} of them moving"),
        (
            "First view",
            f"{result.first_view_psnr_db:.1f} dB against the photograph; other views are worse",
        ),
        ("Relief", f"{result.relief:.2f} times as deep at the far as at the near end; flat is 1"),
    )


def write_card(
    file: Path,
    result: Result,
    inputs: Mapping[str, object],
    log: RunLog,
    scene_file: SceneFileFacts,
    forecast: Mapping[str, object] | None = None,
) -> None:
    """Write the card whole or not at all; ``forecast`` compares what was expected with the run."""
    seconds = log.phases.seconds
    card = {
        "diff4splat": __version__,
        "untrained": result.scene.provenance.untrained,
        "inputs": inputs,
        "provenance": asdict(result.scene.provenance),
        "scene": scene_facts(result.scene),
        "scene_file": asdict(scene_file),
        "first_view_psnr_db": result.first_view_psnr_db,
        "relief": result.relief,
        "seconds": {name: round(value, 3) for name, value in seconds.items()},
        "seconds_total": round(math.fsum(seconds.values()), 3),
        "peak_memory_bytes": peak_memory_bytes(),
        "forecast": forecast,
        "networks_run": log.networks,
        "depth": log.depth,
        "left_out": log.skipped.to_json(),
        "versions": {name: version(name) for name in LIBRARIES},
        "machine": {
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.machine()}",
            "threads": torch.get_num_threads(),
        },
    }
    write_text(file, json.dumps(card, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def scene_facts(scene: Scene) -> dict[str, object]:
    """Counts and sizes."""
    height, width = scene.path.cameras.size_px
    return {
        "gaussians": len(scene.gaussians),
        "moving_gaussians": len(scene.motion.moving_index),
        "motion": type(scene.motion).__name__,
        "time_range_s": scene.motion.time_range_s,
        "frames": len(scene.path),
        "picture_px": [width, height],
        "harmonic_degree": scene.gaussians.degree,
    }
