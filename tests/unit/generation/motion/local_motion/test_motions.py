"""Motions of an object about itself: at rest first, and as procedural worlds move objects."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.captions.vocabulary import IN_PLACE, OF_PARTS, ROLLING
from diff4splat.generation.motion.local_motion import motions
from diff4splat.generation.motion.local_motion.motions import LOCAL_MOTIONS, Moment

RIGID = ("rolls", "tumbles", "spins")


def moment(
    progress: float, *, travel: tuple[float, ...] = (0.0, 0.0, 0.0), seconds: float = 2.0
) -> Moment:
    return Moment(
        time_s=progress * seconds,
        progress=progress,
        highest_hz=100.0,
        travel=torch.tensor(travel, dtype=torch.float64),
    )


def random_points(count: int = 50) -> Tensor:
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(count, 3, generator=generator, dtype=torch.float64)
    return points * torch.tensor([1.0, 1.0, 1.0]) - torch.tensor([0.5, 0.0, 0.5])


def test_every_motion_about_itself_is_there() -> None:
    assert set(LOCAL_MOTIONS) == {*ROLLING, *IN_PLACE} - set(OF_PARTS)


@pytest.mark.parametrize("name", LOCAL_MOTIONS)
def test_all_start_at_rest(name: str) -> None:
    points, start = random_points(), moment(0.0)
    torch.testing.assert_close(LOCAL_MOTIONS[name].positions(points, start), points)
    assert LOCAL_MOTIONS[name].growth(start) == pytest.approx(1.0)


@pytest.mark.parametrize("name", LOCAL_MOTIONS)
def test_all_move_something(name: str) -> None:
    points, later = random_points(), moment(0.3, travel=(0.4, 0.0, 0.3))
    moved = LOCAL_MOTIONS[name].positions(points, later)
    assert float((moved - points).norm(dim=1).max()) > 0.01


@settings(deadline=None, max_examples=50)
@given(
    st.sampled_from(RIGID),
    st.floats(0, 1),
    st.tuples(st.floats(-50, 50), st.floats(-1, 1), st.floats(-50, 50)),
)
def test_what_turns_is_rigid(name: str, progress: float, travel: tuple[float, ...]) -> None:
    points = random_points()
    moved = LOCAL_MOTIONS[name].positions(points, moment(progress, travel=travel))
    torch.testing.assert_close(torch.cdist(moved, moved), torch.cdist(points, points))
    turned = (moved[1:4] - moved[0]).det() / (points[1:4] - points[0]).det()
    assert float(turned) == pytest.approx(1.0)


@settings(deadline=None, max_examples=50)
@given(
    st.sampled_from(list(LOCAL_MOTIONS)),
    st.floats(0, 1),
    st.floats(0, 1e6),
    st.tuples(*[st.floats(-1e6, 1e6)] * 3),
)
def test_any_moment_is_finite(
    name: str, progress: float, seconds: float, travel: tuple[float, ...]
) -> None:
    at = moment(progress, travel=travel, seconds=seconds)
    points = 10 * random_points()
    assert bool(LOCAL_MOTIONS[name].positions(points, at).isfinite().all())
    assert math.isfinite(math.log(LOCAL_MOTIONS[name].growth(at)))


@pytest.mark.parametrize("travel", [(0.7, 0.0, 0.0), (0.0, 0.0, -0.4), (-0.3, 0.0, 0.2)])
def test_the_ground_moves_along_under_what_rolls(travel: tuple[float, float, float]) -> None:
    step = 1e-4
    foot = torch.zeros(1, 3, dtype=torch.float64)
    later = LOCAL_MOTIONS["rolls"].positions(foot, moment(1, travel=[step * one for one in travel]))
    # The lowest point goes back as far as the object goes on.
    torch.testing.assert_close(later[0] / step, -torch.tensor(travel).double(), atol=1e-3, rtol=0)


def test_to_the_right_it_rolls_clockwise() -> None:
    top = torch.tensor([[0.0, 1.0, 0.0]], dtype=torch.float64)
    moved = LOCAL_MOTIONS["rolls"].positions(top, moment(1, travel=(0.25 * math.pi, 0, 0)))
    torch.testing.assert_close(moved[0], torch.tensor([0.5, 0.5, 0.0]).double())


def test_the_lowest_edge_of_a_tumbling_box_is_on_the_ground() -> None:
    corners = torch.cartesian_prod(*torch.tensor([[-0.5, 0.5], [0, 1], [-0.5, 0.5]]).double())
    for distance in np.linspace(0, 3, 20):
        moved = LOCAL_MOTIONS["tumbles"].positions(corners, moment(1, travel=(distance, 0, 0)))
        assert float(moved[:, 1].min()) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("name", "last"), [("grows", 1.6), ("shrinks", 0.625)])
def test_size_grows_and_shrinks_from_the_foot(name: str, last: float) -> None:
    points, end = random_points(), moment(1.0)
    moved = LOCAL_MOTIONS[name].positions(points, end)
    torch.testing.assert_close(moved, last * points)
    assert LOCAL_MOTIONS[name].growth(end) == pytest.approx(last)


def test_what_is_squashed_keeps_its_volume() -> None:
    axes = torch.eye(3, dtype=torch.float64)
    for progress in np.linspace(0, 1, 9):
        stretched = LOCAL_MOTIONS["squashes"].positions(axes, moment(progress))
        assert float(stretched.det()) == pytest.approx(1.0)


@pytest.mark.parametrize("progress", [0.1, 0.45, 0.8])
def test_a_bent_axis_keeps_its_length(progress: float) -> None:
    axis = torch.zeros(2001, 3, dtype=torch.float64)
    axis[:, 1] = torch.linspace(0, 1, len(axis))
    bent = LOCAL_MOTIONS["bends"].positions(axis, moment(progress))
    assert float(bent.diff(dim=0).norm(dim=1).sum()) == pytest.approx(1.0, abs=1e-5)


def test_a_bend_is_that_of_procedural_worlds() -> None:
    points, at = random_points(), moment(0.3)
    points[:, 1] = points[:, 1].clamp(0, 1)
    curve = motions.BEND_RAD * math.sin(at.phase(motions.BEND_HZ))
    share, x = points[:, 1].numpy(), points[:, 0].numpy()
    angle = curve * share
    # data_prep.synthetic.motions.soft.bends, whose y is down; there the fall of the side is
    # scaled by the height, which keeps the foot flat.
    want_x = (1 - np.cos(angle)) / curve + x * np.cos(angle)
    want_y = np.sin(angle) / curve - x * np.sin(angle)
    moved = LOCAL_MOTIONS["bends"].positions(points, at).numpy()
    np.testing.assert_allclose(moved[:, 0], want_x, atol=1e-12)
    np.testing.assert_allclose(moved[:, 1], want_y, atol=1e-12)


@pytest.mark.parametrize("name", ["twists", "bends", "wobbles", "sways"])
def test_the_foot_stays_where_it_is(name: str) -> None:
    foot = random_points() * torch.tensor([1.0, 0.0, 1.0])
    moved = LOCAL_MOTIONS[name].positions(foot, moment(0.3))
    torch.testing.assert_close(moved, foot)


def test_a_spin_turns_by_as_much_as_is_said_and_the_other_way() -> None:
    front = torch.tensor([[0.0, 0.5, 1.0]], dtype=torch.float64)
    angle = 2 * math.pi * motions.TURNS
    moved = LOCAL_MOTIONS["spins"].positions(front, moment(1.0))[0]
    want = torch.tensor([math.sin(angle), 0.5, math.cos(angle)], dtype=torch.float64)
    torch.testing.assert_close(moved, want)


def test_what_repeats_is_no_faster_than_key_times_can_follow() -> None:
    at = Moment(time_s=2.0, progress=1.0, highest_hz=0.25, travel=torch.zeros(3))
    assert at.phase(1.7) == pytest.approx(math.pi)
    assert at.phase(0.1) == pytest.approx(0.4 * math.pi)
