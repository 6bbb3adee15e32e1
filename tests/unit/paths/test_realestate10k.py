import oracles_paths
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry.camera import pinhole, project
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.formats import realestate10k
from diff4splat.paths.formats.source import PathSource

VIEW = pinhole(60.0, (48, 64), torch.float64)
SOURCE = PathSource(name="clip.txt", view=VIEW)
LENS = "0.5 0.75 0.5 0.5 0 0"
FRONT = "1 0 0 0 0 1 0 0 0 0 1 0"
# The camera stands at x = 2 and looks along -x (turned left by 90 degrees); row by row its axes in
# the world are right = z, down = y, forward = -x, and camera_from_world moves by -R p = (0, 0, 2).
BESIDE = "0 0 1 0 0 1 0 0 -1 0 0 2"
GOOD = f"https://example.org/video\n0 {LENS} {FRONT}\n500000 {LENS} {BESIDE}\n"


def _parse(text: str) -> CameraPath:
    return realestate10k.parse(text, SOURCE)


def test_a_file_written_by_hand() -> None:
    path = _parse(GOOD)
    assert path.times_s.tolist() == [0.0, 0.5]
    assert path.cameras.focal_px.tolist() == [[32.0, 36.0]] * 2
    assert path.cameras.center_px.tolist() == [[32.0, 24.0]] * 2
    assert path.cameras.size_px == (48, 64)
    assert path.cameras.position.tolist() == [[0, 0, 0], [2, 0, 0]]
    assert path.cameras.world_from_camera[1, :3, 2].tolist() == [-1, 0, 0]


def test_what_is_in_front_stays_in_front() -> None:
    cameras = _parse(GOOD).cameras
    # One point ahead of the first camera, another on the left of the second one, where it looks.
    ahead = torch.tensor([[[0.0, 0.0, 5.0]], [[-3.0, 0.0, 0.0]]], dtype=torch.float64)
    pixels, depth = project(cameras, ahead)
    assert depth.flatten().tolist() == pytest.approx([5, 5])
    assert pixels[:, 0].tolist() == [[32.0, 24.0]] * 2


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12))
def test_round_trip(seed: int, count: int) -> None:
    path = oracles_paths.random_path(seed, count)
    found = _parse(realestate10k.dump(path))
    assert oracles_paths.pose_error(found, path) < 1e-13
    torch.testing.assert_close(found.cameras.focal_px, path.cameras.focal_px, atol=0, rtol=1e-14)
    torch.testing.assert_close(found.cameras.center_px, path.cameras.center_px, atol=0, rtol=1e-14)
    # The clock counts whole microseconds.
    assert float((found.times_s - path.times_s).abs().max()) <= 0.5e-6 + 1e-12


@pytest.mark.parametrize(
    "text",
    [
        f"0 {LENS} {FRONT}",
        f"\n\n# a comment\n0 {LENS} {FRONT}\n# another\n\n",
        f"clip 12 of the second tape\n0 {LENS} {FRONT}\n",
        f"\r\n0\t{LENS}  {FRONT}\r\n",
    ],
)
def test_headings_comments_and_blanks_do_not_matter(text: str) -> None:
    assert len(_parse(text)) == 1


def test_rounded_rotations_are_made_exact() -> None:
    path = oracles_paths.rounded(oracles_paths.random_path(5, 6), 4)
    found = _parse(realestate10k.dump(path)).cameras.world_from_camera
    assert oracles_paths.pose_error(_parse(realestate10k.dump(path)), path) < 2e-3
    gram = found[:, :3, :3] @ found[:, :3, :3].mT
    torch.testing.assert_close(gram, torch.eye(3, dtype=torch.float64).expand(6, 3, 3))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "clip.txt: expected 1 to 100000 camera poses, got none"),
        ("https://example.org\n", "got none"),
        (f"0 {LENS} {FRONT}\n1 {LENS} 1 0 0", "clip.txt: line 2: expected 19 columns .* got 10"),
        (f"0 {LENS} {FRONT} 7", "line 1: expected 19 columns .* got 20"),
        (
            f"url\n0 {LENS} {FRONT.replace('0', 'nan', 1)}",
            "line 2: expected a finite number, got nan",
        ),
        (f"0 {LENS} {FRONT.replace('1', '1e999', 1)}", "line 1: expected a finite number, got inf"),
        (f"x {LENS} {FRONT}", "line 1: expected a number, got 'x'"),
        (f"0 {LENS} {FRONT}\nword", "line 2: expected 19 columns"),
        (
            f"0 {LENS} -1 0 0 0 0 1 0 0 0 0 1 0",
            "line 1: expected a right-handed rotation .* determinant -1",
        ),
        (
            f"0 {LENS} 1 0.2 0 0 0 1 0 0 0 0 1 0",
            "line 1: expected a rotation without scale or shear",
        ),
        (f"0 {LENS} 2 0 0 0 0 2 0 0 0 0 2 0", "line 1: .* got a deviation of 3"),
        (f"0 {LENS} 0 0 0 0 0 0 0 0 0 0 0 0", "line 1: expected a rotation without scale or shear"),
        (f"0 {LENS} 1e200 0 0 0 0 1e200 0 0 0 0 1e200 0", "line 1: expected a rotation"),
        (
            f"5 {LENS} {FRONT}\n5 {LENS} {FRONT}",
            "line 2: expected finite times that increase from frame",
        ),
        (f"5 {LENS} {FRONT}\n4 {LENS} {FRONT}", "line 2: .* got 4e-06 s after 5e-06 s"),
        (f"0 0 0.75 0.5 0.5 0 0 {FRONT}", "line 1: expected focal lengths above 0, got 0 px"),
        (f"0 -1 0.75 0.5 0.5 0 0 {FRONT}", "expected focal lengths above 0, got -64 px"),
        (
            f"0 0.5 0.75 0.5 0.5 0.1 0 {FRONT}",
            "line 1: expected no lens distortion .* got 0.1 and 0",
        ),
        (
            f"0 500 500 320 240 0 0 {FRONT}",
            "line 1: expected intrinsics divided by the image size",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_line(text: str, words: str) -> None:
    with pytest.raises(FileFormatError, match=words) as caught:
        _parse(text)
    assert "\n" not in str(caught.value)


def test_too_many_poses_are_refused() -> None:
    with pytest.raises(FileFormatError, match="expected 1 to 100000 camera poses, got 100001"):
        _parse("url\n" + f"0 {LENS} {FRONT}\n" * 100_001)


def test_frames_within_a_microsecond_cannot_be_written() -> None:
    path = oracles_paths.random_path(0, 3)
    close = CameraPath(cameras=path.cameras, times_s=1e-7 * torch.arange(3, dtype=torch.float64))
    with pytest.raises(InputError, match="expected frames at least 1 microsecond apart"):
        realestate10k.dump(close)
