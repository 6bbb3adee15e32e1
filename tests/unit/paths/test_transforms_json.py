import json
import math
from typing import Any

import oracles_paths
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import FileFormatError
from diff4splat.geometry.camera import pinhole, project
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.formats import transforms_json
from diff4splat.paths.formats.source import PathSource

VIEW = pinhole(60.0, (48, 64), torch.float64)
SOURCE = PathSource(name="t.json", view=VIEW, fps=10.0)
IDENTITY = torch.eye(4).tolist()


def _root(count: int = 2, frame: dict[str, Any] | None = None, **root: Any) -> dict[str, Any]:
    frames = [{"transform_matrix": IDENTITY} | (frame or {}) for _ in range(count)]
    return {"frames": frames, **root}


def _parse(root: object) -> CameraPath:
    return transforms_json.parse(json.dumps(root), SOURCE)


def test_opengl_cameras_look_along_minus_z_with_y_up() -> None:
    cameras = _parse(_root(1)).cameras
    points = torch.tensor([[[0.0, 0.0, -5.0], [0.0, 1.0, -5.0], [1.0, 0.0, -5.0]]]).double()
    pixels, depth = project(cameras, points)
    assert depth[0].tolist() == [5.0, 5.0, 5.0]
    assert pixels[0].tolist() == [[32.0, 24.0], [32.0, 12.0], [44.0, 24.0]]
    torch.testing.assert_close(
        torch.linalg.det(cameras.world_from_camera[:, :3, :3]), torch.ones(1).double()
    )


@pytest.mark.parametrize("per_frame", [False, True])
def test_intrinsics_for_all_or_per_frame(per_frame: bool) -> None:
    lens = {"fl_x": 100.0, "fl_y": 90, "cx": 41.0, "cy": 29.5, "w": 80.0, "h": 60}
    path = _parse(_root(frame=lens) if per_frame else _root(**lens))
    assert path.cameras.focal_px.tolist() == [[100.0, 90.0]] * 2
    assert path.cameras.center_px.tolist() == [[41.0, 29.5]] * 2
    assert path.cameras.size_px == (60, 80)


def test_a_frame_goes_before_the_file() -> None:
    root = _root(fl_x=100.0)
    root["frames"][1]["fl_x"] = 200.0
    assert _parse(root).cameras.focal_px[:, 0].tolist() == [100.0, 200.0]


@pytest.mark.parametrize(
    ("lens", "focal_px"),
    [
        ({"fl_x": 50}, (50, 50)),
        ({"fl_y": 50}, (50, 50)),
        ({"camera_angle_x": math.pi / 2}, (32, 32)),
        ({"camera_angle_x": math.pi / 2, "camera_angle_y": math.pi / 2}, (32, 24)),
        ({"camera_angle_x": math.pi / 2, "w": 100, "h": 50}, (50, 50)),
        ({"camera_angle_x": 1.0, "fl_x": 50}, (50, 50)),
        ({}, (60, 60)),
        ({"w": 32, "h": 24}, (30, 30)),
        ({"fl_x": None}, (60, 60)),
    ],
)
def test_missing_focal_lengths(lens: dict[str, Any], focal_px: tuple[float, float]) -> None:
    assert _parse(_root(1, **lens)).cameras.focal_px[0].tolist() == pytest.approx(list(focal_px))


def test_times_are_seconds_and_default_to_the_frame_rate() -> None:
    root = _root()
    assert _parse(root).times_s.tolist() == pytest.approx([0.0, 0.1])
    root["frames"][0]["time"], root["frames"][1]["time"] = 0.25, 4
    assert _parse(root).times_s.tolist() == [0.25, 4.0]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12))
def test_round_trip(seed: int, count: int) -> None:
    path = oracles_paths.random_path(seed, count)
    found = transforms_json.parse(transforms_json.dump(path), SOURCE)
    # Only the snap to the nearest rotation rounds.
    assert oracles_paths.pose_error(found, path) < 1e-14
    assert torch.equal(found.cameras.position, path.cameras.position)
    assert torch.equal(found.cameras.focal_px, path.cameras.focal_px)
    assert torch.equal(found.cameras.center_px, path.cameras.center_px)
    assert torch.equal(found.times_s, path.times_s)
    assert found.cameras.size_px == path.cameras.size_px


def test_zero_distortion_is_no_distortion() -> None:
    lens = {"camera_model": "OPENCV", "k1": 0, "k2": 0.0, "p1": 0, "distortion_params": [0, 0]}
    assert len(_parse(_root(**lens))) == 2


def _with(index: int, **fields: Any) -> dict[str, Any]:
    root = _root()
    root["frames"][index] |= fields
    return root


def _matrix(**entries: float) -> list[list[float]]:
    matrix = torch.eye(4).tolist()
    for place, value in entries.items():
        matrix[int(place[1])][int(place[2])] = value
    return matrix


