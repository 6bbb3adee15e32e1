"""A portrait with the bundled weights: the shoulders belong to the head, not to the wall."""

import cv2
import numpy as np
import pytest
import torch

from diff4splat.generation.inputs.copies import Copies
from diff4splat.generation.inputs.input_image import choose_focal, downsample, prepare_image
from diff4splat.generation.priors import image_maps
from diff4splat.models.hub.model import load_model
from diff4splat.progress.run_log import RunLog

SIDE_PX = 256
FACE, SUIT, WALL = (0.3, 0.45, 0.45, 0.6), (0.75, 0.95, 0.3, 0.7), (0.2, 0.4, 0.85, 1.0)
"""First and last row and column, as shares of the sides."""
pytestmark = pytest.mark.photo


def officer() -> np.ndarray:
    cbook = pytest.importorskip("matplotlib.cbook", reason="needs matplotlib's photograph")
    with cbook.get_sample_data("grace_hopper.jpg") as file:
        image = cv2.imdecode(np.frombuffer(file.read(), np.uint8), cv2.IMREAD_COLOR)
    return image[..., ::-1]


def median_depth(depth: torch.Tensor, window: tuple[float, ...]) -> float:
    top, bottom, left, right = (round(share * len(depth)) for share in window)
    return float(depth[top:bottom, left:right].median())


@torch.no_grad()
@pytest.mark.parametrize(("mirrored", "light"), [(False, 1.0), (True, 1.0), (False, 0.6)])
def test_shoulders_are_as_near_as_the_head(mirrored: bool, light: float) -> None:
    rgb = torch.from_numpy(officer().copy()).float() * light / 255
    rgb = rgb.flip(1) if mirrored else rgb
    photo = prepare_image(rgb, choose_focal(rgb.shape[:2], None, None), SIDE_PX)
    copies = Copies(image=photo, small=downsample(photo, 4))
    model = load_model("small", parts=("monocular_depth",))
    depth = image_maps(model, copies, 1, [], RunLog()).fine.depth
    depth = depth.flip(1) if mirrored else depth
    face, suit, wall = (median_depth(depth, window) for window in (FACE, SUIT, WALL))
    assert suit < 1.3 * face and wall > 1.7 * face
