import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import InputError
from diff4splat.geometry.camera import pinhole, project
from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.presets import PRESETS
from diff4splat.paths.settings import PathFrame, PathSettings

VIEW = PathFrame(camera=pinhole(60.0, (48, 64), torch.float64), near_depth=2.0, focus_depth=5.0)


def _path(text: str, frames: int = 13, **settings_: object) -> CameraPath:
    return build_path(text, VIEW, PathSettings(frames=frames, fps=10.0, **settings_))  # type: ignore[arg-type]


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.sampled_from(sorted(set(PRESETS) - {"forward", "dolly-zoom"})), min_size=1, max_size=5
    ),
    st.integers(1, 30),
    st.sampled_from(["linear", "smooth", "ease-in", "ease-out"]),
)
def test_any_chain_gives_the_asked_frames_from_the_identity(
    names: list[str], frames: int, easing: str
) -> None:
    path = _path("+".join(names), frames, easing=easing)
    assert len(path) == frames
    assert torch.equal(path.cameras.world_from_camera[0], torch.eye(4, dtype=torch.float64))
    torch.testing.assert_close(path.times_s, torch.arange(frames, dtype=torch.float64) / 10)
    assert path.cameras.size_px == (48, 64)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_dtype_is_that_of_the_view(dtype: torch.dtype) -> None:
    view = PathFrame(camera=VIEW.camera.to(dtype), near_depth=2.0, focus_depth=5.0)
    path = build_path("orbit:0.1+dolly-zoom", view, PathSettings(frames=4, fps=10.0))
    assert path.times_s.dtype == path.cameras.focal_px.dtype == dtype
    assert path.cameras.world_from_camera.dtype == dtype


def test_travel_is_the_amplitude_times_the_near_depth() -> None:
    assert _path("up:0.3").cameras.position[-1].tolist() == pytest.approx([0, -0.6, 0])
    assert _path("forward:0.3").cameras.position[-1].tolist() == pytest.approx([0, 0, 0.6])
    assert _path("right", amplitude=0.5).cameras.position[-1].tolist() == pytest.approx([1, 0, 0])


def test_scaling_the_depths_scales_the_path() -> None:
    large = PathFrame(camera=VIEW.camera, near_depth=2e3, focus_depth=5e3)
    small_path, timing = _path("arc+spiral+forward:0.4"), PathSettings(frames=13, fps=10.0)
    large_path = build_path("arc+spiral+forward:0.4", large, timing)
    torch.testing.assert_close(large_path.cameras.position, 1e3 * small_path.cameras.position)


def test_each_segment_starts_where_the_last_ended() -> None:
    path = _path("right:0.5+up:0.5+left:0.5", 7, easing="linear")
    expected = [[0, 0], [0.5, 0], [1, 0], [1, -0.5], [1, -1], [0.5, -1], [0, -1]]
    for position, (x, y) in zip(path.cameras.position.tolist(), expected, strict=True):
        assert position == pytest.approx([x, y, 0])


def test_joints_are_shown_once_and_frames_are_shared_evenly() -> None:
    steps = _path("right:0.5+up:0.5", 12, easing="linear").cameras.position.diff(dim=0)
    assert bool((steps.norm(dim=-1) > 0.05).all())
    alone = (steps[:, 1] == 0).sum(), (steps[:, 0] == 0).sum()
    assert [int(count) for count in alone] == [5, 5]


def test_a_chain_turns_with_the_camera() -> None:
    # After a quarter orbit "forward" goes along the new viewing direction, to the left.
    path = _path("orbit:0.25+forward:0.5", 9)
    assert path.cameras.position[4].tolist() == pytest.approx([5, 0, 5])
    assert path.cameras.position[8].tolist() == pytest.approx([4, 0, 5])


def test_orbits_after_travel_still_circle_the_focus_point() -> None:
    path = _path("forward:0.5+spiral+orbit:0.5", 31)
    focus = torch.tensor([[[0.0, 0.0, 5.0]]], dtype=torch.float64).expand(31, 1, 3)
    pixels, depth = project(path.cameras, focus)
    torch.testing.assert_close(pixels, pixels.new_tensor([32.0, 24.0]).expand(31, 1, 2))
    assert bool((depth > 0).all())


def test_forward_and_backward_return() -> None:
    position = _path("forward:0.3+backward:0.3", 9).cameras.position[-1]
    assert position.tolist() == pytest.approx([0, 0, 0])


def test_focal_length_carries_over_a_joint() -> None:
    path = _path("dolly-zoom:0.5+up+dolly-zoom:-0.5", 13)
    factor = path.cameras.focal_px[:, 0] / 60
    assert float(factor[4]) == pytest.approx(4 / 5)
    assert float(factor[8]) == pytest.approx(4 / 5)
    assert float(factor[12]) == pytest.approx(1)


def test_a_full_orbit_closes() -> None:
    pose = _path("orbit:1", 25).cameras.world_from_camera
    torch.testing.assert_close(pose[-1], pose[0], atol=1e-14, rtol=0)
    assert float(pose[12, 2, 3]) == pytest.approx(10)


def test_easing_acts_on_every_segment() -> None:
    position = _path("right:1+right:1", 9, easing="ease-in").cameras.position[:, 0]
    expected = [2 * share**2 for share in (0, 0.25, 0.5, 0.75)]
    assert position.tolist() == pytest.approx([*expected, *(2 + value for value in expected), 4])


@pytest.mark.parametrize(
    ("text", "frames"), [("forward:0.5", 1), ("up+down+left", 1), ("up+down+left", 2)]
)
def test_fewer_frames_than_segments(text: str, frames: int) -> None:
    assert len(_path(text, frames)) == frames


@pytest.mark.parametrize(
    "text",
    [
        "forward:1",
        "forward:1.5",
        "dolly-zoom:1",
        "backward:-1",
        "forward:0.6+up+dolly-in:0.6",
        "forward:0.6+dolly-zoom:0.4",
        "backward:0.5+forward:1.5",
    ],
)
def test_the_nearest_content_is_never_reached(text: str) -> None:
    with pytest.raises(
        InputError, match="expected less than 1 near depth of travel towards the content"
    ):
        _path(text)


def test_coming_close_and_stepping_back_is_fine() -> None:
    path = _path("forward:0.9+backward:0.9+forward:0.9", 31)
    assert float(path.cameras.position[:, 2].max()) < VIEW.near_depth


def test_the_pose_of_the_view_does_not_matter() -> None:
    moved = VIEW.camera.with_pose(
        torch.diag(torch.tensor([-1.0, -1.0, 1.0, 1.0], dtype=torch.float64))
    )
    view = PathFrame(camera=moved, near_depth=2.0, focus_depth=5.0)
    path = build_path("spiral", view, PathSettings(frames=13, fps=10.0))
    assert torch.equal(path.cameras.world_from_camera, _path("spiral").cameras.world_from_camera)


def test_frame_rates_that_float32_cannot_hold_are_refused() -> None:
    view = PathFrame(camera=VIEW.camera.to(torch.float32), near_depth=2.0, focus_depth=5.0)
    with pytest.raises(InputError, match="finite times that increase"):
        build_path("up", view, PathSettings(frames=3, fps=math.pi * 1e300))
