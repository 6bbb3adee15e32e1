"""The networks of a motion prior."""

from dataclasses import replace

import torch

from diff4splat.captions.image_classes.class_nouns import class_rows
from diff4splat.generation.motion.networks import motion_prior
from diff4splat.models.config.priors import MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.networks import Networks
from diff4splat.models.object_mask.enlarged import enlarged, reduced

CONFIG = replace(
    tiny_size(),
    motion_unet=MotionUNetConfig(width=8, heads=1),
    object_mask=ObjectMaskConfig(width=4),
)

MANY = tuple(range(600))
"""Classes, so that a random classifier sees some."""


def networks() -> Networks:
    return create_networks(CONFIG, parts=("motion_unet", "object_mask"))


@torch.no_grad()
def test_motion_and_its_own_mask_are_those_of_the_motion_prior() -> None:
    parts = networks()
    given = (
        torch.rand(1, 3, 32, 32),
        torch.randn(1, 3, 1, 8, 8),
        torch.ones(1),
        torch.randn(1, 5, CONFIG.text.width),
    )
    own, both = parts.motion_unet, motion_prior(parts)
    assert torch.equal(both(*given), own(*given))
    for one, other in zip(
        own.predict_motion_and_mask(*given), both.predict_motion_and_mask(*given), strict=True
    ):
        assert torch.equal(one, other)


def test_models_without_an_object_mask_or_without_motion() -> None:
    parts = networks()
    assert motion_prior(replace(parts, object_mask=None)) is parts.motion_unet
    assert motion_prior(replace(parts, motion_unet=None)) is None


@torch.no_grad()
def test_an_image_and_its_mirror_image_give_the_same_mask() -> None:
    prior = motion_prior(networks())
    image, text = torch.rand(1, 3, 32, 32), torch.randn(1, 5, CONFIG.text.width)
    maps = prior.object_maps(image, text)
    logits = maps.logits
    torch.testing.assert_close(prior.object_maps(image.flip(-1), text).logits, logits.flip(-1))
    assert maps.instances is None
    own = prior.object_mask(enlarged(image), text)
    other = prior.object_mask(enlarged(image.flip(-1)), text).flip(-1)
    expected = reduced((own + other)[None] / 2, (32, 32))[0]
    torch.testing.assert_close(logits, expected)


@torch.no_grad()
def test_the_image_classifier_corrects_prompts_that_name_classes() -> None:
    config = replace(CONFIG, object_mask=replace(CONFIG.object_mask, image_classifier=True))
    parts = create_networks(config, parts=("motion_unet", "object_mask", "image_classifier"))
    torch.nn.init.normal_(parts.image_classifier.output.weight, std=0.5)
    image, text = torch.rand(1, 3, 32, 32), torch.randn(1, 5, CONFIG.text.width)
    prior, without = motion_prior(parts), motion_prior(replace(parts, image_classifier=None))
    own = without.object_maps(image, text).logits
    assert torch.equal(without.object_maps(image, text, MANY).logits, own)
    assert torch.equal(prior.object_maps(image, text).logits, own)
    corrected = prior.object_maps(image, text, MANY).logits
    rows = class_rows([MANY])[None]
    torch.testing.assert_close(corrected, parts.image_classifier(image, own[:, None], rows)[:, 0])
    assert not torch.equal(corrected, own)
