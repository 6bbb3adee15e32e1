import math

import oracles_paths
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import FileFormatError
from diff4splat.geometry.camera import pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.formats import tum
from diff4splat.paths.formats.source import PathSource

VIEW = pinhole(60.0, (48, 64), torch.float64)
SOURCE = PathSource(name="walk.tum", view=VIEW)
HALF = math.sqrt(0.5)


def _parse(text: str) -> CameraPath:
    return tum.parse(text, SOURCE)


def test_a_file_written_by_hand() -> None:
    # A quarter turn about y carries forward (z) to the right (x).
    path = _parse(
        f"# comment\n1305031102.25 1 2 3 0 0 0 1\n1305031102.50 1 2 3 0 {HALF} 0 {HALF}\n"
    )
    assert path.times_s.tolist() == [1305031102.25, 1305031102.5]
    assert path.cameras.position.tolist() == [[1, 2, 3]] * 2
    torch.testing.assert_close(path.cameras.world_from_camera[0, :3, :3], torch.eye(3).double())
    forward = path.cameras.world_from_camera[1, :3, 2]
    torch.testing.assert_close(forward, torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64))
    assert path.cameras.focal_px.tolist() == [[60.0, 60.0]] * 2
    assert path.cameras.size_px == (48, 64)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12))
def test_round_trip(seed: int, count: int) -> None:
    path = oracles_paths.random_path(seed, count)
    found = _parse(tum.dump(path))
    assert oracles_paths.pose_error(found, path) < 1e-14
    assert torch.equal(found.cameras.position, path.cameras.position)
    assert torch.equal(found.times_s, path.times_s)
    assert torch.equal(found.cameras.focal_px, VIEW.focal_px.expand(count, 2))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "walk.tum: expected 1 to 100000 camera poses, got none"),
        ("# only\n# comments\n", "got none"),
        ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 1", "line 2: expected 8 columns .* got 7"),
        ("0 0 0 0 0 0 0 0", "line 1: expected a unit quaternion qx qy qz qw, got length 0"),
        ("0 0 0 0 0 0 0 1.01", "got length 1.01; check the order of the columns"),
        ("0 0 0 0 1e300 1e300 0 0", "expected a unit quaternion"),
        ("0 0 nan 0 0 0 0 1", "line 1: expected a finite number, got nan"),
        ("0 0 0 0 0 0 0 one", "line 1: expected a number, got 'one'"),
        ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1", "line 2: expected finite times that increase"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(text: str, words: str) -> None:
    with pytest.raises(FileFormatError, match=words):
        _parse(text)


def test_rounded_quaternions_are_made_exact() -> None:
    found = _parse("0 0 0 0 0.1826 0.3651 0.5477 0.7303").cameras.world_from_camera[0, :3, :3]
    torch.testing.assert_close(found @ found.mT, torch.eye(3, dtype=torch.float64))
