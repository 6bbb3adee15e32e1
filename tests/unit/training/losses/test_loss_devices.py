"""Nothing is made on another device than the inputs': the meta device refuses mixtures."""

from collections.abc import Callable

import pytest
import torch

from diff4splat.metrics.features.load import load_features
from diff4splat.training.losses.autoencoder import charbonnier, kl_divergence
from diff4splat.training.losses.depth import depth_correlation, depth_smoothness
from diff4splat.training.losses.flow_matching import flow_matching
from diff4splat.training.losses.motion import track_motion
from diff4splat.training.losses.photometric import perceptual_error, squared_error
from diff4splat.training.losses.timestep_sampling import LevelDistribution, sample_levels

LOSSES: dict[str, Callable[[torch.Tensor, torch.Tensor], torch.Tensor]] = {
    "flow": lambda own, true: flow_matching(own, true, true, first_frame_is_clean=True),
    "squared": squared_error,
    "perceptual": lambda own, true: perceptual_error(own, true, load_features(None)),
    "depth": lambda own, true: depth_correlation(own[..., 0], true[..., 0]),
    "smoothness": lambda own, true: depth_smoothness(own[..., 0]),
    "motion": track_motion,
    "divergence": kl_divergence,
    "charbonnier": charbonnier,
}


@pytest.mark.parametrize("name", LOSSES)
def test_losses_stay_on_their_device(name: str) -> None:
    own, true = (torch.empty(2, 2, 8, 9, 3, device="meta") for _ in "ab")
    own.requires_grad_()
    loss = LOSSES[name](own, true)
    loss.sum().backward()
    assert loss.shape == (2,)
    assert {loss.device.type, own.grad.device.type} == {"meta"}


def test_levels_stay_on_their_device() -> None:
    uniform = torch.empty(3, device="meta")
    levels = sample_levels(uniform, LevelDistribution(kind="logit_normal", shift=3.0))
    assert levels.device.type == "meta"
