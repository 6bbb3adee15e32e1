"""What cannot be drawn is refused by name; extremes draw."""

from dataclasses import replace

import numpy as np
import oracles_drawing as oracle
import pytest
import torch

from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.renderer.shading.tone import byte_thresholds
from diff4splat.errors import ConfigError, InputError

SETTINGS = DrawSettings(samples_per_side=2, tracks=5, shadow_px=16)


def wall(instance: int = 1, far: float = 2.0, **changes) -> object:
    shape = oracle.mesh([[-9, -9, far], [9, -9, far], [0, 9, far]], [[0, 1, 2]])
    return oracle.thing(instance, shape, **changes)


def drawn(*objects, frames: int = 2, **changes):
    return draw_clip(
        oracle.world(objects, [oracle.straight(frames, (6, 8))], frames, **changes), SETTINGS
    )


def test_positions_that_are_not_finite_name_their_object() -> None:
    broken = wall(5)
    broken.positions[0, 1, 2] = np.nan
    with pytest.raises(InputError, match="instance 5: expected finite positions"):
        drawn(wall(1), broken)


@pytest.mark.parametrize("numbers", [(0,), (255,), (3, 3), (-1,)])
def test_instances_are_unique_bytes(numbers: tuple) -> None:
    with pytest.raises(ConfigError, match="expected different numbers from 1 to 254"):
        drawn(*(wall(number) for number in numbers))


def test_positions_must_fit_frames_and_vertices() -> None:
    with pytest.raises(InputError, match="expected positions for 1 or 2 frames of 3 vertices"):
        drawn(wall(1, positions=np.zeros((5, 3, 3))))
    with pytest.raises(InputError, match="instance 1: expected positions"):
        drawn(wall(1, positions=np.zeros((1, 4, 3))))


@pytest.mark.usefixtures("as_shipped")
def test_meshes_must_fit_themselves() -> None:
    good = wall()
    outside = replace(good.mesh, triangles=np.array([[0, 1, 3]], np.int32))
    with pytest.raises(InputError, match="expected triangles of vertices 0 to 2"):
        drawn(replace(good, mesh=outside))
    short = replace(good.mesh, uv=np.zeros((2, 2)))
    with pytest.raises(InputError, match="expected uv of 3 vertices, got 2"):
        drawn(replace(good, mesh=short))


def test_cameras_must_fit_the_times_and_each_other() -> None:
    world = oracle.world([wall()], [oracle.straight(3, (6, 8))], 2)
    with pytest.raises(ConfigError, match="expected cameras for 2 > 0 frames"):
        draw_clip(world, SETTINGS)
    sizes = [oracle.straight(2, (6, 8)), oracle.straight(2, (8, 6))]
    with pytest.raises(ConfigError, match="expected one image size"):
        draw_clip(replace(world, views=tuple(sizes)), SETTINGS)
    with pytest.raises(ConfigError, match="expected at least one camera"):
        draw_clip(replace(world, views=()), SETTINGS)
    bent = oracle.straight(2, (6, 8))
    bent.world_from_camera[1, 0, 0] = 2.0
    with pytest.raises(InputError, match="view 0: expected rotations"):
        draw_clip(replace(world, views=(bent,)), SETTINGS)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"samples_per_side": 0}, "samples_per_side: expected 1 to 7, got 0"),
        ({"samples_per_side": 8}, "samples_per_side: expected 1 to 7, got 8"),
        ({"tracks": -1}, "tracks: expected at least 0, got -1"),
        ({"shadow_px": 3}, "shadow_px: expected at least 16, got 3"),
        ({"threads": 0}, "threads: expected at least 1, got 0"),
    ],
)
def test_settings_out_of_range_are_refused(changes: dict, expected: str) -> None:
    with pytest.raises(ConfigError, match=expected):
        DrawSettings(**changes)


@pytest.mark.parametrize("far", [0.0, -3.0, 1e-9, 1e9, 1e15])
def test_extreme_distances_draw(far: float) -> None:
    clip = drawn(wall(1, far), wall(2, 3.0))
    view = clip.views[0]
    for values in (view.depth, view.flow.to_next, view.track_uv, clip.tracks.positions):
        assert values.isfinite().all()
    assert set(view.instances.unique().tolist()) <= {0, 2}


@pytest.mark.parametrize(
    "changes", [{"scale": 0.0}, {"scale": 1e12}, {"relief": 1e6}, {"gloss": 1.0}]
)
def test_extreme_textures_draw(changes: dict) -> None:
    clip = drawn(wall(1, look=oracle.texture("brick", **{"scale": 2.0, **changes})))
    assert clip.views[0].rgb.float().std() >= 0


def test_meshes_without_triangles_or_area_are_nothing() -> None:
    empty = oracle.mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    point = oracle.mesh(np.ones((3, 3)), [[0, 1, 2]], smooth=True)
    clip = drawn(oracle.thing(1, empty), oracle.thing(2, point), wall(3))
    assert set(clip.views[0].instances.unique().tolist()) <= {0, 3}


def test_no_light_is_black_and_finite() -> None:
    dark = oracle.light()
    none = np.zeros(3)
    clip = drawn(wall(), light=replace(dark, color=none, sky=none, ground=none))
    assert clip.views[0].rgb.dtype == torch.uint8


def test_bytes_are_those_of_srgb() -> None:
    ends = byte_thresholds()[:255]
    x = (np.arange(255) + 0.5) / 255
    want = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(ends, want, rtol=1e-12)
