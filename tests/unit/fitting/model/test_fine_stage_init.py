"""Pulses start within the budget, on what standing Gaussians do not explain."""

from dataclasses import replace

import pytest
import torch
from small_fits import ball_capture

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.frames.frame_renderer import FrameRenderer
from diff4splat.fitting.frames.frame_schedule import FrameSchedule
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.model.canonical import params_from_points
from diff4splat.fitting.model.fine_stage_init import FineStageInit, InitContext, init_fine_stage
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.motions.spacetime import SpacetimeGaussians
from diff4splat.fitting.motions.static import NoMotion
from diff4splat.fitting.settings import DensitySettings, FitSettings


def departed(capture: Capture, moving: int, budget: int, use_depth: bool = True) -> FineStageInit:
    model = SceneModel(
        params_from_points(capture.points, 0), NoMotion((0.0, 1.0)), torch.zeros(60).bool()
    )
    settings = FitSettings(
        motion="spacetime", harmonics=0, time_slices=4, use_depth=use_depth,
        density=DensitySettings(budget=budget),
    )  # fmt: skip
    context = InitContext(
        renderer=FrameRenderer(capture=capture), store=FrameStore(capture),
        schedule=FrameSchedule(capture, 2, 0),
        settings=settings,
    )  # fmt: skip
    moves = torch.arange(60) < moving
    return init_fine_stage(model, moves, SpacetimeGaussians((0.0, 1.0), 0.05), context)


@pytest.mark.parametrize("use_depth", [True, False])
@pytest.mark.parametrize(("moving", "budget"), [(60, 80), (60, 40), (5, 1000), (60, 10_000)])
def test_the_budget_holds_and_the_slices_cover_the_time(moving: int, budget: int, use_depth: bool):
    leaving = departed(ball_capture(views=3, times=3, held=()), moving, budget, use_depth)
    carried = int(leaving.moving_mask.sum())
    assert carried <= max(0.75 * budget - (60 - moving), 4)
    centers = leaving.rows["time_centers_s"][leaving.moving_mask]
    assert 2 <= len(centers.unique()) <= 4
    assert float(centers.min()) < 0.5 < float(centers.max())
    assert all(len(value) == len(leaving.moving_mask) for value in leaving.rows.values())


def test_with_depth_pulses_start_on_pixels_of_their_time():
    capture = ball_capture(views=3, times=3, held=())
    leaving = departed(capture, 60, 10_000)
    early = leaving.rows["time_centers_s"] < 0.3
    late = leaving.rows["time_centers_s"] > 0.7
    red = leaving.rows["sh_dc"][:, 0, 0] - leaving.rows["sh_dc"][:, 0, 1] > 1.5
    x = leaving.rows["means"][:, 0]
    assert float(x[early & red].mean()) < -0.2 < 0.2 < float(x[late & red].mean())


def test_without_depth_in_the_images_the_moving_ones_are_repeated():
    capture = ball_capture(views=3, times=3, held=(), with_depth=False)
    leaving = departed(capture, 5, 1000)
    assert int(leaving.moving_mask.sum()) == 4 * 5
    assert set(map(tuple, leaving.rows["means"][leaving.moving_mask].tolist())) == set(
        map(tuple, capture.points.positions[:5].tolist())
    )


def test_nothing_that_moves_stays_as_it_is():
    capture = ball_capture(views=3, times=3, held=())
    leaving = departed(replace(capture), 0, 1000)
    assert not leaving.moving_mask.any() and len(leaving.rows["means"]) == 60
