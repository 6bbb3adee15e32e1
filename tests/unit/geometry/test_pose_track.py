"""Poses between poses: lines and constant turning, at any time and far from zero."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry.pose_track import PoseTrack

F64 = torch.float64


def turned(angle_rad: float, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Tensor:
    """A turn around y, written out."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    x, y, z = place
    rows = [[c, 0, s, x], [0, 1, 0, y], [-s, 0, c, z], [0, 0, 0, 1]]
    return torch.tensor(rows, dtype=F64)


def track(times_s: list[float], *poses: Tensor) -> PoseTrack:
    return PoseTrack(times_s=torch.tensor(times_s, dtype=F64), world_from_camera=torch.stack(poses))


def at(own: PoseTrack, *times_s: float) -> Tensor:
    return own.at(torch.tensor(times_s, dtype=F64))


@given(share=st.floats(0, 1), angle=st.floats(-3.0, 3.0))
@settings(max_examples=25, deadline=None)
def test_between_two_poses_the_camera_goes_straight_and_turns_evenly(
    share: float, angle: float
) -> None:
    own = track([1.0, 3.0], turned(0.2, (0, 0, 0)), turned(0.2 + angle, (2, -4, 6)))
    want = turned(0.2 + share * angle, (2 * share, -4 * share, 6 * share))
    torch.testing.assert_close(at(own, 1 + 2 * share)[0], want, rtol=0, atol=1e-9)


def test_known_poses_are_hit_and_ends_hold() -> None:
    poses = [turned(0.0), turned(1.0, (1, 0, 0)), turned(-0.5, (0, 2, 0))]
    own = track([0.0, 0.5, 2.0], *poses)
    made = at(own, -3.0, 0.0, 0.5, 2.0, 9.0)
    want = torch.stack([poses[0], *poses, poses[2]])
    torch.testing.assert_close(made, want, rtol=0, atol=1e-12)


def test_the_shorter_way_round_is_taken() -> None:
    own = track([0.0, 1.0], turned(math.radians(170)), turned(math.radians(-170)))
    torch.testing.assert_close(at(own, 0.5)[0], turned(math.pi), rtol=0, atol=1e-9)


def test_one_pose_is_the_pose_at_all_times() -> None:
    own = track([5.0], turned(0.3, (1, 2, 3)))
    assert torch.equal(at(own, 0.0, 9.0), turned(0.3, (1, 2, 3)).expand(2, 4, 4))
    assert own.is_static


def test_whether_it_stands_depends_on_when() -> None:
    here, there = turned(0.0), turned(0.0, (1, 0, 0))
    own = track([0.0, 1.0, 2.0, 3.0], here, here, there, there)
    assert not own.is_static
    stands = {(0.0, 1.0): True, (-9.0, 0.5): True, (0.5, 1.1): False, (1.2, 1.3): False}
    stands |= {(2.0, 2.5): True, (1.9, 2.0): False, (2.2, 99.0): True, (-9.0, 9.0): False}
    stands |= {(3.0, 3.0): True, (1.0, 1.0): True}
    for span, want in stands.items():
        assert own.is_static_between(*span) is want, span


def test_times_far_from_zero_keep_their_differences() -> None:
    own = track([1e6, 1e6 + 1e-3], turned(0.0), turned(0.0, (1, 0, 0)))
    places = at(own, *(1e6 + 1e-3 * k / 4 for k in range(5)))[:, 0, 3]
    torch.testing.assert_close(places, torch.linspace(0, 1, 5, dtype=F64), rtol=0, atol=1e-6)


def test_float32_poses_answer_in_the_dtype_of_the_times() -> None:
    own = PoseTrack(
        times_s=torch.tensor([0.0, 1.0]), world_from_camera=torch.eye(4).repeat(2, 1, 1)
    )
    assert at(own, 0.3).dtype == F64
    assert own.at(torch.tensor([0.3])).dtype == torch.float32


def test_poses_and_times_get_gradients() -> None:
    times = torch.tensor([0.15, 0.4, 0.8], dtype=F64, requires_grad=True)
    first, last = turned(0.1, (1, 2, 3)), turned(0.7, (0, -1, 2))
    places = torch.tensor([[1.0, 2, 3], [0, -1, 2]], dtype=F64, requires_grad=True)
    keys = torch.tensor([0.1, 0.9], dtype=F64, requires_grad=True)

    def poses(times: Tensor, places: Tensor, keys: Tensor) -> Tensor:
        turns = torch.stack([first, last])[:, :, :3]
        column = torch.nn.functional.pad(places, (0, 1), value=1.0)[..., None]
        own = PoseTrack(times_s=keys, world_from_camera=torch.cat([turns, column], -1))
        return own.at(times)

    assert torch.autograd.gradcheck(poses, (times, places, keys))


@pytest.mark.usefixtures("as_shipped")
def test_bad_tracks_are_refused() -> None:
    pose = turned(0.0)
    with pytest.raises(ShapeError, match=r"expected \(2, 4, 4\) \(from times_s\), got \(1, 4, 4\)"):
        track([0.0, 1.0], pose)
    for times_s in ([1.0, 1.0], [2.0, 1.0], [0.0, math.nan], [0.0, math.inf]):
        with pytest.raises(InputError, match="expected finite times that increase"):
            track(times_s, pose, pose)
    with pytest.raises(ShapeError):
        PoseTrack(times_s=torch.zeros(0), world_from_camera=torch.zeros(0, 4, 4))
