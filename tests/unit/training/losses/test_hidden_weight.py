"""How much latent cells count that the first frame hides."""

from dataclasses import replace

import numpy as np
import oracles_losses as oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from stage_fixtures import make_batch, make_stage, shake_heads, stage_recipe

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.geometry.camera import pinhole, stack_cameras
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.losses.flow_matching import flow_matching
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import ModelStage
from diff4splat.training.stages.video_flow import EVAL_LEVELS, hidden_share

F64 = torch.float64


def latents(*shape: int) -> list[torch.Tensor]:
    return [torch.randn(*shape, dtype=F64) for _ in range(3)]


@pytest.mark.parametrize("first_frame_is_clean", [False, True])
def test_cells_are_weighted_as_a_loop_would(first_frame_is_clean: bool) -> None:
    tensors, cells = latents(2, 3, 3, 2, 2), torch.rand(2, 3, 2, 2, dtype=F64)
    channels, weights = torch.rand(3, dtype=F64), torch.tensor([0.5, 2.0], dtype=F64)
    cells[0, 1] = 0
    loss = flow_matching(
        *tensors,
        first_frame_is_clean=first_frame_is_clean,
        weights=weights,
        channels=channels,
        cells=cells,
    )
    numbers = (one.numpy() for one in (*tensors, cells, channels))
    expected = oracle.weighted_flow_matching(*numbers, int(first_frame_is_clean))
    np.testing.assert_allclose(loss, weights * torch.tensor(expected, dtype=F64), rtol=1e-12)


@settings(max_examples=25, deadline=None)
@given(weight=st.floats(1e-3, 1e3))
def test_equal_weights_of_all_cells_change_nothing(weight: float) -> None:
    tensors = latents(2, 2, 3, 2, 2)
    loss = flow_matching(*tensors, cells=torch.full((2, 3, 2, 2), weight, dtype=F64))
    torch.testing.assert_close(loss, flow_matching(*tensors))


def test_cells_without_weight_give_no_loss_and_no_gradient() -> None:
    velocity, clean, noise = latents(2, 2, 2, 2, 2)
    velocity.requires_grad_()
    cells = torch.zeros(2, 2, 2, 2, dtype=F64)
    cells[1, 1, 0, 1] = 3.0
    loss = flow_matching(velocity, clean, noise, cells=cells)
    loss.sum().backward()
    assert float(loss[0].detach()) == 0 and float(loss[1].detach()) > 0
    reached = velocity.grad.abs().sum(1) > 0
    assert torch.equal(reached, cells > 0)


def test_gradient_with_weighted_cells() -> None:
    velocity, clean, noise = latents(1, 2, 2, 1, 2)
    cells = torch.rand(1, 2, 1, 2, dtype=F64)
    velocity.requires_grad_()
    assert torch.autograd.gradcheck(
        lambda v: flow_matching(v, clean, noise, first_frame_is_clean=True, cells=cells), velocity
    )


def rendered_batch(frames: int = 9, grid: tuple[int, int] = (4, 4), count: int = 2) -> LatentBatch:
    """Random latents and render conditions whose validity differs from pixel to pixel."""
    height, width = (8 * side for side in grid)
    times = 1 + (frames - 1) // 4
    generator = torch.Generator().manual_seed(3)
    normal = [torch.randn(count, 4, times, *grid, generator=generator) for _ in range(2)]
    validity = torch.rand(count, 1, frames, height, width, generator=generator) < 0.7
    validity[:, :, 0] = True
    cameras = pinhole(20.0, (height, width)).with_pose(torch.eye(4).repeat(frames, 1, 1))
    return LatentBatch(
        sample_index=torch.arange(count),
        source=("made",) * count,
        latent=normal[0],
        render_latent=normal[1],
        validity=validity.float(),
        cameras=stack_cameras([cameras] * count),
        captions=("a ball rolls",) * count,
    )


