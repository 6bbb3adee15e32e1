"""The video model holds Wan's weights: its outputs are those of diffusers."""

from dataclasses import dataclass, replace

import pytest
import torch
import wan_folder
from torch import Tensor, nn

from diff4splat.models.hub.model import Model
from diff4splat.models.video_dit.conditions import ImageCondition, RenderCondition

FRAMES, ROWS, COLUMNS, WORDS = 3, 4, 6, 7
FP32 = 1e-5


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """Of one call, for a batch of two."""

    kind: str
    latent: Tensor
    level: Tensor
    text: Tensor
    channels: Tensor
    states: Tensor

    @property
    def image(self) -> ImageCondition | None:
        if self.kind != "i2v":
            return None
        return ImageCondition(channels=self.channels, states=self.states)


def inputs(kind: str) -> Inputs:
    generator = torch.Generator().manual_seed(5)

    def draw(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator)

    level = torch.rand(2, FRAMES, generator=generator)
    return Inputs(
        kind=kind,
        latent=draw(2, 4, FRAMES, ROWS, COLUMNS),
        level=level if kind == "ti2v" else level[:, :1].expand(-1, FRAMES),
        text=draw(2, WORDS, wan_folder.TEXT_WIDTH),
        channels=draw(2, 8, FRAMES, ROWS, COLUMNS),
        states=draw(2, 5, wan_folder.CLIP_WIDTH),
    )


@torch.no_grad()
def reference(network: nn.Module, given: Inputs) -> Tensor:
    """As the pipelines call it: text padded with zeros to 512, levels times 1000."""
    text = torch.cat([given.text, torch.zeros(2, 512 - WORDS, given.text.shape[-1])], 1)
    latent, states = given.latent, {}
    if given.kind == "i2v":
        latent = torch.cat([latent, given.channels], 1)
        states = {"encoder_hidden_states_image": given.states}
    step = 1000 * given.level
    step = step.repeat_interleave(ROWS * COLUMNS // 4, 1) if given.kind == "ti2v" else step[:, 0]
    dtype = network.proj_out.weight.dtype
    states = {name: value.to(dtype) for name, value in states.items()}
    return network(latent.to(dtype), step, text.to(dtype), return_dict=False, **states)[0].float()


def expert(kind: str) -> nn.Module:
    """The network for the levels of ``inputs``, which lie below the boundary of two."""
    seed = wan_folder.LOW_SEED if kind == "a14b" else 1
    return wan_folder.transformer(kind, seed=seed)


@torch.no_grad()
def ours(model: Model, given: Inputs, **conditions: object) -> Tensor:
    dit = model.networks.dit
    return dit(given.latent, given.level, text=given.text, image=given.image, **conditions)


def error(got: Tensor, want: Tensor) -> float:
    return float((got - want).abs().max() / want.abs().max())


def no_render(model: Model) -> RenderCondition:
    side = model.config.vae.space_stride
    shape = (2, 1, 1 + 4 * (FRAMES - 1), ROWS * side, COLUMNS * side)
    return RenderCondition(
        latent=torch.randn(2, 4, FRAMES, ROWS, COLUMNS), validity=torch.rand(shape).round()
    )


def test_velocities_are_those_of_diffusers(model: Model, kind: str) -> None:
    given = inputs(kind)
    want = reference(expert(kind), given)
    assert error(ours(model, given, condition=no_render(model)), want) < FP32


def test_fresh_adapters_change_no_bit(model: Model, kind: str) -> None:
    given, side = inputs(kind), model.config.vae.space_stride
    one, other = no_render(model), no_render(model)
    camera = torch.randn(2, 6, 1 + 4 * (FRAMES - 1), ROWS * side, COLUMNS * side)
    assert torch.equal(
        ours(model, given, condition=one), ours(model, given, condition=other, camera=camera)
    )


@pytest.mark.parametrize("kind", ["a14b"], indirect=True)
def test_each_expert_has_its_levels(model: Model, kind: str) -> None:
    given, render = inputs(kind), no_render(model)
    high, low = wan_folder.BOUNDARY, wan_folder.BOUNDARY - 1e-3
    for levels in ((high, high), (low, low), (1.0, 0.1), (0.0, high)):
        level = torch.tensor(levels)[:, None].expand(-1, FRAMES)
        mixed = replace(given, level=level)
        wanted = [
            reference(wan_folder.transformer(kind, seed=seed), mixed)
            for seed in (1, wan_folder.LOW_SEED)
        ]
        want = torch.where((level[:, :1, None, None, None] >= high), *wanted)
        assert error(ours(model, mixed, condition=render), want) < FP32


@pytest.mark.parametrize("kind", ["t2v"], indirect=True)
def test_stored_half_precision_is_computed_in_float32(model: Model, kind: str) -> None:
    given, network = inputs(kind), wan_folder.transformer(kind)
    with torch.no_grad():
        for value in network.parameters():
            value.copy_(value.bfloat16())
    for block in model.networks.dit.blocks:
        weights = {n: v.bfloat16() for n, v in block.block.state_dict().items()}
        block.block.load_state_dict(weights, assign=True)
    state = {
        name: value.bfloat16().float()
        for name, value in model.networks.dit.state_dict().items()
        if not name.startswith("blocks.")
    }
    model.networks.dit.load_state_dict(state, strict=False)
    want = reference(network, given)
    assert error(ours(model, given, condition=no_render(model)), want) < FP32


def test_half_precision_is_as_exact_as_that_of_diffusers(model: Model, kind: str) -> None:
    given = inputs(kind)
    want = reference(expert(kind), given)
    theirs = reference(expert(kind).to(torch.bfloat16), given)
    model.networks.dit.to(torch.bfloat16)
    half = Inputs(
        kind=kind,
        latent=given.latent.bfloat16(),
        level=given.level,
        text=given.text.bfloat16(),
        channels=given.channels.bfloat16(),
        states=given.states.bfloat16(),
    )
    render = no_render(model)
    render = RenderCondition(latent=render.latent.bfloat16(), validity=render.validity)
    got = ours(model, half, condition=render).float()
    assert error(got, want) < 1.5 * error(theirs, want)
    assert error(theirs, want) < 0.05
