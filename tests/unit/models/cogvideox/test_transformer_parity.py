"""The joint video model holds CogVideoX's weights: its outputs are those of diffusers."""

from dataclasses import dataclass, replace

import cogvideox_folder
import pytest
import torch
from torch import Tensor, nn

from diff4splat.models.cogvideox.noise_schedule import (
    path_norm,
    step_of_level,
    v_from_velocity,
)
from diff4splat.models.hub.model import Model
from diff4splat.models.video_dit.conditions import ImageCondition, RenderCondition

FRAMES, ROWS, COLUMNS = 3, 4, 6
LEVEL = 0.6180
FP32 = 1e-5


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """Of one call, for a batch of two; frames as diffusers pads them."""

    latent: Tensor
    text: Tensor
    channels: Tensor | None

    @property
    def image(self) -> ImageCondition | None:
        return None if self.channels is None else ImageCondition(channels=self.channels)


def inputs(kind: str, rows: int = ROWS, columns: int = COLUMNS) -> Inputs:
    generator = torch.Generator().manual_seed(5)
    frames = FRAMES + 1 if kind.startswith("1.5") else FRAMES
    shape = (2, cogvideox_folder.CHANNELS, frames, rows, columns)
    text = (2, cogvideox_folder.TEXT_TOKENS, cogvideox_folder.TEXT_WIDTH)
    return Inputs(
        latent=torch.randn(shape, generator=generator),
        text=torch.randn(text, generator=generator),
        channels=torch.randn(shape, generator=generator) if kind.endswith("i2v") else None,
    )


@torch.no_grad()
def reference(network: nn.Module, kind: str, model: Model, given: Inputs) -> Tensor:
    """v of the noisy latent that belongs to ours, as the pipelines call it."""
    from diffusers.pipelines.cogvideo.pipeline_cogvideox import CogVideoXPipeline

    level = torch.full((2,), LEVEL)
    dtype = network.proj_out.weight.dtype
    latent = given.latent / path_norm(level)[0]
    if given.channels is not None:
        latent = torch.cat([latent, given.channels], 1)

    class Pipeline:
        transformer, vae_scale_factor_spatial = network, 8

    rope = CogVideoXPipeline._prepare_rotary_positional_embeddings(
        Pipeline,
        8 * latent.shape[3],
        8 * latent.shape[4],
        latent.shape[2],
        torch.device("cpu"),
    )
    return (
        network(
            latent.transpose(1, 2).to(dtype),
            given.text.to(dtype),
            step_of_level(level, model.config.joint),
            ofs=torch.full((1,), 2.0).to(dtype) if kind == "1.5_i2v" else None,
            image_rotary_emb=None if kind == "2b" else rope,
            return_dict=False,
        )[0]
        .transpose(1, 2)
        .float()
    )


@torch.no_grad()
def ours(model: Model, given: Inputs, **conditions: object) -> Tensor:
    """Our velocity as v."""
    level = torch.full(given.latent.shape[:1] + given.latent.shape[2:3], LEVEL)
    dit = model.networks.dit
    velocity = dit(given.latent, level, text=given.text, image=given.image, **conditions)
    return v_from_velocity(given.latent.float(), velocity.float(), torch.tensor(LEVEL))


def error(got: Tensor, want: Tensor) -> float:
    return float((got - want).abs().max() / want.abs().max())


def no_render(given: Inputs) -> RenderCondition:
    latent = given.latent
    frames, rows, columns = latent.shape[2:]
    shape = (2, 1, 1 + 4 * (frames - 1), 8 * rows, 8 * columns)
    return RenderCondition(latent=torch.randn_like(latent), validity=torch.rand(shape).round())


def test_outputs_are_those_of_diffusers(model: Model, kind: str) -> None:
    given = inputs(kind)
    want = reference(cogvideox_folder.transformer(kind), kind, model, given)
    assert error(ours(model, given, condition=no_render(given)), want) < FP32


@pytest.mark.parametrize("kind", ["2b", "5b"], indirect=True)
@pytest.mark.parametrize("sides", [(4, 4), (8, 4), (2, 10)])
def test_so_are_those_at_other_sizes(model: Model, kind: str, sides: tuple[int, int]) -> None:
    given = inputs(kind, *sides)
    want = reference(cogvideox_folder.transformer(kind), kind, model, given)
    assert error(ours(model, given, condition=no_render(given)), want) < FP32


def test_fresh_adapters_change_no_bit(model: Model, kind: str) -> None:
    given = inputs(kind)
    frames = 1 + 4 * (given.latent.shape[2] - 1)
    camera = torch.randn(2, 6, frames, 8 * ROWS, 8 * COLUMNS)
    without = ours(model, given, condition=no_render(given))
    assert torch.equal(without, ours(model, given, condition=no_render(given), camera=camera))


def test_half_precision_is_as_exact_as_that_of_diffusers(model: Model, kind: str) -> None:
    given = inputs(kind)
    network = cogvideox_folder.transformer(kind)
    want = reference(network, kind, model, given)
    theirs = reference(network.to(torch.bfloat16), kind, model, given)
    model.networks.dit.to(torch.bfloat16)
    render = no_render(given)
    render = replace(render, latent=render.latent.bfloat16())
    channels = None if given.channels is None else given.channels.bfloat16()
    half = replace(given, text=given.text.bfloat16(), channels=channels)
    got = ours(model, half, condition=render)
    assert error(got, want) < 1.5 * error(theirs, want)
    assert error(theirs, want) < 0.05


@pytest.mark.parametrize("kind", ["1.5"], indirect=True)
def test_an_odd_number_of_frames_gets_the_first_one_twice(model: Model, kind: str) -> None:
    given = inputs(kind)
    latent = torch.cat([given.latent[:, :, 1:2], given.latent[:, :, 1:]], 2)
    even = ours(model, replace(given, latent=latent), condition=no_render(given))
    odd = replace(given, latent=given.latent[:, :, 1:])
    torch.testing.assert_close(ours(model, odd, condition=no_render(odd)), even[:, :, 1:])


@pytest.mark.parametrize("kind", ["2b", "5b", "5b_i2v"], indirect=True)
@torch.no_grad()
def test_a_given_first_frame_has_a_level_of_its_own(model: Model, kind: str) -> None:
    given = inputs(kind)
    level = torch.full((2, FRAMES), LEVEL)
    level[:, 0] = 0
    velocities = [
        model.networks.dit(
            given.latent, each, text=given.text, image=given.image, condition=no_render(given)
        )
        for each in (level, torch.full((2, FRAMES), LEVEL))
    ]
    assert bool(torch.isfinite(velocities[0]).all())
    assert not torch.allclose(*velocities)