@pytest.mark.parametrize("grid", [(4, 4), (2, 6)])
@pytest.mark.parametrize("frames", [1, 5, 13])
def test_the_hidden_share_is_counted_pixel_by_pixel(frames: int, grid: tuple[int, int]) -> None:
    batch = rendered_batch(frames, grid)
    # The first frame too: the count must not rely on its being valid.
    batch = replace(batch, validity=1 - batch.validity)
    shares = hidden_share(batch)
    assert shares.shape == (2, 1 + (frames - 1) // 4, *grid)
    for share, validity in zip(shares, batch.validity[:, 0], strict=True):
        expected = oracle.hidden_share(validity.numpy(), tuple(share.shape))
        np.testing.assert_allclose(share, expected, atol=1e-6)


def test_without_a_render_condition_nothing_is_hidden() -> None:
    assert hidden_share(replace(rendered_batch(), render_latent=None, validity=None)) is None


def stage_of(hidden_weight: float, rendered: bool = True) -> ModelStage:
    """Video diffusion whose network tells its conditions apart."""
    model = recipe_by_name("test").model
    model = replace(model, dit=replace(model.dit, render_condition=rendered))
    stage = make_stage(stage_recipe("video_diffusion", hidden_weight=hidden_weight), model=model)
    shake_heads(stage)
    return stage


def loss_of(stage: ModelStage, batch: LatentBatch, cells: torch.Tensor, level: float | None = None):
    """The loss of every sample by loops, with the stage's velocity."""
    video = stage.flow.noisy(batch) if level is None else stage.flow.at_level(batch, level)
    with torch.no_grad():
        velocity = stage.flow.velocity(batch, video, stage.training)
    numbers = [one.double().numpy() for one in (velocity, video.clean, video.noise, cells)]
    return torch.tensor(oracle.weighted_flow_matching(*numbers, np.ones(4), 1)).float()


@pytest.mark.parametrize("weight", [0.0, 1.0, 8.0])
def test_hidden_cells_count_as_much_as_the_recipe_says(weight: float) -> None:
    stage, batch = stage_of(weight), rendered_batch()
    terms = stage(batch)
    expected = loss_of(stage, batch, 1 + (weight - 1) * hidden_share(batch))
    torch.testing.assert_close(terms["flow"], expected)
    torch.testing.assert_close(terms[TOTAL], expected)


def test_measures_weigh_by_the_hidden_share_alone() -> None:
    batch, hidden = rendered_batch(), hidden_share(rendered_batch())
    found = [stage_of(weight).measure(batch) for weight in (1.0, 8.0)]
    assert set(found[0]) == {"flow_error", "hidden_error"}
    torch.testing.assert_close(found[0], found[1], rtol=0, atol=0)
    for name, cells in (("flow_error", torch.ones_like(hidden)), ("hidden_error", hidden)):
        levels = [loss_of(stage_of(1.0).eval(), batch, cells, level) for level in EVAL_LEVELS]
        torch.testing.assert_close(found[0][name], torch.stack(levels).mean(0))


def test_a_clip_that_hides_nothing_has_no_hidden_error() -> None:
    batch = rendered_batch()
    shown = replace(batch, validity=torch.ones_like(batch.validity))
    measured = stage_of(8.0).measure(shown)
    assert bool(measured["hidden_error"].isnan().all())
    assert bool((measured["flow_error"] > 0).all())
    torch.testing.assert_close(stage_of(8.0)(shown)["flow"], stage_of(1.0)(shown)["flow"])


def test_models_without_render_conditions_weigh_all_cells_alike() -> None:
    batch = replace(rendered_batch(), render_latent=None, validity=None)
    plain, weighted = (stage_of(weight, rendered=False) for weight in (1.0, 8.0))
    torch.testing.assert_close(plain(batch)["flow"], weighted(batch)["flow"], rtol=0, atol=0)
    assert set(plain.measure(batch)) == {"flow_error"}


def test_clips_get_the_weights_of_their_render_conditions() -> None:
    stage = stage_of(8.0)
    clips = make_batch(stage.plan.recipe, (0, 1))
    encoded = stage.encoded(clips)
    share = hidden_share(encoded)
    assert not share[:, 0].any() and bool(share[:, 1].flatten(1).any(1).all())
    expected = loss_of(stage, encoded, 1 + 7 * share)
    torch.testing.assert_close(stage(clips)["flow"], expected)
    assert set(stage.measure(clips)) == {"flow_error", "hidden_error"}