@pytest.mark.parametrize(
    ("root", "words"),
    [
        ([], "expected a JSON object with frames or camera_path, got a list of 0"),
        ("text", "expected a JSON object"),
        (None, "got nothing"),
        ({}, "expected a list under 'frames', got nothing"),
        ({"frames": {}}, "expected a list under 'frames', got an object"),
        ({"frames": []}, "expected 1 to 100000 camera poses, got none"),
        ({"frames": [0] * 100_001}, "expected 1 to 100000 camera poses, got 100001"),
        ({"frames": ["x"]}, "frame 0: expected an object, got 'x'"),
        ({"frames": [{}]}, "frame 0: 'transform_matrix': expected 4 rows of 4 numbers, got none"),
        (_with(1, transform_matrix=IDENTITY[:3]), "frame 1: 'transform_matrix': .* got 3 rows"),
        (
            _with(1, transform_matrix=[[1, 0, 0]] * 4),
            "frame 1: .* expected a list of 4 numbers, got a list of 3",
        ),
        (
            _with(1, transform_matrix=[1, 0, 0, 0]),
            "frame 1: .* expected a list of 4 numbers, got 1",
        ),
        (_with(1, transform_matrix=[["1", 0, 0, 0]] * 4), "frame 1: .* got the text '1'"),
        (_with(1, transform_matrix=[[True, 0, 0, 0]] * 4), "expected a number, got True"),
        (_with(1, transform_matrix=[[None, 0, 0, 0]] * 4), "expected a number, got None"),
        (_with(1, transform_matrix=[[10**400, 0, 0, 0]] * 4), "expected a finite number, got inf"),
        (
            _with(1, transform_matrix=_matrix(r00=math.nan)),
            "frame 1: .* expected a finite number, got nan",
        ),
        (_with(1, transform_matrix=_matrix(r03=math.inf)), "frame 1: .* got inf"),
        (
            _with(1, transform_matrix=_matrix(r00=-1)),
            "t.json: frame 1: expected a right-handed rotation",
        ),
        (
            _with(1, transform_matrix=_matrix(r00=1.01)),
            "frame 1: expected a rotation without scale or shear",
        ),
        (
            _with(1, transform_matrix=_matrix(r30=2)),
            "last matrix row to be 0 0 0 1, got 2 0 0 1; perhaps",
        ),
        (
            _with(1, fl_x="50"),
            "frame 1: 'fl_x': expected a number, got the text '50'; remove the quotes",
        ),
        (_with(1, fl_x=0), "frame 1: expected focal lengths above 0, got 0 px"),
        (_with(1, cx=math.nan), "frame 1: 'cx': expected a finite number"),
        (
            _with(1, w=10, h=10),
            "frame 1: expected the image size of the first frame, 64 x 48, got 10 x 10",
        ),
        (_with(1, w=10), "frame 1: expected both 'h' and 'w' or neither"),
        (_root(w=0, h=10), "frame 0: 'w': expected a whole number of pixels from 1"),
        (_root(w=10.5, h=10), "got 10.5"),
        (
            _root(camera_angle_x=4.0),
            "'camera_angle_x': expected a field of view between 0 and pi radians, got 4",
        ),
        (
            _root(camera_model="OPENCV_FISHEYE"),
            "expected a pinhole camera_model, got 'OPENCV_FISHEYE'",
        ),
        (_root(camera_model=3), "expected a pinhole camera_model, got 3"),
        (
            _root(k1=0.1),
            "frame 0: expected no lens distortion, got k1 = 0.1; undistort the images first",
        ),
        (_with(1, p2=-1e-9), "frame 1: expected no lens distortion, got p2 = -1e-09"),
        (_root(distortion_params=[0, 0.2]), "got distortion_params = 0.2"),
        (_with(1, time=0.5), "frame 0: expected 'time' as in other frames, got nothing"),
        (
            _root(frame={"time": 0.5}),
            "frame 1: expected finite times that increase .* 0.5 s after 0.5 s",
        ),
        (_root(frame={"time": "0.5"}), "frame 0: 'time': expected a number, got the text '0.5'"),
    ],
)
def test_what_is_wrong_is_named_with_its_frame(root: object, words: str) -> None:
    with pytest.raises(FileFormatError, match=words) as caught:
        _parse(root)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "t.json: line 1: expected JSON"),
        (
            '{"frames": [\n{"transform_matrix": }]}',
            "t.json: line 2: expected JSON, but Expecting value",
        ),
        ("[" * 100_000, "t.json: expected JSON of at most 64 levels"),
        ('{"w": ' + "9" * 10_000 + "}", "expected a list under 'frames'"),
    ],
)
def test_what_is_no_json_is_refused(text: str, words: str) -> None:
    with pytest.raises(FileFormatError, match=words):
        transforms_json.parse(text, SOURCE)


@settings(max_examples=50, deadline=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(max_size=3) | st.just(IDENTITY),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(
                st.sampled_from(["frames", "transform_matrix", "fl_x", "w", "h", "time", "k1"]),
                inner,
            )
        ),
        max_leaves=12,
    )
)
def test_any_json_is_read_or_refused(root: object) -> None:
    try:
        _parse({"frames": [root]} if isinstance(root, dict) else root)
    except FileFormatError as error:
        assert "\n" not in str(error)
