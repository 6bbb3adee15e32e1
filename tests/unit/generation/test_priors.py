"""Depth and displacement by the priors of a model, and what stands in where there is none."""

import math
from dataclasses import replace
from typing import NoReturn

import pytest
import torch
from image_layers import input_image, random_rgb

from diff4splat.generation import priors
from diff4splat.generation.depth.prediction import SCALES, predict_depth
from diff4splat.generation.inputs.copies import Copies, motion_copy
from diff4splat.generation.inputs.input_image import InputImage, downsample
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.rigid_components import MIN_RELATIVE_DISPLACEMENT
from diff4splat.generation.motion import object_motion
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.generation.priors import (
    ENLARGEMENT,
    image_depth,
    image_maps,
)
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.priors import MonocularDepthConfig, MotionUNetConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.motion_unet.motion_field import UNIT
from diff4splat.progress.run_log import RunLog

SIDE_PX = 32


def model_of(*parts: str) -> Model:
    config = replace(
        tiny_size(),
        monocular_depth=MonocularDepthConfig(channels=8),
        motion_unet=MotionUNetConfig(width=8, heads=1),
    )
    return Model(config=config, networks=create_networks(config, parts=parts))


def image() -> InputImage:
    return input_image(random_rgb(SIDE_PX, SIDE_PX))


@torch.no_grad()
def maps_of(model: Model, frames: int = 2, log: RunLog | None = None) -> ImageMaps:
    text = torch.randn(1, 4, model.config.text.width)
    request = MotionRequest(text=text, seed=0, settings=GenerationSettings())
    return image_maps(
        model, Copies(image=image(), small=image()), frames, [request], log or RunLog()
    )


def moves_right(model: Model, share: float, probability: float = 0.99) -> Model:
    """Everything moves by a share of its depth, as probably as that."""
    with torch.no_grad():
        model.networks.motion_unet.motion_head.bias[0] = share / UNIT
        model.networks.motion_unet.mask_head.bias.fill_(math.log(probability / (1 - probability)))
    return model


def test_without_priors_the_image_is_a_static_plane() -> None:
    log = RunLog()
    maps = maps_of(model_of(), log=log)
    assert torch.equal(maps.depth, torch.full((SIDE_PX, SIDE_PX), PLANE_DEPTH))
    assert maps.displacement is None and len(log.skipped) == 0
    assert "sample motion" not in log.phases.seconds


@torch.no_grad()
def test_the_depth_prior_decides_about_depth() -> None:
    model = model_of("monocular_depth")
    network = model.networks.monocular_depth
    for parameter in network.parameters():
        parameter.add_(0.1 * torch.randn_like(parameter))
    for reduction, scales in ((1, SCALES[:1]), (4, SCALES)):
        wanted = predict_depth(network, image().rgb, model.config.activation, scales).depth
        actual = image_depth(model, replace(image(), reduction=reduction))
        assert torch.equal(actual, wanted)
        assert float(wanted.std()) > 0


@torch.no_grad()
def test_the_depth_prior_can_see_a_larger_copy_of_a_photograph() -> None:
    model = model_of("monocular_depth")
    for parameter in model.networks.monocular_depth.parameters():
        parameter.add_(0.1 * torch.randn_like(parameter))
    config = replace(model.config, monocular_depth=MonocularDepthConfig(channels=8, photo_scale=2))
    photo = input_image(random_rgb(4 * SIDE_PX, 4 * SIDE_PX))
    copies = Copies(image=photo, small=downsample(photo, 4))
    request = MotionRequest(text=None, seed=0, settings=GenerationSettings())
    maps = image_maps(replace(model, config=config), copies, 2, [request], RunLog())
    assert maps.depth.shape == (SIDE_PX, SIDE_PX)
    assert torch.equal(maps.fine.depth, image_depth(model, downsample(photo, 2)))
    inverse = (1 / maps.fine.depth).unflatten(0, (-1, 2)).unflatten(2, (-1, 2))
    torch.testing.assert_close(1 / maps.depth, inverse.mean((1, 3)))
    whole = Copies(image=copies.small, small=replace(copies.small, reduction=1))
    assert image_maps(replace(model, config=config), whole, 2, [request], RunLog()).fine is None


