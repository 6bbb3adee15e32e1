"""Images on surfaces: bilinear between texels, averaged where pixels are larger, repeated."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from diff4splat.data.clip import ClipMetadata
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.jit import GROUP, kernel
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.renderer.textures.images import (
    SIDE,
    TEXELS,
    image_color,
    image_stacks,
)
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import build_triangle_buffer
from diff4splat.data_prep.synthetic.world import Light, Mesh, Sky, Texture, World, WorldObject
from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import pinhole


@kernel
def looked_up(stacks, places, footprint, colors):
    """Colours of the first image at places (n 2)."""
    for index in range(len(places)):
        found = image_color(stacks, 0, places[index, 0], places[index, 1], footprint)
        for at in range(3):
            colors[index, at] = found[at]


GROUP.kernels.remove(looked_up)


def colors_at(image: np.ndarray, places: np.ndarray, footprint: float) -> np.ndarray:
    stacks, numbers = image_stacks(build_triangle_buffer(world(image)))
    assert stacks.shape == (1, TEXELS, 3) and numbers.tolist() == [0]
    colors = np.zeros((len(places), 3))
    looked_up(stacks, np.ascontiguousarray(places, np.float64), footprint, colors)
    return colors


def random_image(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (SIDE, SIDE, 3), np.uint8)


def linear(image: np.ndarray) -> np.ndarray:
    value = image / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def quad() -> WorldObject:
    corners = np.array([[-1.0, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    mesh = Mesh(
        triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32), rest=corners, uv=uv, smooth=False
    )
    texture = Texture(family="plain", colors=np.full((2, 3), 0.5), scale=1.0, seed=0)
    return WorldObject(instance=1, mesh=mesh, texture=texture, positions=corners[None])


def world(image: np.ndarray | None, family: str = "image") -> World:
    """A square that fills the view, in even light."""
    item = quad()
    item = replace(item, texture=replace(item.texture, family=family, image=image))
    camera = pinhole(32.0, (32, 32), torch.float64)
    return World(
        note=ClipMetadata(identifier="a", source="a", license="CC0-1.0", metric="exact"),
        times_s=np.zeros(1),
        objects=(item,),
        light=Light(
            color=np.ones(3), toward=np.array([0.0, 0, -1]), sky=np.ones(3), ground=np.ones(3)
        ),
        sky=Sky(zenith=np.ones(3), horizon=np.ones(3), clouds=0.0, haze_per_m=0.0, seed=0),
        views=(camera.with_pose(torch.eye(4, dtype=torch.float64)[None]),),
    )


def test_texels_are_exact_at_their_middles() -> None:
    image = random_image()
    rows, columns = np.indices((SIDE, SIDE)).reshape(2, -1)
    places = (np.stack([columns, rows], -1) + 0.5) / SIDE
    expected = linear(image).reshape(-1, 3)
    np.testing.assert_allclose(colors_at(image, places, 0.0), expected, atol=1e-6)


def bilinear(light: np.ndarray, places: np.ndarray) -> np.ndarray:
    """By the formula, between the four texels around each place; the image repeats."""
    side = len(light)
    x, y = (places * side - 0.5).T
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    a, b = (x - left)[:, None], (y - top)[:, None]

    def at(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return light[row % side, column % side]

    above = at(top, left) * (1 - a) + at(top, left + 1) * a
    below = at(top + 1, left) * (1 - a) + at(top + 1, left + 1) * a
    return above * (1 - b) + below * b


def test_between_texels_it_is_bilinear_and_wraps_around() -> None:
    image, places = random_image(1), np.random.default_rng(2).uniform(-3, 3, (500, 2))
    expected = bilinear(linear(image), places)
    np.testing.assert_allclose(colors_at(image, places, 0.0), expected, atol=1e-5)


@pytest.mark.parametrize(("footprint", "block"), [(0.9 / SIDE, 1), (2 / SIDE, 2), (0.25, 32)])
def test_large_pixels_see_means_of_blocks_as_large(footprint: float, block: int) -> None:
    image, places = random_image(3), np.random.default_rng(4).uniform(-3, 3, (500, 2))
    count = SIDE // block
    means = linear(image).reshape(count, block, count, block, 3).mean((1, 3))
    found = colors_at(image, places, footprint)
    np.testing.assert_allclose(found, bilinear(means, places), atol=1e-5)


def test_far_away_and_huge_coordinates_are_the_mean_and_finite() -> None:
    image = random_image(4)
    places = np.array([[0.3, 0.7], [1e300, -1e300], [-1e9, 1e15], [0.0, 0.0]])
    found = colors_at(image, places, 1e30)
    np.testing.assert_allclose(found, np.tile(linear(image).mean((0, 1)), (4, 1)), atol=1e-5)
    assert np.isfinite(colors_at(image, places, 0.0)).all()


def test_a_drawn_image_is_upright_and_has_its_colours() -> None:
    image = np.zeros((SIDE, SIDE, 3), np.uint8)
    image[: SIDE // 2, : SIDE // 2] = (255, 0, 0)
    image[: SIDE // 2, SIDE // 2 :] = (0, 255, 0)
    image[SIDE // 2 :, : SIDE // 2] = (0, 0, 255)
    clip = draw_clip(world(image), DrawSettings(tracks=0, flow=False, shadow_px=64))
    rgb = clip.views[0].rgb[0].numpy().astype(int)
    for (row, column), channel in {(8, 8): 0, (8, 24): 1, (24, 8): 2}.items():
        assert rgb[row, column].argmax() == channel
        assert rgb[row, column, channel] > np.delete(rgb[row, column], channel).max() + 60
    assert rgb[24, 24].max() < 60


def test_equal_images_are_stored_once() -> None:
    made = world(random_image())
    two = tuple(replace(made.objects[0], instance=number) for number in (1, 2))
    stacks, numbers = image_stacks(build_triangle_buffer(replace(made, objects=two)))
    assert len(stacks) == 1 and numbers.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("image", "family"),
    [
        (np.zeros((64, 64, 3), np.uint8), "image"),
        (None, "image"),
        (np.zeros((SIDE, SIDE, 3), np.uint8), "plain"),
    ],
)
def test_images_that_do_not_fit_are_refused(image: np.ndarray | None, family: str) -> None:
    with pytest.raises(ConfigError, match="expected an image"):
        draw_clip(world(image, family), DrawSettings(tracks=0, flow=False, shadow_px=16))
