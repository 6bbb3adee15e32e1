"""The layered image along a path: what the video model is conditioned on."""

from dataclasses import replace

import pytest
import torch
from image_layers import input_image, sliding_path
from torch import Tensor

from diff4splat.generation.layered_image.build import build_layered_image
from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.types import LayeredImage
from diff4splat.generation.video.render_condition import (
    MIN_COVERAGE,
    RenderedImage,
    encode_condition,
    render_layered_image,
)
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model
from diff4splat.render.api import UNDILATED, render

SIZE_PX, FOCAL_PX, DEPTH = (32, 48), 40.0, 4.0
STEP = 3 * DEPTH / FOCAL_PX
"""Scene units by which a camera sees the plane three pixels further."""


def smooth() -> Tensor:
    """Resampling changes little, and no two places are alike."""
    y, x = torch.meshgrid(torch.arange(32) / 32, torch.arange(48) / 48, indexing="ij")
    return torch.stack([x, y, 0.5 + 0.4 * torch.sin(4 * x + 3 * y)], -1)


def plane(displacement: Tensor | None = None, rgb: Tensor | None = None) -> LayeredImage:
    image = input_image(smooth() if rgb is None else rgb, FOCAL_PX)
    maps = ImageMaps(depth=torch.full(SIZE_PX, DEPTH), displacement=displacement)
    return build_layered_image(image, image, maps, 2)


def along(image: LayeredImage, frames: int, step: float = 0.0) -> RenderedImage:
    path = sliding_path(image.layers[0].camera, frames, (step, 0.0, 0.0))
    return render_layered_image(image, path, path.times_s)


@pytest.mark.parametrize("frames", [1, 5])
def test_the_first_frame_is_the_image_itself(frames: int) -> None:
    rendered = along(plane(), frames, step=0.1)
    assert rendered.rgb.shape == (frames, *SIZE_PX, 3)
    assert torch.equal(rendered.rgb[0], smooth())
    assert bool(rendered.valid[0].all())
    assert torch.equal(rendered.depth[0], torch.full(SIZE_PX, DEPTH))


def test_a_static_camera_sees_the_image_in_every_frame() -> None:
    rendered = along(plane(), 3)
    inner = (slice(None), slice(4, -4), slice(4, -4))
    wanted = smooth().expand(3, *SIZE_PX, 3)[inner]
    torch.testing.assert_close(rendered.rgb[inner], wanted, atol=0.03, rtol=0)
    assert bool(rendered.valid.all())


def test_a_camera_that_slides_sees_the_plane_from_there() -> None:
    rendered = along(plane(), 3, step=STEP)
    for frame in (1, 2):
        shift = 3 * frame
        view = rendered.rgb[frame, 4:-4, 4 : -4 - shift]
        torch.testing.assert_close(view, smooth()[4:-4, 4 + shift : -4], atol=0.03, rtol=0)
        depth = rendered.depth[frame, 4:-4, 4 : -4 - shift]
        torch.testing.assert_close(depth, torch.full_like(depth, DEPTH), atol=0.05, rtol=0)


def test_a_pixel_is_valid_exactly_where_the_image_covers_it() -> None:
    rendered = along(plane(), 3, step=STEP)
    for frame in (1, 2):
        wanted = torch.ones(SIZE_PX, dtype=torch.bool)
        wanted[:, -3 * frame :] = False
        assert torch.equal(rendered.valid[frame], wanted)
        hidden = rendered.depth[frame][:, 1 - 3 * frame :]
        assert not hidden.any(), "no depth where the image shows nothing"


def test_validity_counts_layers_of_the_image_alone() -> None:
    image = plane()
    path = sliding_path(image.layers[0].camera, 2, (2 * STEP, 0.0, 0.0))
    rendered = render_layered_image(image, path, path.times_s)
    shown = [layer for layer in image.layers if layer.in_image]
    views = [
        render(layer_gaussians(each), path.cameras[1], outputs=("alpha",), settings=UNDILATED)
        for each in shown
    ]
    together = 1 - (1 - views[0].alpha) * (1 - views[1].alpha)
    assert torch.equal(rendered.valid[1], together > MIN_COVERAGE)
    covered = ~rendered.valid[1]
    assert float(rendered.rgb[1][covered].amax(-1).min()) > 0.02, "a guess is rendered there"


def test_a_pixel_behind_a_depth_edge_is_not_valid() -> None:
    depth = torch.full(SIZE_PX, 12.0)
    depth[8:24, 12:24] = 3.0
    image = input_image(smooth(), FOCAL_PX)
    image = build_layered_image(image, image, ImageMaps(depth=depth, displacement=None), 2)
    rendered = along(image, 2, step=-0.9)
    # The box is 12 px to the right, its background 3 px; between them is the sheet of the infill.
    gap = rendered.valid[1, 10:22, 16:22]
    assert int(gap.sum(1).max()) <= 1
    assert bool(rendered.valid[1, 10:22, 26:34].all())


def test_the_motion_of_the_image_is_applied() -> None:
    displacement = torch.zeros(2, *SIZE_PX, 3)
    displacement[1, ..., 0] = 2 * STEP
    moved, still = along(plane(displacement), 3), along(plane(), 3)
    assert torch.equal(moved.rgb[0], still.rgb[0])
    for frame in (1, 2):
        shift = 3 * frame
        view = moved.rgb[frame, 4:-4, 4 + shift : -4]
        torch.testing.assert_close(view, smooth()[4:-4, 4 : -4 - shift], atol=0.03, rtol=0)
        assert not moved.valid[frame, :, : shift - 1].any()


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_colours_stay_in_range(value: float) -> None:
    rendered = along(plane(rgb=torch.full((*SIZE_PX, 3), value)), 2, step=0.1)
    assert float(rendered.rgb.min()) >= 0 and float(rendered.rgb.max()) <= 1
    assert bool(rendered.depth.isfinite().all())


@pytest.fixture(scope="module")
def model() -> Model:
    config = tiny_size()
    config = replace(config, dit=replace(config.dit, render_condition=True))
    return Model(config=config, networks=create_networks(config, parts=("vae",)))


@pytest.mark.parametrize("frames", [1, 5, 9])
def test_the_condition_has_the_grid_of_the_video(model: Model, frames: int) -> None:
    rendered = along(plane(), frames, step=0.2)
    condition = encode_condition(model, rendered)
    assert condition.latent.shape == (1, 4, *model.config.latent_grid(frames, SIZE_PX))
    assert not condition.latent.requires_grad
    assert torch.equal(condition.validity[0, 0], rendered.valid.float())
    first = encode_condition(model, along(plane(), 1)).latent
    torch.testing.assert_close(condition.latent[:, :, :1], first)
