"""Given depth is cut and turned as the photograph is."""

from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image, ImageOps

from diff4splat.errors import ConfigError, InputError
from diff4splat.generation.given_depth.maps import given_depth, resized_depth
from diff4splat.generation.given_depth.source import FileDepth, open_depth
from diff4splat.generation.inputs.input_image import InputImage, load_image
from diff4splat.io.photos.upright import upright_array
from diff4splat.progress.run_log import RunLog


def pattern(height: int, width: int) -> np.ndarray:
    """Red that is the depth, in 8 bits: every pixel has its own neighbourhood."""
    y, x = np.mgrid[0:height, 0:width]
    return np.round(60 + 90 * x / width + 90 * y / height).astype(np.uint8)


def photo(file: Path, red: np.ndarray, orientation: int = 1) -> Path:
    exif = Image.Exif()
    exif[0x0112] = orientation
    rgb = np.stack([red, np.full_like(red, 9), np.full_like(red, 9)], -1)
    Image.fromarray(rgb).save(file, exif=exif)
    return file


def depth_of(image: InputImage, file: Path) -> torch.Tensor:
    return given_depth(FileDepth(file, "metric"), image, RunLog())


def agreement(image: InputImage, depth: torch.Tensor) -> float:
    """Correlation of depth with the red that it was made of."""
    red = image.rgb[..., 0]
    return float(torch.corrcoef(torch.stack([red.flatten(), depth.flatten()]))[0, 1])


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("upright", [True, False])
@pytest.mark.parametrize("scale", [1, 3])
def test_maps_follow_the_orientation_of_the_photo(
    tmp_path: Path, orientation: int, upright: bool, scale: int
) -> None:
    """As it looks, or as the sensor had it where the sides tell."""
    red = pattern(96, 150)
    file = photo(tmp_path / "a.png", red, orientation)
    image = load_image(file, 64)
    values = upright_array(red, orientation) if upright or orientation < 5 else red
    np.save(tmp_path / "d.npy", np.repeat(np.repeat(values, scale, 0), scale, 1).astype(np.float32))
    assert agreement(image, depth_of(image, tmp_path / "d.npy")) > 0.99


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turns_are_those_of_pillow(orientation: int) -> None:
    values = np.arange(6, dtype=np.uint8).reshape(2, 3)
    image = Image.fromarray(values)
    image.getexif()[0x0112] = orientation
    np.testing.assert_array_equal(
        upright_array(values, orientation), np.asarray(ImageOps.exif_transpose(image))
    )


@pytest.mark.parametrize("fit", ["crop", "pad"])
@pytest.mark.parametrize("shape", [(60, 150), (150, 60), (100, 100)])
def test_maps_are_cut_and_padded_as_the_photo(
    tmp_path: Path, fit: str, shape: tuple[int, int]
) -> None:
    red = pattern(*shape)
    image = load_image(photo(tmp_path / "a.png", red), 64, multiple_px=32, fit=fit)
    np.save(tmp_path / "d.npy", red.astype(np.float32))
    assert agreement(image, depth_of(image, tmp_path / "d.npy")) > 0.985


def test_another_shape_is_refused(tmp_path: Path) -> None:
    image = load_image(photo(tmp_path / "a.png", pattern(96, 150)), 64)
    np.save(tmp_path / "d.npy", pattern(96, 130).astype(np.float32))
    with pytest.raises(InputError, match=r"expected the shape of the photo, 150×96 .* got 130×96"):
        depth_of(image, tmp_path / "d.npy")


def test_numbers_without_a_kind_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "d.npy", pattern(9, 9))
    with pytest.raises(ConfigError, match="expected --depth-kind"):
        open_depth(tmp_path / "d.npy")


def test_edges_of_depth_stay_sharp() -> None:
    depth = np.where(np.arange(90) < 45, 2.0, 20.0)[None].repeat(90, 0).astype(np.float32)
    for side in (30, 60, 200):
        assert set(np.unique(resized_depth(depth, (side, side)).round(3))) == {2.0, 20.0}


def test_slopes_are_linear_in_inverse_depth() -> None:
    inverse = np.linspace(1, 1.3, 120, dtype=np.float32)[None].repeat(120, 0)
    found = 1 / resized_depth(1 / inverse, (40, 40))
    np.testing.assert_allclose(found[0], inverse[0].reshape(40, 3).mean(1), rtol=2e-3)
