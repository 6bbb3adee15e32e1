"""How large images are, and how much smaller the copy is that networks see."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from image_layers import random_rgb

from diff4splat.errors import ConfigError
from diff4splat.generation.inputs.image_size import (
    DEFAULT_SIDE_PX,
    default_side_px,
    downsampling_factor,
    find_image_size,
    image_plan,
    is_photograph,
    size_multiple_px,
)
from diff4splat.generation.inputs.input_image import InputImage, downsample
from diff4splat.generation.plan import FILL_PARTS
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.rays import camera_rays
from diff4splat.models.config.model import Fill, ModelConfig
from diff4splat.models.config.sizes import size_by_name, small_size
from diff4splat.models.hub.provenance import ModelProvenance, write_provenance
from diff4splat.models.hub.weight_files import CONFIG_FILE
from diff4splat.models.networks import PARTS


def folder_of(folder: Path, config: ModelConfig, *trained: str) -> str:
    """What says which parts are trained, without any weights."""
    folder.mkdir()
    (folder / CONFIG_FILE).write_text(config.to_json())
    write_provenance(ModelProvenance(trained=frozenset(trained)), folder)
    return str(folder)


def factor(
    size_px: tuple[int, int], trained: tuple[str, ...] = PARTS, fill: Fill | None = None
) -> int:
    config = small_size()
    return downsampling_factor(config, image_plan(config, trained, fill), size_px)


@pytest.mark.parametrize(
    ("size_px", "expected"),
    [
        ((64, 64), False),
        ((128, 128), False),  # The depth prior sees all of it.
        ((256, 256), True),
        ((512, 384), True),
        ((192, 288), True),
        ((208, 304), False),  # No smaller copy has whole tokens.
    ],
)
def test_photographs_are_larger_than_any_copy(size_px: tuple[int, int], expected: bool) -> None:
    assert is_photograph(small_size(), PARTS, None, size_px) == expected


def test_a_video_fill_still_has_photographs() -> None:
    assert is_photograph(small_size(), PARTS, "video", (256, 256))


@pytest.mark.parametrize(
    ("size_px", "expected"),
    [
        ((64, 64), 1),
        ((16, 16), 1),
        ((16, 1024), 1),
        ((128, 128), 2),
        ((256, 256), 4),
        ((192, 320), 4),
        ((512, 512), 8),
        ((192, 288), 3),
        ((224, 288), 2),
        ((208, 304), 1),
    ],
)
def test_the_factor_that_leaves_whole_tokens_nearest_the_trained_size(
    size_px: tuple[int, int], expected: int
) -> None:
    assert factor(size_px) == expected
    assert all(side % (expected * small_size().token_px) == 0 for side in size_px)


def test_where_ldrm_reconstructs_every_frame_networks_see_every_pixel() -> None:
    assert factor((256, 256), (*FILL_PARTS, "text_encoder"), "video") == 1
    config = size_by_name("test")
    plan = image_plan(config, ())
    assert downsampling_factor(config, plan, (256, 256)) == 1
    assert default_side_px(config, plan) == max(config.size_px)
    assert size_multiple_px(config, plan, 256) == config.token_px


@pytest.mark.parametrize(
    "trained", [(), PARTS, ("vae", "ldrm", "deformation"), ("monocular_depth",)]
)
def test_where_the_image_is_shown_it_is_larger_than_what_networks_see(
    trained: tuple[str, ...],
) -> None:
    config = small_size()
    plan = image_plan(config, trained)
    assert default_side_px(config, plan) == DEFAULT_SIDE_PX == 512
    assert factor((256, 256), trained) == 4


@pytest.mark.parametrize("fill", [None, "none", "video"])
@pytest.mark.parametrize(("side_px", "multiple_px"), [(256, 64), (128, 32), (64, 16), (32, 16)])
def test_sides_are_multiples_of_whole_tokens_of_the_smaller_copy(
    tmp_path: Path, fill: Fill | None, side_px: int, multiple_px: int
) -> None:
    folder = folder_of(tmp_path / "whole", small_size(), *PARTS)
    assert find_image_size(folder, fill=fill, photo_px=(256, 256)) == (256, 64)
    assert find_image_size(folder, side_px, fill) == (side_px, multiple_px)
    assert multiple_px == 16 * factor((side_px, side_px), fill=fill)


def test_a_size_is_decided_without_weights(tmp_path: Path) -> None:
    assert find_image_size("test") == (32, 16)
    assert find_image_size("test", fill="none") == (512, 256)
    filling = replace(small_size(), default_fill="video")
    partly = folder_of(tmp_path / "partly", filling, "vae", "ldrm", "deformation")
    assert find_image_size(partly) == (512, 128)
    with pytest.raises(ConfigError, match="--fill video"):
        find_image_size(partly, fill="video")


@pytest.mark.parametrize(
    ("photo_px", "side_px"),
    [(None, 512), ((3000, 4000), 512), ((400, 400), 400), ((100, 90), 256), ((300, 400), 346)],
)
def test_small_photographs_are_hardly_enlarged(
    photo_px: tuple[int, int] | None, side_px: int
) -> None:
    config = small_size()
    assert default_side_px(config, image_plan(config, PARTS), photo_px) == side_px


def photo() -> InputImage:
    camera = pinhole(10.0, (8, 12)).cropped((1, 2), (8, 12))
    return InputImage(rgb=random_rgb(8, 12), camera=camera, focal_source="test", notes=("rotated",))


def test_a_smaller_image_has_the_mean_of_each_cell() -> None:
    image = photo()
    small = downsample(image, 4)
    assert small.rgb.shape == (2, 3, 3)
    for row, column in ((0, 0), (1, 2), (0, 1)):
        cell = image.rgb[4 * row : 4 * row + 4, 4 * column : 4 * column + 4]
        torch.testing.assert_close(small.rgb[row, column], cell.mean((0, 1)))
    assert (small.focal_source, small.notes) == (image.focal_source, image.notes)
    assert small.reduction == 4 and downsample(image, 1) is image


def test_the_ray_of_a_cell_is_the_mean_of_those_of_its_pixels() -> None:
    image = photo()
    small = downsample(image, 4)
    assert small.camera.size_px == (2, 3)
    torch.testing.assert_close(small.camera.focal_px, image.camera.focal_px / 4)
    rays = camera_rays(image.camera).unflatten(1, (3, 4)).unflatten(0, (2, 4)).mean((1, 3))
    torch.testing.assert_close(camera_rays(small.camera), rays)
