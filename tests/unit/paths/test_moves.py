"""Each move against its formula, from a dense grid of progress."""

import math
from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.geometry.camera import pinhole, project
from diff4splat.paths import moves
from diff4splat.paths.moves import Move
from diff4splat.paths.presets import PRESETS

FOCUS = 3.0
PROGRESS = torch.linspace(0, 1, 41, dtype=torch.float64)
WATCHING = [moves.orbit, moves.arc, moves.spiral, moves.figure8]
CLOSED = [moves.arc, moves.figure8]


def _seen(move: Move, point: tuple[float, float, float]) -> tuple[torch.Tensor, torch.Tensor]:
    """Pixels and depths of a point from every pose, in a 100 x 100 image of focal length 50."""
    cameras = pinhole(50.0, (100, 100), torch.float64).with_pose(move.world_from_camera)
    points = torch.tensor([[point]], dtype=torch.float64).expand(len(PROGRESS), 1, 3)
    pixels, depth = project(cameras, points)
    return pixels[:, 0], depth[:, 0]


@pytest.mark.parametrize("name", PRESETS)
def test_every_move_begins_at_the_identity(name: str) -> None:
    move = PRESETS[name].move(PROGRESS, 0.4, FOCUS)
    assert torch.equal(move.world_from_camera[0], torch.eye(4, dtype=torch.float64))
    assert float(move.focal_factor[0]) == 1.0


@pytest.mark.parametrize("name", PRESETS)
def test_no_extent_means_no_move(name: str) -> None:
    move = PRESETS[name].move(PROGRESS, 0.0, FOCUS)
    assert torch.equal(move.world_from_camera, torch.eye(4, dtype=torch.float64).expand(41, 4, 4))
    assert torch.equal(move.focal_factor, torch.ones_like(PROGRESS))


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(sorted(PRESETS)),
    st.floats(-500, 500),
    st.floats(1e-3, 1e6),
)
def test_poses_are_rigid_and_finite_at_any_size(name: str, extent: float, focus: float) -> None:
    pose = PRESETS[name].move(PROGRESS, extent, focus).world_from_camera
    rotation = pose[:, :3, :3]
    assert bool(torch.isfinite(pose).all())
    torch.testing.assert_close(
        rotation @ rotation.mT, torch.eye(3, dtype=torch.float64).expand(41, 3, 3)
    )
    torch.testing.assert_close(torch.linalg.det(rotation), torch.ones_like(PROGRESS))


@pytest.mark.parametrize("move", WATCHING)
def test_the_focus_point_stays_centred(move: Callable[..., Move]) -> None:
    pixels, depth = _seen(move(PROGRESS, 0.7, FOCUS), (0.0, 0.0, FOCUS))
    torch.testing.assert_close(pixels, torch.full_like(pixels, 50.0))
    assert bool((depth > 0).all())


@pytest.mark.parametrize("move", CLOSED)
def test_closed_moves_return(move: Callable[..., Move]) -> None:
    pose = move(PROGRESS, 0.7, FOCUS).world_from_camera
    torch.testing.assert_close(pose[-1], pose[0], atol=1e-14, rtol=0)


@pytest.mark.parametrize("move", [moves.orbit, moves.arc])
def test_circles_keep_their_distance_and_height(move: Callable[..., Move]) -> None:
    position = move(PROGRESS, 2.0, FOCUS).world_from_camera[:, :3, 3]
    radius = (position - position.new_tensor([0, 0, FOCUS])).norm(dim=-1)
    torch.testing.assert_close(radius, torch.full_like(radius, FOCUS))
    assert bool((position[:, 1] == 0).all())


def test_orbit_turns_by_its_extent_to_the_right_first() -> None:
    pose = moves.orbit(PROGRESS, math.pi / 2, FOCUS).world_from_camera
    assert float(pose[1, 0, 3]) > 0
    # A quarter turn later the camera stands beside the focus point and looks to the left.
    torch.testing.assert_close(pose[-1, :3, 3], pose.new_tensor([FOCUS, 0, FOCUS]))
    torch.testing.assert_close(pose[-1, :3, 2], pose.new_tensor([-1.0, 0, 0]), atol=1e-15, rtol=0)


