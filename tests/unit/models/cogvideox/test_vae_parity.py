"""CogVideoX's autoencoder: latents and frames are those of diffusers, whole, in chunks or tiles."""

from dataclasses import replace
from pathlib import Path

import cogvideox_folder
import pytest
import torch
from cogvideox_folder import CHANNELS, SCALE
from torch import nn

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.models.cogvideox.vae import CHUNK_LATENTS, CogVideoXVae, chunk_sizes
from diff4splat.models.hub.model import load_model

FP32 = 1e-5


@pytest.fixture
def pair(imported_cogvideox: dict[str, Path]) -> tuple[CogVideoXVae, nn.Module]:
    """Ours, read from an imported folder, and theirs."""
    vae = load_model(imported_cogvideox["2b"], parts=("vae",)).networks.vae
    return vae, cogvideox_folder.vae()


@pytest.fixture
def in_tiles(pair: tuple[CogVideoXVae, nn.Module]) -> tuple[CogVideoXVae, nn.Module]:
    """The same with tiles of 48×56 pixels."""
    vae, theirs = pair
    vae.config = replace(vae.config, tile_px=(48, 56))
    theirs.enable_tiling(tile_sample_min_height=48, tile_sample_min_width=56)
    return vae, theirs


def close(got: torch.Tensor, want: torch.Tensor) -> None:
    assert got.shape == want.shape
    assert float((got - want).abs().max() / want.abs().max()) < FP32


@torch.no_grad()
@pytest.mark.parametrize("frames", [1, 5, 9, 13, 17, 21])
def test_latents_are_those_of_diffusers(pair: tuple[CogVideoXVae, nn.Module], frames: int) -> None:
    vae, theirs = pair
    video = torch.rand(2, 3, frames, 16, 24) * 2 - 1
    want, got = theirs.encode(video).latent_dist, vae.encode(video)
    close(got.mean, want.mean * SCALE)
    close(got.log_variance, want.logvar + 2 * torch.tensor(SCALE).log())


@torch.no_grad()
@pytest.mark.parametrize("frames", [1, 3, 5, 7])
def test_frames_are_those_of_diffusers(pair: tuple[CogVideoXVae, nn.Module], frames: int) -> None:
    vae, theirs = pair
    latent = torch.randn(2, CHANNELS, frames, 2, 3)
    close(vae.decode(latent), theirs.decode(latent / SCALE).sample)


@torch.no_grad()
@pytest.mark.parametrize("frames", [2, 4])
def test_an_even_number_of_latent_frames_begins_with_one_frame(
    pair: tuple[CogVideoXVae, nn.Module], frames: int
) -> None:
    vae, latent = pair[0], torch.randn(1, CHANNELS, frames, 2, 2)
    assert vae.decode(latent).shape[2] == 1 + 4 * (frames - 1)
    video = torch.rand(1, 3, 1 + 4 * (frames - 1), 16, 16)
    assert vae.encode(video).mean.shape[2] == frames


@torch.no_grad()
def test_tiles_are_those_of_diffusers(in_tiles: tuple[CogVideoXVae, nn.Module]) -> None:
    vae, theirs = in_tiles
    video = torch.rand(1, 3, 9, 96, 120) * 2 - 1
    close(vae.encode(video).mean, theirs.encode(video).latent_dist.mean * SCALE)
    latent = torch.randn(1, CHANNELS, 3, 12, 15)
    close(vae.decode(latent), theirs.decode(latent / SCALE).sample)


@torch.no_grad()
def test_small_frames_need_no_tiles(in_tiles: tuple[CogVideoXVae, nn.Module]) -> None:
    vae = in_tiles[0]
    latent = torch.randn(1, CHANNELS, 3, 6, 7)
    whole = CogVideoXVae(replace(vae.config, tile_px=()))
    whole.load_state_dict(vae.state_dict())
    assert torch.equal(vae.decode(latent), whole.decode(latent))


@torch.no_grad()
def test_chunks_give_the_frames_of_one_pass(pair: tuple[CogVideoXVae, nn.Module]) -> None:
    vae, latent, caches, frames = pair[0], torch.randn(1, CHANNELS, 7, 2, 2), None, []
    for chunk in latent.split(list(chunk_sizes(7, CHUNK_LATENTS)), 2):
        decoded, caches = vae.decode_chunk(chunk, caches)
        frames.append(decoded)
    close(torch.cat(frames, 2), vae.decode(latent))


@torch.no_grad()
def test_a_chunk_does_not_depend_on_later_ones(pair: tuple[CogVideoXVae, nn.Module]) -> None:
    vae, video = pair[0], torch.rand(1, 3, 17, 16, 16) * 2 - 1
    other = video.clone()
    other[:, :, 9:] *= -1
    assert torch.equal(vae.encode(video).mean[:, :, :3], vae.encode(other).mean[:, :, :3])


@torch.no_grad()
def test_half_precision_is_as_exact_as_that_of_diffusers(
    pair: tuple[CogVideoXVae, nn.Module],
) -> None:
    vae, theirs = pair
    video = torch.rand(1, 3, 9, 16, 16) * 2 - 1
    want, half = theirs.encode(video).latent_dist.mean, video.bfloat16()
    theirs_error = (theirs.bfloat16().encode(half).latent_dist.mean.float() - want).abs().max()
    got = vae.bfloat16().encode(half).mean.float() / SCALE
    assert (got - want).abs().max() < 1.5 * theirs_error + 0.02 * want.abs().max()


def test_other_sizes_are_refused(pair: tuple[CogVideoXVae, nn.Module]) -> None:
    with pytest.raises(ShapeError, match="1 \\+ 4 k"):
        pair[0].encode(torch.zeros(1, 3, 4, 16, 16))
    with pytest.raises(ShapeError, match="multiples"):
        pair[0].encode(torch.zeros(1, 3, 5, 16, 20))


def test_tiles_without_an_overlap_are_refused(pair: tuple[CogVideoXVae, nn.Module]) -> None:
    with pytest.raises(ConfigError, match="tile_px"):
        replace(pair[0].config, tile_px=(32, 64))
