import pytest
import torch
from oracles_models import randomised

from diff4splat.errors import ShapeError
from diff4splat.models.config.model import VaeConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_vae.latent_distribution import LatentDistribution
from diff4splat.models.video_vae.vae import VideoVae


@pytest.fixture(scope="module")
def vae() -> VideoVae:
    torch.manual_seed(0)
    return randomised(VideoVae(tiny_size().vae)).requires_grad_(False)


@pytest.mark.parametrize("frames", [1, 5, 9])
@pytest.mark.parametrize("size", [(16, 16), (16, 48)])
def test_shapes(vae: VideoVae, frames: int, size: tuple[int, int]) -> None:
    latent = vae.encode(torch.rand(2, 3, frames, *size)).mean
    assert latent.shape == (2, 4, 1 + frames // 4, size[0] // 8, size[1] // 8)
    assert vae.decode(latent).shape == (2, 3, frames, *size)


def test_deeper_autoencoder_without_pixel_patch() -> None:
    vae = VideoVae(VaeConfig(latent_channels=3, widths=(2, 3, 4, 5), blocks=2))
    latent = vae.encode(torch.rand(1, 3, 5, 16, 8)).mean
    assert latent.shape == (1, 3, 2, 2, 1)
    assert vae.decode(latent).shape == (1, 3, 5, 16, 8)


@pytest.mark.parametrize("changed", range(9))
def test_latents_never_see_later_frames(vae: VideoVae, changed: int) -> None:
    video = torch.rand(1, 3, 9, 16, 16)
    other = video.clone()
    other[:, :, changed] += 0.5
    moved = (vae.encode(video).mean - vae.encode(other).mean).abs().amax((0, 1, 3, 4)) > 0
    own = -(-changed // 4)
    assert not moved[:own].any() and moved[own]


@pytest.mark.parametrize("changed", range(3))
def test_frames_never_see_later_latents(vae: VideoVae, changed: int) -> None:
    latent = torch.randn(1, 4, 3, 2, 2)
    other = latent.clone()
    other[:, :, changed] += 0.5
    moved = (vae.decode(latent) - vae.decode(other)).abs().amax((0, 1, 3, 4)) > 0
    first = max(4 * changed - 3, 0)
    assert not moved[:first].any() and moved[first : first + 4].all()


def test_first_latent_is_that_of_the_first_image(vae: VideoVae) -> None:
    video = torch.rand(1, 3, 5, 16, 16)
    torch.testing.assert_close(vae.encode(video).mean[:, :, :1], vae.encode(video[:, :, :1]).mean)


def test_still_video_has_still_latents(vae: VideoVae) -> None:
    latent = vae.encode(torch.rand(1, 3, 1, 16, 16).expand(-1, -1, 9, -1, -1)).mean
    torch.testing.assert_close(latent, latent[:, :, :1].expand_as(latent))


@pytest.mark.parametrize("chunks", [(1, 1, 1, 1), (1, 3), (3, 1), (2, 2)])
def test_chunks_equal_one_pass(vae: VideoVae, chunks: tuple[int, ...]) -> None:
    latent = torch.randn(1, 4, 4, 2, 4)
    caches, parts = vae.initial_caches(latent), []
    for chunk in latent.split(chunks, 2):
        frames, caches = vae.decode_chunk(chunk, caches)
        parts.append(frames)
    torch.testing.assert_close(torch.cat(parts, 2)[:, :, 3:], vae.decode(latent), atol=1e-5, rtol=0)


def test_chunk_function_is_pure(vae: VideoVae) -> None:
    latent = torch.randn(1, 4, 1, 2, 2)
    caches = tuple(torch.randn_like(cache) for cache in vae.initial_caches(latent))
    before = [cache.clone() for cache in caches]
    first, _ = vae.decode_chunk(latent, caches)
    again, after = vae.decode_chunk(latent, caches)
    torch.testing.assert_close(first, again, atol=0, rtol=0)
    assert all(torch.equal(a, b) for a, b in zip(before, caches, strict=True))
    assert [cache.shape for cache in after] == [cache.shape for cache in caches]


def test_caches_carry_information(vae: VideoVae) -> None:
    latent = torch.randn(1, 4, 2, 2, 2)
    cold, _ = vae.decode_chunk(latent[:, :, 1:], vae.initial_caches(latent))
    assert (cold - vae.decode(latent)[:, :, 1:]).abs().max() > 1e-3


def test_statistics_standardise_and_are_undone() -> None:
    vae = randomised(VideoVae(tiny_size().vae)).requires_grad_(False)
    video, latent = torch.rand(1, 3, 5, 16, 16), torch.randn(1, 4, 2, 2, 2)
    raw, plain = vae.encode(video), vae.decode(latent)
    mean, std = torch.tensor([1.0, -2.0, 0.0, 3.0]), torch.tensor([0.5, 2.0, 1.0, 4.0])
    vae.set_statistics(mean, std)
    shift, scale = mean[:, None, None, None], std[:, None, None, None]
    new = vae.encode(video)
    torch.testing.assert_close(new.mean, (raw.mean - shift) / scale)
    torch.testing.assert_close(new.log_variance.exp() * scale**2, raw.log_variance.exp())
    torch.testing.assert_close(vae.decode((latent - shift) / scale), plain, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("std", [[1.0, 0.0, 1.0, 1.0], [1.0, float("nan"), 1.0, 1.0]])
def test_unusable_statistics_are_refused(vae: VideoVae, std: list[float]) -> None:
    with pytest.raises(ShapeError, match="expected finite means and deviations above 0"):
        vae.set_statistics(torch.zeros(4), torch.tensor(std))


def test_sample_follows_the_formula() -> None:
    mean, log_variance, noise = torch.randn(3, 1, 2, 1, 2, 2).unbind(0)
    sample = LatentDistribution(mean=mean, log_variance=log_variance).sample(noise)
    torch.testing.assert_close(sample, mean + log_variance.exp().sqrt() * noise)


@pytest.mark.parametrize("fill", [0.0, 1.0, -1.0, 1e4])
def test_constant_and_saturated_videos_stay_finite(fill: float) -> None:
    vae = VideoVae(tiny_size().vae)
    video = torch.full((1, 3, 5, 16, 16), fill, requires_grad=True)
    encoded = vae.encode(video)
    out = vae.decode(encoded.sample(torch.randn_like(encoded.mean)))
    out.sum().backward()
    assert torch.isfinite(out).all() and torch.isfinite(video.grad).all()


def test_variance_is_clamped() -> None:
    vae = randomised(VideoVae(tiny_size().vae))
    with torch.no_grad():
        vae.encoder.conv_out.conv.bias.fill_(1e6)
    assert vae.encode(torch.rand(1, 3, 1, 16, 16)).log_variance.exp().isfinite().all()


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((1, 3, 4, 16, 16), r"expected 1 \+ 4 k, got 4; use 5"),
        ((1, 3, 5, 16, 20), "multiples of 8 px, got 16 by 20"),
    ],
)
def test_wrong_shapes_are_refused(vae: VideoVae, shape: tuple[int, ...], message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        vae.encode(torch.zeros(shape))
