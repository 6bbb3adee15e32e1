"""Shadows fall where geometry says, contact darkens, and nothing shades itself."""

from dataclasses import replace

import numpy as np
import oracles_drawing as oracle
import pytest

from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings

SIZE = (48, 48)
SETTINGS = DrawSettings(samples_per_side=2, tracks=0, flow=False, shadow_px=256)
GRAY = {"colors": np.full((2, 3), 0.4)}


def from_above(objects, toward, softness: float = 0.0, sun: float = 1.0, **changes) -> np.ndarray:
    """Brightness of an image from 8 m above the origin that shows 8 m × 8 m of the ground."""
    camera = oracle.straight(1, SIZE)
    camera.world_from_camera[0, :3, :3] = oracle.looking_down()
    camera.world_from_camera[0, :3, 3] = oracle.torch.tensor([0.0, -8.0, 0.0])
    camera.focal_px[:] = SIZE[0]
    light = oracle.light(toward, softness)
    light = replace(light, color=sun * light.color)
    scene = oracle.world(objects, [camera], 1, light=light, **changes)
    return draw_clip(scene, SETTINGS).views[0].rgb[0].float().mean(-1).numpy()


def gray_ground() -> object:
    return oracle.thing(1, oracle.ground(12.0, 4), oracle.texture("plain", 1.0, **GRAY))


def plate(height_m: float) -> object:
    corners = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], float)
    corners[:, 1] = -height_m
    shape = oracle.mesh(corners, [[0, 1, 2], [0, 2, 3]])
    return oracle.thing(2, shape, oracle.texture("plain", 1.0, **GRAY))


@pytest.mark.parametrize("toward", [(1.0, -1.0, 0.0), (-0.5, -1.0, 0.8)])
def test_a_plate_shades_the_ground_behind_it(toward: tuple) -> None:
    height = 2.0
    lit = from_above([gray_ground()], toward)
    seen = from_above([gray_ground(), plate(height)], toward) / lit
    y, x = (np.indices(SIZE) + 0.5) / 48 * 8 - 4
    ground_x, ground_z = x, -y
    shift_x, shift_z = -toward[0] * height / -toward[1], -toward[2] * height / -toward[1]
    far = np.maximum(abs(ground_x - shift_x), abs(ground_z - shift_z))
    hidden = np.maximum(abs(ground_x), abs(ground_z)) < 1.4
    inside, outside = (far < 0.8) & ~hidden, (far > 1.25) & ~hidden
    assert inside.sum() > 40
    assert seen[inside].max() < 0.75
    assert seen[outside].min() > 0.75
    assert np.median(seen[outside]) > 0.97


def test_a_wide_light_has_wide_half_shadows() -> None:
    sharp, soft = (
        from_above([gray_ground(), plate(3.0)], (1.0, -1.0, 0.0), softness)[24, :]
        for softness in (0.0, 0.15)
    )
    assert np.abs(np.diff(sharp)).max() > 1.5 * np.abs(np.diff(soft)).max()


@pytest.mark.parametrize("elevation", [0.15, 0.5, 2.0])
def test_bare_ground_and_a_ball_do_not_shade_themselves(elevation: float) -> None:
    bare = from_above([gray_ground()], (1.0, -elevation, 0.2))
    assert bare.std() / bare.mean() < 0.06
    ball = oracle.thing(
        2, oracle.sphere((0, -1.5, 0), 1.5, 30), oracle.texture("plain", 1.0, **GRAY)
    )
    seen = from_above([gray_ground(), ball], (1.0, -elevation, 0.0))
    side = seen[24, 26:32]
    assert side.min() > 0.9 * side.mean()


def test_things_darken_the_ground_they_stand_on() -> None:
    block = oracle.thing(
        2, oracle.box((0, -0.8, 0), (0.8, 0.8, 0.8)), oracle.texture("plain", 1.0, **GRAY)
    )
    seen = from_above([gray_ground(), block], (1.0, -3.0, 0.0), sun=0.0)[20:28]
    assert seen[:, 31].mean() < 0.985 * seen[:, 44:].mean()


def test_in_a_room_walls_light_what_things_hide_from_the_sky() -> None:
    sides = [
        oracle.thing(
            2 + at, oracle.box((x, -0.3, 0), (1.0, 0.3, 2.0)), oracle.texture("plain", 1.0, **GRAY)
        )
        for at, x in enumerate((-1.3, 1.3))
    ]
    air, no_air = (
        from_above([gray_ground(), *sides], (1.0, -3.0, 0.0), sun=0.0, sky=oracle.sky(0.0, haze))
        for haze in (1e-9, 0.0)
    )
    between, far = np.s_[20:28, 23:25], np.s_[20:28, 42:]
    darker = [float(seen[far].mean() - seen[between].mean()) for seen in (air, no_air)]
    assert darker[0] > 10
    assert 0 < darker[1] < 0.75 * darker[0]
