"""What moves is the object mask's, how it moves the motion U-Net's."""

from dataclasses import replace

import torch

from diff4splat.generation.motion_networks import motion_prior
from diff4splat.models.config.priors import MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.networks import Networks

CONFIG = replace(
    tiny_size(),
    motion_unet=MotionUNetConfig(width=8, heads=1),
    object_mask=ObjectMaskConfig(width=4),
)


def networks() -> Networks:
    return create_networks(CONFIG, parts=("motion_unet", "object_mask"))


@torch.no_grad()
def test_motion_of_one_and_mask_of_the_other() -> None:
    parts = networks()
    image, noisy, level = torch.rand(1, 3, 32, 32), torch.randn(1, 3, 1, 8, 8), torch.ones(1)
    text = torch.randn(1, 5, CONFIG.text.width)
    both = motion_prior(parts)
    motion, mask = both.predict_motion_and_mask(image, noisy, level, text)
    assert torch.equal(motion, parts.motion_unet(image, noisy, level, text))
    assert torch.equal(motion, both(image, noisy, level, text))
    assert torch.equal(mask, parts.object_mask(image, text))


@torch.no_grad()
def test_without_text_the_motion_prior_decides() -> None:
    parts = networks()
    image, noisy, level = torch.rand(1, 3, 32, 32), torch.randn(1, 3, 1, 8, 8), torch.ones(1)
    own = parts.motion_unet.predict_motion_and_mask(image, noisy, level)
    for one, other in zip(
        own, motion_prior(parts).predict_motion_and_mask(image, noisy, level), strict=True
    ):
        assert torch.equal(one, other)


def test_models_without_an_object_mask_or_without_motion() -> None:
    parts = networks()
    assert motion_prior(replace(parts, object_mask=None)) is parts.motion_unet
    assert motion_prior(replace(parts, motion_unet=None)) is None