def test_arc_reaches_its_length_on_both_sides() -> None:
    pose = moves.arc(PROGRESS, 0.6, FOCUS).world_from_camera
    angle = torch.atan2(pose[:, 0, 3], FOCUS - pose[:, 2, 3])
    assert float(angle.max()) * FOCUS == pytest.approx(0.6)
    assert float(angle.min()) * FOCUS == pytest.approx(-0.6)
    assert int(angle.argmax()) == 10
    assert int(angle.argmin()) == 30


def test_spiral_grows_evenly_and_circles_twice() -> None:
    x, y, z = moves.spiral(PROGRESS, 0.5, FOCUS).world_from_camera[:, :3, 3].unbind(-1)
    torch.testing.assert_close(torch.hypot(x, y), 0.5 * PROGRESS)
    assert bool((z == 0).all())
    turned = torch.atan2(y[1:], x[1:]).diff().remainder(2 * math.pi).sum()
    assert float(turned) == pytest.approx(4 * math.pi * 39 / 40)


def test_figure8_is_a_lemniscate() -> None:
    x, y, _ = moves.figure8(PROGRESS, 0.5, FOCUS).world_from_camera[:, :3, 3].unbind(-1)
    # Bernoulli: (x² + y²)² = a² (x² - y²)
    torch.testing.assert_close((x**2 + y**2) ** 2, 0.25 * (x**2 - y**2), atol=1e-15, rtol=1e-12)
    assert float(x.max()) == pytest.approx(0.5)
    assert float(x.min()) == pytest.approx(-0.5)
    assert float(y[20].abs() + x[20].abs()) < 1e-15


def test_roll_turns_the_image_only() -> None:
    pose = moves.roll(PROGRESS, math.pi / 2, FOCUS).world_from_camera
    assert bool((pose[:, :3, 3] == 0).all())
    torch.testing.assert_close(pose[:, :3, 2], pose.new_tensor([0, 0, 1]).expand(41, 3))
    # A clockwise quarter turn: what was on the right of the image is now at its top.
    pixels, _ = _seen(moves.roll(PROGRESS, math.pi / 2, FOCUS), (1.0, 0.0, 2.0))
    torch.testing.assert_close(pixels[0], pixels.new_tensor([75.0, 50.0]))
    torch.testing.assert_close(pixels[-1], pixels.new_tensor([50.0, 25.0]))


@settings(max_examples=25, deadline=None)
@given(st.floats(-5, 2.9))
def test_dolly_zoom_keeps_the_size_at_the_focus_depth(extent: float) -> None:
    move = moves.dolly_zoom(PROGRESS, extent, FOCUS)
    _, depth = _seen(move, (0.0, 0.0, FOCUS))
    torch.testing.assert_close(
        move.focal_factor / depth, torch.full_like(depth, 1 / FOCUS), atol=0, rtol=1e-14
    )


@pytest.mark.parametrize(
    ("name", "axis", "sign"),
    [
        ("forward", 2, 1),
        ("backward", 2, -1),
        ("up", 1, -1),
        ("down", 1, 1),
        ("left", 0, -1),
        ("right", 0, 1),
    ],
)
def test_straight_moves_go_their_way(name: str, axis: int, sign: int) -> None:
    pose = PRESETS[name].move(PROGRESS, 0.8, FOCUS).world_from_camera
    expected = torch.zeros(41, 3, dtype=torch.float64)
    expected[:, axis] = sign * 0.8 * PROGRESS
    torch.testing.assert_close(pose[:, :3, 3], expected)
    assert torch.equal(pose[:, :3, :3], torch.eye(3, dtype=torch.float64).expand(41, 3, 3))


@pytest.mark.parametrize("name", PRESETS)
def test_moves_are_differentiable_in_progress(name: str) -> None:
    progress = torch.tensor([0.0, 0.3, 1.0], dtype=torch.float64, requires_grad=True)

    def flat(values: torch.Tensor) -> torch.Tensor:
        move = PRESETS[name].move(values, 0.4, FOCUS)
        return torch.cat([move.world_from_camera.flatten(), move.focal_factor])

    assert torch.autograd.gradcheck(flat, progress)


def test_no_frames_give_no_poses() -> None:
    for preset in PRESETS.values():
        assert len(preset.move(PROGRESS[:0], 0.4, FOCUS).world_from_camera) == 0
