"""Wan's autoencoders: latents and frames are those of diffusers, whole or in chunks."""

from pathlib import Path

import pytest
import torch
import wan_folder
from torch import nn

from diff4splat.errors import ShapeError
from diff4splat.models.hub.model import load_model
from diff4splat.models.wan.vae import WanVae, fold_pixels, unfold_pixels

VERSIONS = {"2.1": "t2v", "2.2": "ti2v"}
FP32 = 1e-5


@pytest.fixture(params=VERSIONS)
def pair(request: pytest.FixtureRequest, imported: dict[str, Path]) -> tuple[WanVae, nn.Module]:
    """Ours, read from an imported folder, and theirs."""
    folder = imported[VERSIONS[request.param]]
    return load_model(folder, parts=("vae",)).networks.vae, wan_folder.vae(request.param)


def statistics() -> tuple[torch.Tensor, torch.Tensor]:
    mean, std = (
        torch.tensor(each).view(1, -1, 1, 1, 1) for each in (wan_folder.MEAN, wan_folder.STD)
    )
    return mean, std


def close(got: torch.Tensor, want: torch.Tensor) -> None:
    assert got.shape == want.shape
    assert float((got - want).abs().max() / want.abs().max()) < FP32


@torch.no_grad()
@pytest.mark.parametrize("frames", [1, 5, 13])
def test_latents_are_those_of_diffusers(pair: tuple[WanVae, nn.Module], frames: int) -> None:
    vae, theirs = pair
    video, (mean, std) = torch.rand(2, 3, frames, 32, 64) * 2 - 1, statistics()
    want, got = theirs.encode(video).latent_dist, vae.encode(video)
    close(got.mean, (want.mean - mean) / std)
    close(got.log_variance, want.logvar - 2 * std.log())


@torch.no_grad()
@pytest.mark.parametrize("frames", [1, 2, 4])
def test_frames_are_those_of_diffusers(pair: tuple[WanVae, nn.Module], frames: int) -> None:
    vae, theirs = pair
    latent, (mean, std) = torch.randn(2, 4, frames, 2, 4), statistics()
    close(vae.decode(latent), theirs.decode(latent * std + mean).sample)


@torch.no_grad()
@pytest.mark.parametrize("cuts", [[4], [1, 3], [2, 1, 1]])
def test_chunks_give_the_frames_of_one_pass(
    pair: tuple[WanVae, nn.Module], cuts: list[int]
) -> None:
    vae, latent, caches, frames = pair[0], torch.randn(1, 4, 4, 2, 2), None, []
    for chunk in latent.split(cuts, 2):
        decoded, caches = vae.decode_chunk(chunk, caches)
        frames.append(decoded)
    close(torch.cat(frames, 2), vae.decode(latent))


@torch.no_grad()
def test_a_frame_does_not_depend_on_later_ones(pair: tuple[WanVae, nn.Module]) -> None:
    vae, video = pair[0], torch.rand(1, 3, 9, 32, 32) * 2 - 1
    other = video.clone()
    other[:, :, 5:] *= -1
    assert torch.equal(vae.encode(video).mean[:, :, :2], vae.encode(other).mean[:, :, :2])
    close(vae.encode(video[:, :, :1]).mean, vae.encode(video).mean[:, :, :1])


@torch.no_grad()
def test_half_precision_is_as_exact_as_that_of_diffusers(pair: tuple[WanVae, nn.Module]) -> None:
    vae, theirs = pair
    video = torch.rand(1, 3, 5, 32, 32) * 2 - 1
    want = theirs.encode(video).latent_dist.mean
    (mean, std), half = statistics(), video.bfloat16()
    theirs_error = (theirs.bfloat16().encode(half).latent_dist.mean.float() - want).abs().max()
    got = vae.bfloat16().encode(half).mean.float() * std + mean
    assert (got - want).abs().max() < 1.5 * theirs_error + 0.02 * want.abs().max()


def test_other_sizes_are_refused(pair: tuple[WanVae, nn.Module]) -> None:
    with pytest.raises(ShapeError, match="1 \\+ 4 k"):
        pair[0].encode(torch.zeros(1, 3, 4, 32, 32))
    with pytest.raises(ShapeError, match="multiples"):
        pair[0].encode(torch.zeros(1, 3, 5, 32, 36))


def test_folding_pixels_is_undone_by_unfolding() -> None:
    video = torch.rand(1, 3, 2, 4, 6)
    assert torch.equal(unfold_pixels(fold_pixels(video, 2), 2), video)
