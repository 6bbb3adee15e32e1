"""Eight fixed inputs: four photographs of scikit-image, and four drawn worlds.

Ten more, from number 8 on, are for what is fitted to the shipped networks: nothing is measured on
inputs that it was fitted to.

Nothing is downloaded: the photographs come with scikit-image, the worlds are of the split that no
model was trained on. Each has a camera path and a prompt that asks for motion.
"""

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.errors import MissingExtraError
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.io.pixels import unit_rgb

Inputs = tuple[int, ...]
"""Which of them."""

PHOTOGRAPHS = ("astronaut", "chelsea", "coffee", "rocket")
WORLDS = (3, 5, 8, 11)
"""Indices of drawn worlds in each of which something moves."""
OTHER_PHOTOGRAPHS = ("camera", "coins", "moon", "brick")
OTHER_WORLDS = (13, 17, 21, 29, 33, 37)
MEASURED = len(PHOTOGRAPHS) + len(WORLDS)
WORLD_SEED = 7
SIDE_PX = 128
"""Of the images; networks see a copy of 64 pixels."""
FOCAL = 0.9
"""Focal length of the photographs in image widths: a 32 mm lens."""
PATH = "arc:0.15"
PROMPT = "the red block slides to the left"


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageInput:
    """One image with what a generation is asked about it."""

    name: str
    image: InputImage
    prompt: str
    path: str = PATH


@cache
def image_input(index: int) -> ImageInput:
    """One of the eight: photographs, then worlds; from 8 on one of the ten others, likewise.

    Raises:
        MissingExtraError: scikit-image is not installed.
    """
    names, worlds = PHOTOGRAPHS, WORLDS
    if index >= MEASURED:
        index, names, worlds = index - MEASURED, OTHER_PHOTOGRAPHS, OTHER_WORLDS
    if index >= len(names):
        return _world(worlds[index - len(names)])
    require_photographs()
    return _photograph(names[index])


def require_photographs() -> None:
    """Refuse where the photographs are absent.

    Raises:
        MissingExtraError: scikit-image is not installed.
    """
    if find_spec("skimage") is None:
        raise MissingExtraError(
            "photographs of the report: expected scikit-image, got none; "
            "pip install 'diff4splat[report]'"
        )


@cache
def world_clip(index: int, frames: int = 5, views: int = 1, side_px: int = SIDE_PX) -> Clip:
    """A drawn world in which something moves."""
    recipe = WorldRecipe(
        seed=WORLD_SEED,
        split="held_out",
        still_share=0.0,
        frames=frames,
        size_px=(side_px, side_px),
        views=views,
        rig=views > 1,
    )
    return draw_clip(make_world(recipe, index), DrawSettings(tracks=8, flow=False))


def _photograph(name: str) -> ImageInput:
    from skimage import data

    pixels = torch.from_numpy(getattr(data, name)().copy())
    pixels = pixels[..., None].expand(-1, -1, 3) if pixels.ndim == 2 else pixels[..., :3]
    camera = pinhole(FOCAL * SIDE_PX, (SIDE_PX,) * 2)
    return ImageInput(name=name, image=_image(_square(unit_rgb(pixels)), camera), prompt=PROMPT)


def _world(index: int) -> ImageInput:
    clip = world_clip(index)
    view = clip.views[0]
    camera = pinhole(float(view.cameras.focal_px.flatten()[0]), (SIDE_PX,) * 2)
    return ImageInput(
        name=f"world-{index}",
        image=_image(unit_rgb(view.rgb[0]), camera),
        prompt=clip.note.caption,
    )


def _image(rgb: Float[Tensor, "h w 3"], camera: Camera) -> InputImage:
    return InputImage(rgb=rgb, camera=camera.to(torch.float32), focal_source="report")


def _square(rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "s s 3"]:
    """The middle of an image, averaged to the side of the inputs."""
    height, width = rgb.shape[:2]
    side = min(height, width)
    top, left = (height - side) // 2, (width - side) // 2
    middle = rgb[top : top + side, left : left + side].movedim(-1, 0)[None]
    small = torch.nn.functional.interpolate(middle, (SIDE_PX,) * 2, mode="area")
    return small[0].movedim(0, -1).contiguous()
