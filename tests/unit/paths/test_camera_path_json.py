import json
import math
from dataclasses import replace
from typing import Any

import oracles_paths
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry.camera import pinhole, project
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.formats import camera_path_json
from diff4splat.paths.formats.source import PathSource

VIEW = pinhole(60.0, (48, 64), torch.float64)
SOURCE = PathSource(name="p.json", view=VIEW, fps=10.0)
FLAT = torch.eye(4).flatten().tolist()


def _root(count: int = 2, frame: dict[str, Any] | None = None, **root: Any) -> dict[str, Any]:
    frames = [{"camera_to_world": FLAT, "fov": 90.0} | (frame or {}) for _ in range(count)]
    return {"camera_path": frames, "render_width": 80, "render_height": 60, "fps": 5, **root}


def _parse(root: object) -> CameraPath:
    return camera_path_json.parse(json.dumps(root), SOURCE)


def test_a_file_written_by_hand() -> None:
    flat = torch.eye(4)
    flat[:3, 3] = torch.tensor([1.0, 2.0, 3.0])
    path = _parse(_root(frame={"camera_to_world": flat.flatten().tolist()}))
    # 90 degrees from top to bottom: the focal length is half the height.
    assert path.cameras.focal_px.tolist() == [pytest.approx([30.0, 30.0])] * 2
    assert path.cameras.center_px.tolist() == [[40.0, 30.0]] * 2
    assert path.cameras.size_px == (60, 80)
    assert path.cameras.position.tolist() == [[1, 2, 3]] * 2
    assert path.times_s.tolist() == pytest.approx([0, 0.2])


def test_opengl_cameras_look_along_minus_z_with_y_up() -> None:
    points = torch.tensor([[[0.0, 0.0, -5.0], [0.0, 1.0, -5.0]]]).double()
    pixels, depth = project(_parse(_root(1)).cameras, points)
    assert depth[0].tolist() == [5.0, 5.0]
    assert pixels[0].flatten().tolist() == pytest.approx([40, 30, 40, 24])


def test_what_the_file_lacks_comes_from_the_view() -> None:
    path = _parse({"camera_path": [{"camera_to_world": FLAT}] * 2})
    assert path.cameras.focal_px.tolist() == [[60.0, 60.0]] * 2
    assert path.cameras.size_px == (48, 64)
    assert path.times_s.tolist() == pytest.approx([0, 0.1])


def test_render_time_is_a_share_of_the_duration() -> None:
    root = _root(3, seconds=8.0)
    for frame, share in zip(root["camera_path"], [0.0, 0.25, 1.0], strict=True):
        frame["render_time"] = share
    assert _parse(root).times_s.tolist() == [0, 2, 8]
    del root["seconds"]
    assert _parse(root).times_s.tolist() == pytest.approx([0, 0.15, 0.6])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12))
def test_round_trip(seed: int, count: int) -> None:
    path = oracles_paths.random_path(seed, count, centered=True)
    found = camera_path_json.parse(camera_path_json.dump(path), SOURCE)
    assert oracles_paths.pose_error(found, path) < 1e-14
    torch.testing.assert_close(found.cameras.focal_px, path.cameras.focal_px, atol=0, rtol=1e-13)
    torch.testing.assert_close(found.cameras.center_px, path.cameras.center_px)
    torch.testing.assert_close(found.times_s, path.times_s, atol=1e-13, rtol=0)


def test_the_written_clock_is_one_that_nerfstudio_understands() -> None:
    path = oracles_paths.random_path(0, 6, centered=True)
    path = replace(path, times_s=3 + torch.arange(6, dtype=torch.float64) / 12)
    root = json.loads(camera_path_json.dump(path))
    assert root["fps"] == pytest.approx(12)
    assert root["seconds"] == pytest.approx(0.5)
    shares = [frame["render_time"] for frame in root["camera_path"]]
    assert shares == pytest.approx([0, 1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6])


@pytest.mark.parametrize(("axis", "field"), [(0, "focal_px"), (0, "center_px"), (1, "center_px")])
def test_lenses_that_the_format_cannot_hold_are_refused(axis: int, field: str) -> None:
    path = oracles_paths.random_path(0, 3, centered=True)
    values = getattr(path.cameras, field).clone()
    values[1, axis] += 1
    broken = replace(path, cameras=replace(path.cameras, **{field: values}))
    with pytest.raises(
        InputError, match=r"principal point in the middle and square pixels.*transforms.json"
    ):
        camera_path_json.dump(broken)


def _with(index: int, **fields: Any) -> dict[str, Any]:
    root = _root()
    root["camera_path"][index] |= fields
    return root


@pytest.mark.parametrize(
    ("root", "words"),
    [
        ({"camera_path": []}, "p.json: expected 1 to 100000 camera poses, got none"),
        ({"camera_path": 3}, "expected a list under 'camera_path', got 3"),
        (
            {"camera_path": [{}]},
            "frame 0: 'camera_to_world': expected a list of 16 numbers, got nothing",
        ),
        (
            _with(1, camera_to_world=FLAT[:12]),
            "frame 1: .* expected a list of 16 numbers, got a list of 12",
        ),
        (_with(1, camera_to_world=[*FLAT[:15], "1"]), "frame 1: .* got the text '1'"),
        (_with(1, camera_to_world=[math.nan, *FLAT[1:]]), "frame 1: .* expected a finite number"),
        (_with(1, camera_to_world=[-1, *FLAT[1:]]), "frame 1: expected a right-handed rotation"),
        (
            _with(1, camera_to_world=[*FLAT[:12], 5, 0, 0, 1]),
            "frame 1: .* perhaps the matrix is transposed",
        ),
        (_with(1, fov=0), "frame 1: 'fov': expected vertical degrees between 0 and 180, got 0"),
        (_with(1, fov=180), "got 180"),
        (_with(1, fov="90"), "frame 1: 'fov': expected a number, got the text '90'"),
        (_root(fps=0), "p.json: 'fps': expected a number above 0, got 0"),
        (_root(seconds=-1), "'seconds': expected a number above 0, got -1"),
        (_root(render_width=None), "expected both 'render_height' and 'render_width' or neither"),
        (_root(render_width=1e9), "'render_width': expected a whole number of pixels"),
        (_root(camera_type="fisheye"), "expected camera_type 'perspective', got 'fisheye'"),
        (_with(1, render_time=0.5), "frame 0: expected 'render_time' as in other frames"),
        (_root(frame={"render_time": 0.5}), "frame 1: expected finite times that increase"),
        (
            _with(0, render_time=0)
            | {"camera_path": [{"camera_to_world": FLAT, "render_time": 1.5}]},
            "frame 0: 'render_time': expected a share of the duration from 0 to 1, got 1.5",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_frame(root: object, words: str) -> None:
    with pytest.raises(FileFormatError, match=words):
        _parse(root)
