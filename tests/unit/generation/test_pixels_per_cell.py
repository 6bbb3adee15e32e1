"""How much smaller a copy of the picture networks see."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from diff4splat.generation.input_image import InputImage, downsample
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.rays import camera_rays
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import size_by_name, small_size
from diff4splat.models.factory import PARTS, create_networks
from diff4splat.models.hub.pretrained import Model, find_multiple_px, find_side_px
from diff4splat.models.hub.provenance import ModelProvenance, write_provenance
from diff4splat.models.hub.weights import CONFIG_FILE

SHOWN = (192, 320)


def model_of(config: ModelConfig, *trained: str) -> Model:
    networks = create_networks(config, "meta", with_text=False)
    return Model(config=config, networks=networks, trained=frozenset(trained))


@pytest.fixture(scope="module")
def whole() -> Model:
    return model_of(small_size(), *PARTS)


def folder_of(folder: Path, config: ModelConfig, *trained: str) -> Path:
    """What says which parts are trained, without any weights."""
    folder.mkdir()
    (folder / CONFIG_FILE).write_text(config.to_json())
    write_provenance(ModelProvenance(trained=frozenset(trained)), folder)
    return folder


@pytest.mark.parametrize(
    ("size_px", "count"),
    [
        ((64, 64), 1),
        ((16, 16), 1),
        ((128, 128), 2),
        ((256, 256), 4),
        (SHOWN, 4),
        ((512, 512), 8),
        ((192, 288), 3),
        ((224, 288), 2),
        ((208, 304), 1),
    ],
)
def test_the_largest_count_that_leaves_whole_tokens(
    whole: Model, size_px: tuple[int, int], count: int
) -> None:
    assert whole.pixels_per_cell(size_px) == count
    assert all(side % (count * whole.config.token_px) == 0 for side in size_px)


@pytest.mark.parametrize("trained", [(), ("vae", "ldrm", "deformation")])
def test_without_a_trained_video_model_every_pixel_is_seen(trained: tuple[str, ...]) -> None:
    model = model_of(small_size(), *trained)
    assert model.pixels_per_cell((256, 256)) == 1


@pytest.mark.parametrize("name", ["test", "small"])
def test_without_a_detail_decoder_every_pixel_is_seen(name: str) -> None:
    config = size_by_name(name)
    model = model_of(replace(config, detail=replace(config.detail, width=0)), *PARTS)
    assert model.pixels_per_cell((256, 256)) == 1
    assert model.side_px == max(config.size_px)


def test_pictures_are_larger_than_what_networks_see(whole: Model) -> None:
    assert whole.side_px == 256
    assert whole.pixels_per_cell((whole.side_px, whole.side_px)) == 4


@pytest.mark.parametrize(("side_px", "multiple_px"), [(256, 64), (128, 32), (64, 16), (32, 16)])
def test_sides_are_multiples_of_whole_tokens_of_the_smaller_copy(
    tmp_path: Path, whole: Model, side_px: int, multiple_px: int
) -> None:
    folder = folder_of(tmp_path / "whole", small_size(), *PARTS)
    assert find_side_px(folder) == whole.side_px
    assert find_multiple_px(folder, side_px) == multiple_px
    assert multiple_px == 16 * whole.pixels_per_cell((side_px, side_px))


def test_otherwise_sides_are_multiples_of_one_token(tmp_path: Path) -> None:
    partly = folder_of(tmp_path / "partly", small_size(), "vae", "ldrm", "deformation")
    plain = folder_of(tmp_path / "plain", size_by_name("test"), *PARTS)
    assert find_multiple_px(partly, 256) == find_multiple_px(plain, 256) == 16
    assert find_multiple_px("test", 256) == 16


def picture() -> InputImage:
    rgb, camera = torch.rand(8, 12, 3), pinhole(10.0, (8, 12)).cropped((1, 2), (8, 12))
    return InputImage(rgb=rgb, camera=camera, focal_source="test", notes=("turned",))


def test_a_smaller_picture_is_the_mean_over_each_cell() -> None:
    given = picture()
    found = downsample(given, 4)
    assert found.rgb.shape == (2, 3, 3)
    for row, column in ((0, 0), (1, 2), (0, 1)):
        cell = given.rgb[4 * row : 4 * row + 4, 4 * column : 4 * column + 4]
        torch.testing.assert_close(found.rgb[row, column], cell.mean((0, 1)))
    assert (found.focal_source, found.notes) == (given.focal_source, given.notes)


def test_a_cell_of_the_smaller_picture_looks_where_its_pixels_do() -> None:
    given = picture()
    found = downsample(given, 4)
    assert found.camera.size_px == (2, 3)
    torch.testing.assert_close(found.camera.focal_px, given.camera.focal_px / 4)
    rays = camera_rays(given.camera).unflatten(1, (3, 4)).unflatten(0, (2, 4)).mean((1, 3))
    torch.testing.assert_close(camera_rays(found.camera), rays)


def test_a_picture_of_its_own_size_is_itself() -> None:
    given = picture()
    assert downsample(given, 1) is given
