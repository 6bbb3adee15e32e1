"""Pulses start within the budget, on what standing Gaussians do not explain."""

from dataclasses import replace

import pytest
import torch
from small_fits import ball_capture

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.canonical import raw_points
from diff4splat.fitting.fine_stage_init import Departure, Surroundings, depart
from diff4splat.fitting.frame_renderer import Sight
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.motions.spacetime import Pulses
from diff4splat.fitting.motions.still import Still
from diff4splat.fitting.pictures import FrameStore, Schedule
from diff4splat.fitting.settings import Density, FitSettings


def departed(capture: Capture, moving: int, budget: int, use_depth: bool = True) -> Departure:
    model = SceneModel(raw_points(capture.points, 0), Still((0.0, 1.0)), torch.zeros(60).bool())
    settings = FitSettings(
        motion="spacetime", harmonics=0, time_slices=4, use_depth=use_depth,
        density=Density(budget=budget),
    )  # fmt: skip
    around = Surroundings(
        sight=Sight(capture=capture), store=FrameStore(capture), schedule=Schedule(capture, 2, 0),
        settings=settings,
    )  # fmt: skip
    moves = torch.arange(60) < moving
    return depart(model, moves, Pulses((0.0, 1.0), 0.05), around)


@pytest.mark.parametrize("use_depth", [True, False])
@pytest.mark.parametrize(("moving", "budget"), [(60, 80), (60, 40), (5, 1000), (60, 10_000)])
def test_the_budget_holds_and_the_slices_cover_the_time(moving: int, budget: int, use_depth: bool):
    leaving = departed(ball_capture(views=3, times=3, held=()), moving, budget, use_depth)
    carried = int(leaving.moves.sum())
    assert carried <= max(0.75 * budget - (60 - moving), 4)
    centers = leaving.rows["time_centers_s"][leaving.moves]
    assert 2 <= len(centers.unique()) <= 4
    assert float(centers.min()) < 0.5 < float(centers.max())
    assert all(len(value) == len(leaving.moves) for value in leaving.rows.values())


def test_with_depth_pulses_start_on_pixels_of_their_time():
    capture = ball_capture(views=3, times=3, held=())
    leaving = departed(capture, 60, 10_000)
    early = leaving.rows["time_centers_s"] < 0.3
    late = leaving.rows["time_centers_s"] > 0.7
    red = leaving.rows["sh_dc"][:, 0, 0] - leaving.rows["sh_dc"][:, 0, 1] > 1.5
    x = leaving.rows["means"][:, 0]
    assert float(x[early & red].mean()) < -0.2 < 0.2 < float(x[late & red].mean())


def test_without_depth_in_the_pictures_the_moving_ones_are_repeated():
    capture = ball_capture(views=3, times=3, held=(), with_depth=False)
    leaving = departed(capture, 5, 1000)
    assert int(leaving.moves.sum()) == 4 * 5
    assert set(map(tuple, leaving.rows["means"][leaving.moves].tolist())) == set(
        map(tuple, capture.points.positions[:5].tolist())
    )


def test_nothing_that_moves_stays_as_it_is():
    capture = ball_capture(views=3, times=3, held=())
    leaving = departed(replace(capture), 0, 1000)
    assert not leaving.moves.any() and len(leaving.rows["means"]) == 60
