"""Flow and depth take part where the capture has them."""

from dataclasses import replace

import pytest
import torch
from small_fits import Images, ball_capture, balls, with_flow

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.frames.frame_renderer import FrameRenderer
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.model.canonical import params_from_gaussians
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.motions.spacetime import SpacetimeGaussians
from diff4splat.fitting.objective.step_objective import Objective
from diff4splat.fitting.settings import FitSettings, LossWeights


def flowing(offset_px: float) -> Capture:
    capture = ball_capture(views=2, times=2, held=())
    shown = list(capture.frames.shown)
    shown[0] = with_flow(shown[0], 1, torch.tensor([offset_px, 0.0]))
    return replace(capture, frames=Images(shown=shown))


def loss_and_velocity_gradient(
    capture: Capture, weights: LossWeights
) -> tuple[float, torch.Tensor]:
    rows = params_from_gaussians(balls(0.0).to(torch.float32), 0)
    model = SceneModel(rows, SpacetimeGaussians((0.0, 1.0), 0.1), torch.ones(5, dtype=torch.bool))
    settings = FitSettings(motion="spacetime", weights=weights)
    goal = Objective(
        renderer=FrameRenderer(capture=capture), store=FrameStore(capture), settings=settings
    )
    loss, means, _ = goal.loss(model, 0.0, [0], 0)
    loss.backward()
    assert means.grad is not None
    return float(loss.detach()), model.table["velocities"].grad


def test_flow_to_the_right_asks_for_velocity_to_the_right():
    still, _ = loss_and_velocity_gradient(flowing(4.0), LossWeights())
    loss, gradient = loss_and_velocity_gradient(flowing(4.0), LossWeights(flow=1.0))
    assert loss == pytest.approx(still + 4.0 / 24, rel=0.05)
    assert float(gradient[:, 0].sum()) < 0


def test_without_flow_in_the_capture_its_weight_changes_nothing():
    capture = ball_capture(views=2, times=2, held=())
    assert (
        loss_and_velocity_gradient(capture, LossWeights(flow=1.0))[0]
        == loss_and_velocity_gradient(capture, LossWeights())[0]
    )


def test_depth_takes_part_only_where_it_may():
    capture = ball_capture(views=2, times=2, held=())
    with_depth, _ = loss_and_velocity_gradient(capture, LossWeights(depth=1.0))
    without, _ = loss_and_velocity_gradient(capture, LossWeights(depth=0.0))
    assert with_depth > without
