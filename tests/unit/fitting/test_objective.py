"""Flow and depth take part where the capture has them."""

from dataclasses import replace

import pytest
import torch
from small_fits import Pictures, ball_capture, balls, with_flow

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.canonical import raw_gaussians
from diff4splat.fitting.frame_renderer import Sight
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.motions.spacetime import Pulses
from diff4splat.fitting.objective import Objective
from diff4splat.fitting.pictures import FrameStore
from diff4splat.fitting.settings import FitSettings, Weights


def flowing(offset_px: float) -> Capture:
    capture = ball_capture(views=2, times=2, held=())
    shown = list(capture.frames.shown)
    shown[0] = with_flow(shown[0], 1, torch.tensor([offset_px, 0.0]))
    return replace(capture, frames=Pictures(shown=shown))


def loss_and_velocity_gradient(capture: Capture, weights: Weights) -> tuple[float, torch.Tensor]:
    rows = raw_gaussians(balls(0.0).to(torch.float32), 0)
    model = SceneModel(rows, Pulses((0.0, 1.0), 0.1), torch.ones(5, dtype=torch.bool))
    settings = FitSettings(motion="spacetime", weights=weights)
    goal = Objective(sight=Sight(capture=capture), store=FrameStore(capture), settings=settings)
    loss, means, _ = goal.loss(model, 0.0, [0], 0)
    loss.backward()
    assert means.grad is not None
    return float(loss.detach()), model.table["velocities"].grad


def test_flow_to_the_right_asks_for_velocity_to_the_right():
    still, _ = loss_and_velocity_gradient(flowing(4.0), Weights())
    loss, gradient = loss_and_velocity_gradient(flowing(4.0), Weights(flow=1.0))
    assert loss == pytest.approx(still + 4.0 / 24, rel=0.05)
    assert float(gradient[:, 0].sum()) < 0


def test_without_flow_in_the_capture_its_weight_changes_nothing():
    capture = ball_capture(views=2, times=2, held=())
    assert (
        loss_and_velocity_gradient(capture, Weights(flow=1.0))[0]
        == loss_and_velocity_gradient(capture, Weights())[0]
    )


def test_depth_takes_part_only_where_it_may():
    capture = ball_capture(views=2, times=2, held=())
    with_depth, _ = loss_and_velocity_gradient(capture, Weights(depth=1.0))
    without, _ = loss_and_velocity_gradient(capture, Weights(depth=0.0))
    assert with_depth > without
