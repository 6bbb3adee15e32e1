"""Deferred back-propagation and activation checkpointing: the same gradients in less memory."""

import tracemalloc
from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_batch, make_stage, shake_heads, stage_recipe

from diff4splat.geometry.camera import Camera
from diff4splat.models.blocks.transformer_block import TransformerBlock
from diff4splat.scene.gaussians import Gaussians
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import ModelStage
from diff4splat.training.stages.moment_images import Moment, images_of
from diff4splat.training.trainer.distributed.blocks import outer_blocks
from diff4splat.training.trainer.distributed.recomputing import recompute_blocks


def gradients(stage: ModelStage, name: str) -> dict[str, torch.Tensor]:
    loss = stage(make_batch(stage_recipe(name)))[TOTAL].sum()
    loss.backward()
    found = {key: value.grad for key, value in stage.named_parameters() if value.grad is not None}
    return found | {"loss": loss.detach()}


@pytest.mark.parametrize("name", ["static-low", "dynamic"])
def test_deferred_renders_have_the_plain_gradient(name: str) -> None:
    stages = [make_stage(stage_recipe(name)) for _ in range(2)]
    stages[1].plan = replace(stages[1].plan, defer_renders=True)
    stages[1].scenes = replace(stages[1].scenes, plan=stages[1].plan)
    for stage in stages:
        shake_heads(stage)
    plain, deferred = (gradients(stage, name) for stage in stages)
    assert torch.equal(plain["loss"], deferred["loss"])
    for key, value in plain.items():
        size = value.abs().max().clamp_min(1e-12)
        torch.testing.assert_close(deferred[key] / size, value / size, rtol=0, atol=2e-5)


def many(count: int) -> Gaussians:
    generator = torch.Generator().manual_seed(0)
    means = torch.randn(count, 3, generator=generator) + torch.tensor([0.0, 0.0, 4.0])
    quats = torch.nn.functional.normalize(torch.randn(count, 4, generator=generator), dim=-1)
    colors = torch.rand(count, 1, 3, generator=generator)
    values = {"means": means, "quats": quats, "sh": colors}
    values |= {"scales": torch.full((count, 3), 0.02), "opacities": torch.full((count,), 0.3)}
    return Gaussians(**{key: value.requires_grad_(True) for key, value in values.items()})


def cameras(count: int) -> Camera:
    pose = torch.eye(4).repeat(count, 1, 1)
    pose[:, 0, 3] = torch.linspace(-0.1, 0.1, count)
    centre = torch.full((count, 2), 16.0)
    return Camera(focal_px=2 * centre, center_px=centre, world_from_camera=pose, size_px=(32, 32))


def both_passes(views: int, defer: bool) -> None:
    rgb, depth = images_of(Moment(gaussians=many(20_000)), cameras(views), defer)
    (rgb.sum() + depth.sum()).backward()


def peak_bytes(views: int, *, defer: bool = False) -> int:
    """Most memory of the renderer's arrays at any time of both passes."""
    both_passes(1, defer)  # loads code
    tracemalloc.start()
    try:
        both_passes(views, defer)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_deferred_renders_keep_one_image() -> None:
    one, plain, deferred = peak_bytes(1), peak_bytes(16), peak_bytes(16, defer=True)
    assert plain > 3 * one
    # What remains of each image is the image itself.
    assert deferred - one < 0.3 * (plain - one)


def test_recomputed_blocks_give_the_same_bits() -> None:
    stages = [make_stage(stage_recipe("dynamic")) for _ in range(2)]
    for stage in stages:
        shake_heads(stage)
    recompute_blocks(stages[1])
    before, after = (gradients(stage, "dynamic") for stage in stages)
    torch.testing.assert_close(after, before, rtol=0, atol=0)
    assert stages[0].state_dict().keys() == stages[1].state_dict().keys()


def test_recomputed_blocks_run_twice_and_history_runs_once() -> None:
    calls: dict[str, int] = {}
    for name in ("static-low", "vae"):
        stage = make_stage(stage_recipe(name))
        recompute_blocks(stage)
        block = next(iter(outer_blocks(stage)))
        kind = type(block).__name__
        first = block.norm if hasattr(block, "norm") else next(iter(block.children()))

        def count(*_: object, kind: str = kind) -> None:
            calls[kind] = calls.get(kind, 0) + 1

        first.register_forward_hook(count)
        stage(make_batch(stage_recipe(name)))[TOTAL].sum().backward()
    assert calls.pop(TransformerBlock.__name__) == 2
    assert set(calls.values()) == {1}
