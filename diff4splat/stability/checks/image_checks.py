"""Images that are no photographs, and lenses at both ends of what is accepted."""

from collections.abc import Callable, Iterator
from functools import partial

import torch

from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.checks.network_checks import model_of
from diff4splat.stability.compare import psnr_db, rms_error
from diff4splat.stability.plots import Thumbnail
from diff4splat.stability.subjects.drawn_images import Image, drawn_images, objects
from diff4splat.stability.subjects.generated_scenes import (
    SIDE_PX,
    GeneratedScene,
    as_file,
    generate,
)

GROUP = "images"
LIMIT = 1e-3
"""RMS of RGB, 60 dB."""
FIELDS_OF_VIEW_DEG = (1.0, 60.0, 120.0, 150.0, 170.0)
FIRST_VIEW_LIMIT = 0.1
"""RMS of RGB, 20 dB: the first view shows the image itself."""
QUICK = ("constant", "1:40")
PHOTOGRAPH_PX = 256
"""Larger than any copy that networks see, so that image inpainting runs."""
PHOTOGRAPHS = ("two objects", "black", "1:8", "checkerboard of pixels")


def image_checks(model: str) -> Iterator[Check]:
    """Each drawn image with a prompt, some large, and one with extreme lenses."""
    drawn = drawn_images()
    yield from (_scene_check(model, name, drawn[name], SIDE_PX) for name in drawn)
    yield from (_scene_check(model, name, drawn[name], PHOTOGRAPH_PX) for name in PHOTOGRAPHS)
    for fov_deg in FIELDS_OF_VIEW_DEG:
        yield Check(
            group=GROUP,
            name=f"field of view {fov_deg:g}°, first view against the image",
            run=partial(measure_first_view, model, fov_deg),
            limit=FIRST_VIEW_LIMIT,
            error_unit="RMS of RGB",
        )


def _scene_check(model: str, name: str, draw: Callable[[], Image], side_px: int) -> Check:
    is_small = side_px == SIDE_PX
    return Check(
        group=GROUP,
        name=name if is_small else f"{name}, {side_px} px",
        run=partial(measure_image, model, draw, side_px),
        limit=LIMIT,
        error_unit="RMS of RGB, view from the side, networks in float32 against float64",
        quick=is_small and name in QUICK,
    )


def measure_image(model: str, draw: Callable[[], Image], side_px: int = SIDE_PX) -> Outcome:
    """The scene of float32 networks against that of float64 networks."""
    image, networks = as_file(draw(), side_px=side_px), model_of(model)
    exact = generate(networks, torch.float64, image)
    got = generate(networks, torch.float32, image)
    error = rms_error(got.side_view, exact.side_view)
    first_view = psnr_db(rms_error(got.first_view, image.rgb))
    note = f"{psnr_db(error)} to float64; first view shows the image at {first_view}"
    return _outcome(image.rgb, got, error, note)


def measure_first_view(model: str, fov_deg: float) -> Outcome:
    """How well the scene shows its own image through such a lens."""
    image = as_file(objects(), fov_deg)
    got = generate(model_of(model), torch.float32, image)
    error = rms_error(got.first_view, image.rgb)
    return _outcome(image.rgb, got, error, psnr_db(error))


def _outcome(rgb: Image, got: GeneratedScene, error: float, note: str) -> Outcome:
    return Outcome(
        error=error,
        value_finite=got.value_finite,
        gradient_finite=got.gradient_finite,
        note=note,
        plots=(
            Thumbnail(caption="input", rgb=rgb),
            Thumbnail(caption="first view", rgb=got.first_view),
            Thumbnail(caption="side", rgb=got.side_view),
        ),
    )
