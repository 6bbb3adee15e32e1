"""How much latent channels and noise levels count."""

from dataclasses import replace

import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from stage_fixtures import make_batch, make_stage, stage_recipe

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.flow.path import add_noise, velocity, velocity_from_clean
from diff4splat.training.losses.flow_matching import flow_matching
from diff4splat.training.losses.timestep_sampling import min_level_weights
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import ModelStage

F64 = torch.float64


def latents(*shape: int) -> list[torch.Tensor]:
    return [torch.randn(*shape, dtype=F64) for _ in range(3)]


def test_channels_count_as_much_as_they_are_said_to() -> None:
    predicted, clean, noise = latents(2, 3, 2, 2, 2)
    shares = torch.tensor([0.5, 2.0, 0.5], dtype=F64)
    loss = flow_matching(predicted, clean, noise, channels=shares)
    alone = [
        flow_matching(predicted[:, c : c + 1], clean[:, c : c + 1], noise[:, c : c + 1])
        for c in range(3)
    ]
    wanted = sum(share * one for share, one in zip(shares, alone, strict=True)) / 3
    torch.testing.assert_close(loss, wanted)


def test_channels_that_are_all_alike_change_nothing() -> None:
    tensors = latents(2, 3, 3, 2, 2)
    loss = flow_matching(*tensors, first_frame_is_clean=True, channels=torch.ones(3))
    torch.testing.assert_close(loss, flow_matching(*tensors, first_frame_is_clean=True))


def test_a_channel_that_does_not_count_is_not_learnt() -> None:
    predicted, clean, noise = latents(2, 2, 2, 2, 2)
    predicted.requires_grad_()
    shares = torch.tensor([0.0, 2.0])
    flow_matching(predicted, clean, noise, channels=shares).sum().backward()
    assert not predicted.grad[:, 0].any() and bool(predicted.grad[:, 1].all())


def test_channels_and_samples_are_weighted_together() -> None:
    tensors, shares = latents(2, 2, 2, 2, 2), torch.tensor([0.5, 1.5], dtype=F64)
    weights = torch.tensor([0.0, 3.0], dtype=F64)
    both = flow_matching(*tensors, weights=weights, channels=shares)
    torch.testing.assert_close(both, weights * flow_matching(*tensors, channels=shares))


def test_levels_are_all_alike_where_none_is_named() -> None:
    assert min_level_weights(torch.tensor([0.0, 0.3]), 0.0) is None


def test_smaller_levels_count_less() -> None:
    level = torch.tensor([0.0, 0.1, 0.2, 0.4, 0.7, 1.0])
    wanted = torch.tensor([0.0, 1 / 16, 0.25, 1.0, 1.0, 1.0])
    torch.testing.assert_close(min_level_weights(level, 0.4), wanted)


@settings(max_examples=25, deadline=None)
@given(level=st.floats(1e-3, 1), least=st.floats(0.05, 1))
def test_the_same_error_of_the_clean_latent_costs_the_same_at_all_levels_below(
    level: float, least: float
) -> None:
    clean, noise, error = latents(2, 2, 2, 2, 2)

    def cost(at: float) -> torch.Tensor:
        noisy, levels = add_noise(clean, noise, at), torch.full((2,), at, dtype=F64)
        wrong = velocity_from_clean(noisy, clean + error, levels[:, None, None, None, None])
        torch.testing.assert_close(wrong, velocity(clean, noise) - error / at)
        return flow_matching(wrong, clean, noise, weights=min_level_weights(levels, least))

    torch.testing.assert_close(cost(min(level, least)), cost(least))


def test_video_diffusion_weighs_its_levels() -> None:
    recipe = stage_recipe("video_diffusion")
    batch = make_batch(recipe, (0, 1, 2))
    plain = make_stage(recipe)
    levels = plain.flow.noisy(plain.encoded(batch)).level
    weighted = make_stage(stage_recipe("video_diffusion", min_level_weighting=0.9))(batch)
    wanted = plain(batch)["flow"] * (levels / 0.9).clamp_max(1).square()
    assert bool((levels < 0.9).any())
    torch.testing.assert_close(weighted["flow"], wanted)
    torch.testing.assert_close(weighted[TOTAL], wanted)


def test_measures_weigh_no_levels() -> None:
    recipe = stage_recipe("video_diffusion")
    batch = make_batch(recipe)
    plain, weighted = (
        make_stage(stage_recipe("video_diffusion", min_level_weighting=least)).measure(batch)
        for least in (0.0, 0.9)
    )
    torch.testing.assert_close(plain["flow_error"], weighted["flow_error"], rtol=0, atol=0)


def coded(power: float) -> ModelStage:
    """Video diffusion over an autoencoder with a linear code."""
    model = recipe_by_name("test").model
    model = replace(model, vae=replace(model.vae, pca_shortcut=True))
    return make_stage(stage_recipe("video_diffusion", channel_power_exponent=power), model=model)


def test_channels_count_by_their_share_in_images() -> None:
    stage = coded(0.5)
    share = stage.vae.pca_shortcut.to_block.weight.detach().norm(dim=0)
    torch.testing.assert_close(stage.flow._channels, share / share.mean())
    stage.vae.set_statistics(torch.zeros(4), torch.tensor([1.0, 2.0, 3.0, 4.0]))
    share = share * torch.tensor([1.0, 2.0, 3.0, 4.0])
    again = coded(0.5)
    again.vae.load_state_dict(stage.vae.state_dict())
    torch.testing.assert_close(again.flow._channels, share / share.mean())


def test_a_power_of_zero_or_no_code_counts_all_channels_alike() -> None:
    alike = torch.ones(4)
    torch.testing.assert_close(coded(0.0).flow._channels, alike)
    without_code = make_stage(stage_recipe("video_diffusion", channel_power_exponent=0.5))
    torch.testing.assert_close(without_code.flow._channels, alike)


def test_video_diffusion_weighs_its_channels() -> None:
    batch = make_batch(stage_recipe("video_diffusion"))
    stage = coded(1.0)
    batch = stage.encoded(batch)
    video = stage.flow.noisy(batch)
    wanted = flow_matching(
        stage.flow.velocity(batch, video, stage.training),
        video.clean,
        video.noise,
        first_frame_is_clean=True,
        channels=stage.flow._channels,
    )
    torch.testing.assert_close(stage(batch)["flow"], wanted)
    assert not torch.equal(coded(0.0)(batch)["flow"], wanted)
