"""End to end: an image and a prompt to a scene, with all networks in one precision."""

from collections.abc import Iterator
from functools import cache, partial

import torch

from diff4splat.generation.settings import GenerationSettings
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.checks.network_checks import model_of
from diff4splat.stability.compare import psnr_db, rms_error
from diff4splat.stability.plots import Thumbnail
from diff4splat.stability.subjects.casting import DTYPES
from diff4splat.stability.subjects.drawn_images import objects
from diff4splat.stability.subjects.generated_scenes import GeneratedScene, as_file, generate

GROUP = "end-to-end"
LIMITS = {"float32": 1e-3, "bfloat16": 0.05, "float16": 0.02}
"""RMS of RGB: 60, 26 and 34 dB."""
ROUTES = {
    "default": GenerationSettings(),
    "video fill": GenerationSettings(fill="video", steps=4),
}


def scene_checks(model: str) -> Iterator[Check]:
    """Each route of generation in each precision."""
    for route in ROUTES:
        for dtype, limit in LIMITS.items():
            yield Check(
                group=GROUP,
                name=f"{route}, networks in {dtype}",
                run=partial(measure_scene, model, route, dtype),
                limit=limit,
                error_unit="RMS of RGB, view from the side",
                quick=route == "default" and dtype == "float32",
            )


def measure_scene(model: str, route: str, dtype: str) -> Outcome:
    """The scene against that of float64 networks."""
    exact = _scene(model, route, torch.float64)
    got = _scene(model, route, DTYPES[dtype])
    error = rms_error(got.side_view, exact.side_view)
    counts = {len(part.scene.gaussians) for part in (got, exact)}
    other = "" if len(counts) == 1 else f"; {min(counts):,} against {max(counts):,} Gaussians"
    return Outcome(
        error=error,
        value_finite=got.value_finite,
        gradient_finite=got.gradient_finite,
        note=psnr_db(error) + other,
        plots=(
            Thumbnail(caption=dtype, rgb=got.side_view),
            Thumbnail(caption="float64", rgb=exact.side_view),
        ),
    )


@cache
def _scene(model: str, route: str, dtype: torch.dtype) -> GeneratedScene:
    return generate(model_of(model), dtype, as_file(objects()), ROUTES[route])