@pytest.mark.parametrize("size", [2, 4])
def test_towers_of_photographs_are_straightened(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    """Of an image that the depth prior sees whole they are as predicted."""
    monkeypatch.setattr(priors, "straightened", torch.full_like)
    model = model_of("monocular_depth")
    config = replace(model.config, monocular_depth=MonocularDepthConfig(channels=8, photo_scale=2))
    image = input_image(random_rgb(size * SIDE_PX, size * SIDE_PX))
    focal_px = float(downsample(image, size // 2).camera.focal_px[1])
    copies = Copies(image=image, small=downsample(image, size))
    request = MotionRequest(text=None, seed=0, settings=GenerationSettings())
    maps = image_maps(replace(model, config=config), copies, 2, [request], RunLog())
    assert bool((maps.fine.depth == focal_px).all()) == (size == 4)


@pytest.mark.parametrize("score", [0.0, 0.5])
def test_parts_of_photographs_out_of_domain_are_supported(
    monkeypatch: pytest.MonkeyPatch, score: float
) -> None:
    """In the domain of training something may float."""
    predicted = priors.predicted_depth
    monkeypatch.setattr(
        priors,
        "predicted_depth",
        lambda *args, **more: replace(predicted(*args, **more), out_of_domain=torch.tensor(score)),
    )
    monkeypatch.setattr(priors, "with_support", lambda depth, rgb: 2 * depth + rgb[..., 0])
    model = model_of("monocular_depth")
    config = replace(model.config, monocular_depth=MonocularDepthConfig(channels=8, photo_scale=2))
    image = input_image(random_rgb(4 * SIDE_PX, 4 * SIDE_PX))
    copies = Copies(image=image, small=downsample(image, 4))
    request = MotionRequest(text=None, seed=0, settings=GenerationSettings())
    maps = image_maps(replace(model, config=config), copies, 2, [request], RunLog())
    plain = priors.image_depth(model, downsample(image, 2))
    expected = 2 * plain + downsample(image, 2).rgb[..., 0] if score else plain
    torch.testing.assert_close(maps.fine.depth, expected)


@torch.no_grad()
@pytest.mark.parametrize("reduction", [1, 3])
def test_an_image_backbone_sees_an_enlarged_copy_of_an_image_without_more_pixels(
    reduction: int,
) -> None:
    prior = MonocularDepthConfig(channels=4, photo_scale=2, image_backbone=True)
    config = replace(tiny_size(), monocular_depth=prior)
    model = Model(config=config, networks=create_networks(config, parts=("monocular_depth",)))
    torch.nn.init.normal_(model.networks.monocular_depth.head.weight, std=0.1)
    photo = input_image(random_rgb(reduction * SIDE_PX, reduction * SIDE_PX))
    copies = Copies(image=photo, small=downsample(photo, reduction))
    request = MotionRequest(text=None, seed=0, settings=GenerationSettings())
    maps = image_maps(model, copies, 2, [request], RunLog())
    scales = [ENLARGEMENT * scale for scale in (SCALES if reduction > 1 else SCALES[:1])]
    network, activation = model.networks.monocular_depth, config.activation
    wanted = predict_depth(network, copies.small.rgb, activation, scales).depth
    assert torch.equal(maps.depth, wanted) and float(wanted.std()) > 0 and maps.fine is None
    if reduction > 1:
        return
    large = input_image(random_rgb(2 * SIDE_PX, 2 * SIDE_PX))
    fine = image_maps(
        model, Copies(image=large, small=downsample(large, 2)), 2, [request], RunLog()
    ).fine
    # A copy with its own pixels is large enough already.
    assert torch.equal(fine.depth, predict_depth(network, large.rgb, activation, SCALES[:1]).depth)


@torch.no_grad()
def test_the_motion_prior_can_see_a_larger_copy_of_a_photograph() -> None:
    model = moves_right(model_of("motion_unet"), 0.25)
    priors = replace(model.config.motion_unet, input_scale=2)
    model = replace(model, config=replace(model.config, motion_unet=priors))
    photo = input_image(random_rgb(4 * SIDE_PX, 4 * SIDE_PX))
    request = MotionRequest(text=None, seed=0, settings=GenerationSettings())
    copies = Copies(image=photo, small=downsample(photo, 4))
    maps = image_maps(model, copies, 2, [request], RunLog())
    assert maps.fine.displacement.shape == (2, 2 * SIDE_PX, 2 * SIDE_PX, 3)
    assert maps.displacement.shape == (2, SIDE_PX, SIDE_PX, 3)
    for found in (maps.displacement, maps.fine.displacement):
        expected = torch.full_like(found[1, ..., 0], 0.25 * PLANE_DEPTH)
        torch.testing.assert_close(found[1, ..., 0], expected)


@torch.no_grad()
@pytest.mark.parametrize("reduction", [1, 3])
def test_the_motion_prior_sees_an_enlarged_copy_of_an_image_without_more_pixels(
    reduction: int,
) -> None:
    model = moves_right(model_of("motion_unet"), 0.25)
    priors = replace(model.config.motion_unet, input_scale=2)
    model = replace(model, config=replace(model.config, motion_unet=priors))
    photo = input_image(random_rgb(reduction * SIDE_PX, reduction * SIDE_PX))
    copies = Copies(image=photo, small=downsample(photo, reduction))
    assert motion_copy(copies, 2).rgb.shape == (2 * SIDE_PX, 2 * SIDE_PX, 3)
    request = MotionRequest(text=None, seed=0, settings=GenerationSettings())
    maps = image_maps(model, copies, 2, [request], RunLog())
    assert maps.fine is None and maps.displacement.shape == (2, SIDE_PX, SIDE_PX, 3)
    expected = torch.full((SIDE_PX, SIDE_PX), 0.25 * PLANE_DEPTH)
    torch.testing.assert_close(maps.displacement[1, ..., 0], expected)


def test_displacement_is_a_share_of_depth_from_zero_on() -> None:
    maps = maps_of(moves_right(model_of("motion_unet"), 0.25), frames=3)
    assert maps.displacement.shape == (3, SIDE_PX, SIDE_PX, 3)
    assert not maps.displacement[0].any() and not maps.displacement[..., 1:].any()
    later = maps.displacement[1:, ..., 0]
    torch.testing.assert_close(later, torch.full_like(later, 0.25 * PLANE_DEPTH))


@pytest.mark.parametrize(
    ("share", "probability", "moves"),
    [
        (0.25, 0.05, False),
        (0.25, 0.3, True),
        (0.9 * MIN_RELATIVE_DISPLACEMENT, 0.9, False),
        (1.1 * MIN_RELATIVE_DISPLACEMENT, 0.9, True),
    ],
)
def test_what_hardly_or_improbably_moves_is_static(
    share: float, probability: float, moves: bool
) -> None:
    maps = maps_of(moves_right(model_of("motion_unet"), share, probability))
    assert (maps.displacement is not None) is moves


def test_one_latent_frame_has_no_motion() -> None:
    log = RunLog()
    maps = maps_of(moves_right(model_of("motion_unet"), 0.25), frames=1, log=log)
    assert maps.displacement is None and "sample motion" not in log.phases.seconds


def test_saved_guidance_passes_are_noted() -> None:
    log = RunLog()
    maps_of(model_of("motion_unet"), log=log)
    (omission,) = log.skipped
    assert omission.what == "guidance pass" and "weight of 1" in omission.why


class Halves:
    """Finds the left part for a text of zeros, and the right part for others."""

    def __call__(self, image: torch.Tensor, text: torch.Tensor) -> torch.Tensor:
        """Of the mirror image, as a mean with it asks."""
        return self.predict_mask_and_instances(image, text)[0].flip(-1)

    def predict_mask_and_instances(
        self, image: torch.Tensor, text: torch.Tensor, text_mask: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, None]:
        """Sure logits, and no vectors."""
        del text_mask
        logits, third = torch.full((1, *image.shape[2:]), -9.0), image.shape[-1] // 3
        logits[..., slice(-third, None) if text.any() else slice(third)] = 9.0
        return logits, None


class ByText:
    """To the right for a text of zeros, to the left for others; it keeps the masks it is shown."""

    def __init__(self) -> None:
        self.masks: list[torch.Tensor | None] = []

    def __call__(
        self,
        image: torch.Tensor,
        noisy: torch.Tensor,
        level: torch.Tensor,
        text: torch.Tensor | None = None,
        text_mask: torch.Tensor | None = None,
        object_mask: torch.Tensor | None = None,
    ) -> torch.Tensor:
        """Far enough to count as motion."""
        del image, level, text_mask
        self.masks.append(object_mask)
        motion = torch.zeros_like(noisy)
        motion[:, 0] = (-2 if text.any() else 2) * MIN_RELATIVE_DISPLACEMENT / UNIT
        return motion

    def predict_motion_and_mask(self, *inputs: torch.Tensor | None) -> NoReturn:
        """The object mask says what moves."""
        raise AssertionError(f"{len(inputs)} inputs")


@torch.no_grad()
@pytest.mark.parametrize("shown", [False, True])
def test_each_event_moves_its_own_object_by_its_own_text(shown: bool) -> None:
    model, prior = model_of("motion_unet"), ByText()
    config = replace(
        model.config, motion_unet=MotionUNetConfig(width=8, heads=1, object_mask=shown)
    )
    networks = replace(model.networks, motion_unet=prior, object_mask=Halves())
    model = replace(model, config=config, networks=networks)
    gray = input_image(torch.full((SIDE_PX, SIDE_PX, 3), 0.5))
    states = torch.zeros(1, 4, model.config.text.width)
    requests = [
        MotionRequest(text=text, seed=0, settings=GenerationSettings())
        for text in (states, states + 1)
    ]
    log = RunLog()
    maps = image_maps(model, Copies(image=gray, small=gray), 2, requests, log)
    x = maps.displacement[1, SIDE_PX // 2, :, 0]
    assert bool((x[:8] > 0).all()) and bool((x[-8:] < 0).all())
    if shown:
        first, second = prior.masks
        assert bool(first[0, :, :8].all()) and not first[0, :, 16:].any()
        assert bool(second[0, :, -8:].all()) and not second[0, :, :16].any()
    else:
        assert prior.masks == [None, None]


@torch.no_grad()
def test_the_motion_network_does_not_run_where_nothing_is_to_move() -> None:
    model, log = model_of("motion_unet"), RunLog()
    model = moves_right(model, 2 * MIN_RELATIVE_DISPLACEMENT, probability=1e-9)
    assert maps_of(model, log=log).displacement is None
    assert "sample motion" not in log.phases.seconds
    assert "motion U-Net" in {item.what for item in log.skipped}


@torch.no_grad()
def test_the_rim_of_an_object_moves_with_its_event(monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of("motion_unet")
    networks = replace(model.networks, motion_unet=ByText(), object_mask=Halves())
    model = replace(model, networks=networks)
    rgb = torch.full((SIDE_PX, SIDE_PX, 3), 0.5)
    rgb[:, : SIDE_PX // 3], rgb[:, -(SIDE_PX // 3) :] = 0.0, 1.0
    states = torch.zeros(1, 4, model.config.text.width)
    requests = [
        MotionRequest(text=text, seed=0, settings=GenerationSettings())
        for text in (states, states + 1)
    ]
    reached = {}
    for with_rim in (False, True):
        if with_rim:
            grow = lambda mask, depth, _: (grown(mask, 2), depth)  # noqa: E731
            monkeypatch.setattr(object_motion, "with_rim", grow)
        else:
            monkeypatch.setattr(object_motion, "with_rim", lambda mask, depth, _: (mask, depth))
        copies = Copies(image=input_image(rgb), small=input_image(rgb))
        x = image_maps(model, copies, 2, requests, RunLog()).displacement[1, 16, :, 0]
        reached[with_rim] = [int((x > 0).sum()), int((x < 0).sum())]
    narrow, wide = reached[False], reached[True]
    assert all(after > before for before, after in zip(narrow, wide, strict=True))


def test_nothing_moves_without_a_request() -> None:
    model = moves_right(model_of("motion_unet"), 2 * MIN_RELATIVE_DISPLACEMENT)
    copies = Copies(image=image(), small=image())
    assert image_maps(model, copies, 2, [], RunLog()).displacement is None
