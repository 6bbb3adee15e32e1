"""Images that are no photographs, and lenses at both ends of what is accepted."""

from collections.abc import Iterator
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.checks.network_checks import model_of
from diff4splat.stability.compare import psnr_db, rms_error
from diff4splat.stability.plots import Thumbnail
from diff4splat.stability.subjects.drawn_images import drawn_images, objects
from diff4splat.stability.subjects.generated_scenes import as_file, generate

GROUP = "images"
LIMIT = 1e-3
"""RMS of RGB, 60 dB."""
FIELDS_OF_VIEW_DEG = (1.0, 170.0)
QUICK = ("constant", "1:40")


def image_checks(model: str) -> Iterator[Check]:
    """Each drawn image with a prompt, and one with extreme lenses."""
    cases = {
        name: (lambda draw=draw: draw(), None) for name, draw in drawn_images().items()
    }
    cases |= {f"field of view {fov:g}°": (objects, fov) for fov in FIELDS_OF_VIEW_DEG}
    for name, (draw, fov_deg) in cases.items():
        yield Check(
            group=GROUP,
            name=name,
            run=partial(measure_image, model, draw, fov_deg),
            limit=LIMIT,
            error_unit="RMS of RGB, view from the side, networks in float32 against float64",
            quick=name in QUICK,
        )


def measure_image(model: str, draw: "object", fov_deg: float | None) -> Outcome:
    """The scene of float32 networks against that of float64 networks."""
    rgb: Float[Tensor, "h w 3"] = draw()
    image, networks = as_file(rgb, fov_deg), model_of(model)
    exact = generate(networks, torch.float64, image)
    got = generate(networks, torch.float32, image)
    error = rms_error(got.side_view, exact.side_view)
    first_view = psnr_db(rms_error(got.first_view, image.rgb))
    return Outcome(
        error=error,
        value_finite=got.value_finite,
        gradient_finite=got.gradient_finite,
        note=f"{psnr_db(error)} to float64; first view shows the image at {first_view}",
        plots=(
            Thumbnail(caption="input", rgb=image.rgb),
            Thumbnail(caption="first view", rgb=got.first_view),
            Thumbnail(caption="side", rgb=got.side_view),
        ),
    )
