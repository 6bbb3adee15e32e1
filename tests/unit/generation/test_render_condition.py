"""What the reconstruction guesses from one picture, seen along a path."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.render_condition import (
    input_gaussians,
    render_condition_latent,
    render_condition_video,
)
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.pretrained import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH

SIZE_PX, FOCAL_PX = (32, 48), 40.0
INSIDE = (slice(4, -4), slice(4, -4))
"""Away from the border, beyond which nothing is known."""


@pytest.fixture(scope="module")
def model() -> Model:
    config = tiny_size()
    config = replace(config, dit=replace(config.dit, draft=True))
    return Model(config=config, networks=create_networks(config, with_text=False))


def picture() -> InputImage:
    """Smooth, so that resampling changes little, and different everywhere."""
    y, x = torch.meshgrid(torch.arange(32) / 32, torch.arange(48) / 48, indexing="ij")
    rgb = torch.stack([x, y, 0.5 + 0.4 * torch.sin(4 * x + 3 * y)], -1)
    return InputImage(rgb=rgb, camera=pinhole(FOCAL_PX, SIZE_PX), focal_source="test")


def path(frames: int, step: float = 0.0) -> Camera:
    """To the right by ``step`` a frame."""
    poses = torch.eye(4).repeat(frames, 1, 1)
    poses[:, 0, 3] = step * torch.arange(frames)
    return pinhole(FOCAL_PX, SIZE_PX).with_pose(poses)


def frame(video: Tensor, number: int) -> Tensor:
    return video[0, :, number].movedim(0, -1)


def test_the_first_frame_is_the_picture_itself(model: Model) -> None:
    video = render_condition_video(model, picture(), path(5, step=0.1))
    assert video.shape == (1, 3, 5, *SIZE_PX)
    assert torch.equal(frame(video, 0), picture().rgb)


def test_a_standing_camera_sees_the_picture_at_every_moment(model: Model) -> None:
    video = render_condition_video(model, picture(), path(5))
    for number in range(1, 5):
        seen, shown = frame(video, number)[INSIDE], picture().rgb[INSIDE]
        torch.testing.assert_close(seen, shown, atol=0.03, rtol=0)


def test_a_moving_camera_sees_the_plane_from_elsewhere(model: Model) -> None:
    pixels = 3
    video = render_condition_video(model, picture(), path(3, step=pixels * PLANE_DEPTH / FOCAL_PX))
    for number in (1, 2):
        shift = number * pixels
        seen = frame(video, number)[4:-4, 4 : -4 - shift]
        torch.testing.assert_close(seen, picture().rgb[4:-4, 4 + shift : -4], atol=0.03, rtol=0)


def test_colours_are_colours(model: Model) -> None:
    bright = replace(picture(), rgb=torch.ones(*SIZE_PX, 3))
    video = render_condition_video(model, bright, path(2))
    assert float(video.min()) >= 0 and float(video.max()) <= 1


@pytest.mark.parametrize("frames", [1, 5, 9])
def test_the_latent_has_the_grid_of_the_video(model: Model, frames: int) -> None:
    latent = render_condition_latent(model, picture(), path(frames, step=0.1))
    assert latent.shape == (1, 4, *model.config.latent_grid(frames, SIZE_PX))
    assert not latent.requires_grad
    first = render_condition_latent(model, picture(), path(1))
    torch.testing.assert_close(latent[:, :, :1], first)


def test_a_path_of_one_frame_shows_the_picture(model: Model) -> None:
    video = render_condition_video(model, picture(), path(1))
    assert torch.equal(video[0, :, 0].movedim(0, -1), picture().rgb)


def test_nothing_is_pruned(model: Model) -> None:
    gaussians = input_gaussians(model, picture(), path(1))
    assert len(gaussians) == SIZE_PX[0] * SIZE_PX[1]
