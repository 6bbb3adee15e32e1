"""Scenes of drawn images by the generation that ships, with the networks in any precision."""

import tempfile
from dataclasses import dataclass, fields, replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.generation.inputs.input_image import InputImage, load_image
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.io.photos.images import write_png
from diff4splat.models.hub.model import Model
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene
from diff4splat.stability.compare import all_finite, finite_gradients
from diff4splat.stability.subjects.casting import cast_networks

CAMERA_PATH = "arc:0.2"
PROMPT = "the red block moves to the left"
SIDE_PX = 96
OUTPUTS = ("rgb", "depth", "alpha")


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneratedScene:
    """A scene and two of its views."""

    scene: Scene
    first_view: Float[Tensor, "h w 3"]
    side_view: Float[Tensor, "h w 3"]
    """From the side, at the end of the motion."""
    value_finite: bool
    """Of all Gaussians at that time, and all images."""
    gradient_finite: bool | None
    """Of the side view, in all parameters of the Gaussians."""


def as_file(
    rgb: Float[Tensor, "h w 3"], fov_deg: float | None = None, side_px: int = SIDE_PX
) -> InputImage:
    """The image written and read again, as users' images are, at about ``side_px``.

    Raises:
        InputError: it is no image that can be used.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "image.png"
        write_png(rgb, file)
        try:
            return load_image(file, side_px, fov_deg)
        except InputError as error:
            # The folder is of no interest to a reader.
            raise InputError(str(error).replace(f"{folder}/", "")) from error


def generate(
    model: Model,
    dtype: torch.dtype,
    image: InputImage,
    settings: GenerationSettings | None = None,
    prompt: str | None = PROMPT,
) -> GeneratedScene:
    """A scene, with every network in ``dtype``; all else is as in any generation."""
    cast = replace(model, networks=cast_networks(model.networks, dtype))
    scene = Diff4SplatPipeline(cast)(image, CAMERA_PATH, prompt, settings=settings)
    return _viewed(scene)


def _viewed(scene: Scene) -> GeneratedScene:
    cameras, end_s = scene.path.cameras, scene.motion.time_range_s[1]
    first = render(scene, cameras[0], 0.0)
    gaussians = scene.state_at(end_s)
    values = {field.name: getattr(gaussians, field.name) for field in fields(gaussians)}
    leaves = {name: value.detach().requires_grad_() for name, value in values.items()}
    still = replace(scene, gaussians=replace(gaussians, **leaves))
    side = render(still.gaussians, cameras[len(cameras) // 4], outputs=OUTPUTS)
    images = (side.rgb, side.depth, side.alpha)
    return GeneratedScene(
        scene=scene,
        first_view=first.rgb,
        side_view=side.rgb.detach(),
        value_finite=all_finite([first.rgb, *images, *values.values()]),
        gradient_finite=finite_gradients(images, leaves),
    )
