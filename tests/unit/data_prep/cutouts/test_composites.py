"""Cutouts before a photograph: pixels and numbers of objects agree."""

from dataclasses import replace

import numpy as np
import pytest

from diff4splat.data_prep.cutouts import composite
from diff4splat.data_prep.cutouts.change import LOG_GAIN, LOG_SLOPE, lit, recolored, textured
from diff4splat.data_prep.cutouts.composite import compose
from diff4splat.data_prep.cutouts.cutout import Cutout
from diff4splat.data_prep.cutouts.placement import Placement, draw_placement, placed

SIZE = (48, 64)


def cutout(color: tuple[float, float, float] = (0.7, 0.1, 0.1), side: int = 30) -> Cutout:
    rgba = np.ones((side, side, 4), np.float32)
    rgba[..., :3] = color
    return Cutout(noun="apple", rgba=rgba)


def photograph(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (90, 70, 3), dtype=np.uint8)


def test_equal_seeds_give_equal_images() -> None:
    first, again = (
        compose(photograph(), [cutout()], SIZE, np.random.default_rng(3)) for _ in range(2)
    )
    assert np.array_equal(first.rgb, again.rgb) and np.array_equal(first.numbers, again.numbers)
    other = compose(photograph(), [cutout()], SIZE, np.random.default_rng(4))
    assert not np.array_equal(first.rgb, other.rgb)


def test_numbers_mark_the_pixels_that_show_the_object(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(composite, "lit", lambda one, random: one)
    black = np.zeros((80, 80, 3), np.uint8)
    seen = compose(black, [cutout((0.0, 0.0, 1.0))], SIZE, np.random.default_rng(1), True)
    assert seen.rgb.shape == (*SIZE, 3) and seen.numbers.shape == SIZE
    assert set(np.unique(seen.numbers)) == {0, 1}
    assert np.array_equal(seen.rgb[..., 2] > 127, seen.numbers == 1)
    assert seen.objects[0].noun == "apple" and seen.objects[0].color == "blue"


def centred(one: Cutout, size_px: tuple[int, int], random: np.random.Generator) -> Placement:
    """In the middle, as large as it is."""
    half = 0.5 * np.array(one.rgba.shape[1::-1])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return Placement(
        corners_px=(corners + np.array(size_px[::-1]) / 2).astype(np.float32), blur_px=0.0
    )


@pytest.mark.parametrize("sides", [(30, 20), (20, 30)])
def test_small_objects_lie_before_large_ones(
    monkeypatch: pytest.MonkeyPatch, sides: tuple[int, int]
) -> None:
    monkeypatch.setattr(composite, "draw_placement", centred)
    cutouts = [cutout(side=side) for side in sides]
    one = compose(photograph(), cutouts, SIZE, np.random.default_rng(0))
    areas = [int((one.numbers == number).sum()) for number in (1, 2)]
    assert areas == [30 * 30 - 20 * 20, 20 * 20] and len(one.objects) == 2


def test_pixels_that_are_half_transparent_mix_with_the_photograph() -> None:
    half = cutout((1.0, 0.5, 0.0))
    half.rgba[..., 3] = 0.5
    layer = placed(half, centred(half, SIZE, np.random.default_rng(0)), SIZE)
    assert np.allclose(layer[24, 32], [0.5, 0.25, 0.0, 0.5], atol=1e-5)


def test_without_cutouts_the_photograph_remains() -> None:
    one = compose(photograph(), [], SIZE, np.random.default_rng(0))
    assert not one.numbers.any() and one.objects == () and one.rgb.std() > 10


def test_a_placed_cutout_fills_its_corners() -> None:
    corners = np.array([[10, 10], [40, 10], [40, 30], [10, 30]], np.float32)
    layer = placed(cutout(), Placement(corners_px=corners, blur_px=0.0), SIZE)
    assert abs(float(layer[..., 3].sum()) - 30 * 20) < 30
    assert layer[20, 20, 3] == pytest.approx(1, abs=1e-5) and layer[5, 5, 3] == 0
    assert np.allclose(layer[20, 20, :3], cutout().rgba[0, 0, :3], atol=1e-5)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (300, 2)])
def test_thin_and_tiny_pictures_are_placed(shape: tuple[int, int]) -> None:
    thin = Cutout(noun="pen", rgba=np.ones((*shape, 4), np.float32))
    for seed in range(10):
        placement = draw_placement(thin, SIZE, np.random.default_rng(seed))
        layer = placed(thin, placement, SIZE)
        assert np.isfinite(layer).all() and layer.min() >= 0 and layer.max() <= 1 + 1e-5


def test_changes_keep_opacity_and_range() -> None:
    random, plain = np.random.default_rng(0), np.full((60, 60, 3), 90, np.uint8)
    picture = cutout()
    picture.rgba[:5, :, 3] = 0.25
    for _ in range(12):
        for changed in (
            recolored(picture, random),
            lit(picture, random),
            textured(picture, photograph(), random),
            textured(picture, plain, random),
        ):
            assert np.array_equal(changed.rgba[..., 3], picture.rgba[..., 3])
            assert changed.rgba.min() >= 0 and changed.rgba.max() <= 1
    largest = np.exp(LOG_GAIN + LOG_SLOPE)
    grey = replace(picture, rgba=np.full((8, 8, 4), 0.2, np.float32))
    assert lit(grey, random).rgba[..., :3].max() <= 0.2 * largest + 1e-5
