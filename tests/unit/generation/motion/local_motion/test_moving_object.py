"""The frame of an object, and where its points are."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from diff4splat.generation.motion.local_motion.moving_object import (
    MovingObject,
    ObjectFrame,
    Timing,
    object_frame,
)
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.depth import unproject

SIDE, FOCAL_PX, DEPTH = 48, 48.0, 6.0


def box(first: int, last: int) -> Tensor:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[first:last, first:last] = True
    return mask


def flat_frame() -> ObjectFrame:
    """Of a square of 24 pixels in the middle of an image, 3 units wide."""
    points = unproject(pinhole(FOCAL_PX, (SIDE, SIDE)), torch.full((SIDE, SIDE), DEPTH))
    return object_frame(points, box(12, 36), DEPTH)


def moving(motion: str, displacement: Tensor | None = None, **timing: float) -> MovingObject:
    still = torch.zeros(3, 3)
    return MovingObject(
        frame=flat_frame(),
        motion=motion,
        displacement=still if displacement is None else displacement,
        timing=replace(Timing(duration_s=2.0, key_times=17, sense=1.0), **timing),
    )


def test_the_frame_stands_on_the_lower_end() -> None:
    frame = flat_frame()
    assert frame.height == pytest.approx(3.0, rel=0.1)
    torch.testing.assert_close(frame.foot, torch.tensor([0.0, 1.5, DEPTH]), atol=0.15, rtol=0)
    assert frame.depth_range[0] < DEPTH < frame.depth_range[1]


def test_what_hides_a_part_does_not_shift_the_axis() -> None:
    points = unproject(pinhole(FOCAL_PX, (SIDE, SIDE)), torch.full((SIDE, SIDE), DEPTH))
    hidden, beside = box(12, 36), box(12, 36)
    hidden[28:, :28] = False
    beside[30:, 36:46] = True
    for inside in (hidden, beside):
        assert float(object_frame(points, inside, DEPTH).foot[0]) == pytest.approx(0, abs=1e-5)


def test_local_points_are_upright_and_face_the_camera() -> None:
    frame = replace(flat_frame(), foot=torch.tensor([1.0, 2.0, 6.0]), height=2.0)
    top_front = torch.tensor([[1.0, 0.0, 5.0]])
    torch.testing.assert_close(frame.to_local(top_front), torch.tensor([[0.0, 1.0, 0.5]]))
    points = torch.randn(7, 3)
    torch.testing.assert_close(frame.from_local(frame.to_local(points)), points)


def test_what_travels_is_displaced_too() -> None:
    travel = torch.tensor([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 2.0]])
    one, points = moving("grows", travel), flat_frame().foot[None]
    for progress, want in ((0.0, [0, 0, 0]), (0.25, [0.5, 0, 0]), (1.0, [1.0, 0, 2.0])):
        moved = one.positions(points, progress) - points
        torch.testing.assert_close(moved[0], torch.tensor(want, dtype=torch.float32))


def test_a_rolling_object_turns_by_its_travel() -> None:
    one = moving("rolls", torch.tensor([[0.0, 0, 0], [1.5 * math.pi, 0, 0]]))
    frame = one.frame
    top = frame.foot[None] - torch.tensor([0.0, frame.height, 0.0])
    half = (0.5 * frame.height * math.pi) / (1.5 * math.pi)
    moved = one.positions(top, half) - torch.tensor([0.5 * frame.height * math.pi, 0, 0])
    torch.testing.assert_close(moved, frame.foot[None], atol=1e-4, rtol=0)


def test_the_sense_turns_the_other_way() -> None:
    front = flat_frame().foot[None] - torch.tensor([0.0, 0.0, 0.5])
    ways = [moving("spins", sense=sense).positions(front, 0.2)[0, 0] for sense in (1.0, -1.0)]
    assert float(ways[0]) == pytest.approx(-float(ways[1]), abs=1e-5)
    assert abs(float(ways[0])) > 0.1


def test_few_key_times_slow_what_repeats() -> None:
    assert Timing(duration_s=2.0, key_times=13, sense=1.0).highest_hz == pytest.approx(1.0)
    assert Timing(duration_s=0.0, key_times=2, sense=1.0).highest_hz > 0
