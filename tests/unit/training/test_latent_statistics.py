"""Mean and deviation of latents, against a direct computation."""

import math
from pathlib import Path

import pytest
import torch
from clip_shards import reading, write_shards

from diff4splat.errors import CheckpointError, FileFormatError, InputError
from diff4splat.io.scene_files.tensor_file import TensorFile, write_tensors
from diff4splat.models.factory import create_networks
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.latent_statistics import (
    CLIPS,
    FILE,
    LEAST_STD,
    measure_statistics,
    read_statistics,
    write_statistics,
)
from diff4splat.training.trainer.loading.samples import EVALUATION_START


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"), still=4, moving=4)


def samples_of(folder: Path) -> ClipSamples:
    return ClipSamples.open(reading(folder).stage("vae"), 0)


def autoencoder(folder: Path) -> VideoVae:
    return create_networks(reading(folder).model).vae


def latents(vae: VideoVae, samples: ClipSamples) -> torch.Tensor:
    """Channels first, everything else flat, in float64, straight from the pixels."""
    found = []
    for index in range(CLIPS):
        pixels = samples[EVALUATION_START + index].video.double() / 255 * 2 - 1
        with torch.no_grad():
            mean = vae.encode(pixels.permute(0, 4, 1, 2, 3).float()).mean
        found.append(mean.double().transpose(0, 1).flatten(1))
    return torch.cat(found, 1)


def test_statistics_are_those_of_all_evaluation_latents(shards: Path) -> None:
    vae, samples = autoencoder(shards), samples_of(shards)
    steps: list[int] = []
    mean, std = measure_statistics(vae, samples, lambda: steps.append(1))
    whole = latents(vae, samples)
    torch.testing.assert_close(mean.double(), whole.mean(1), atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(std.double(), whole.std(1, correction=0), atol=1e-5, rtol=1e-4)
    assert len(steps) == CLIPS


def test_latents_are_standardised_with_them(shards: Path) -> None:
    vae, samples = autoencoder(shards), samples_of(shards)
    vae.set_statistics(*measure_statistics(vae, samples, lambda: None))
    whole = latents(vae, samples)
    assert whole.mean(1).abs().max() < 1e-3
    assert (whole.std(1, correction=0) - 1).abs().max() < 1e-3


def test_a_channel_that_never_varies_is_not_blown_up(shards: Path) -> None:
    vae = autoencoder(shards)
    for parameter in vae.parameters():
        torch.nn.init.zeros_(parameter)
    _, std = measure_statistics(vae, samples_of(shards), lambda: None)
    torch.testing.assert_close(std, torch.full_like(std, LEAST_STD))


def test_a_clip_that_cannot_be_used_is_replaced(tmp_path: Path) -> None:
    # Two still clips: the second one is kept back for evaluation and has no depth.
    folder = write_shards(tmp_path, still=2, moving=2, blind=(1,))
    vae, samples = autoencoder(folder), samples_of(folder)
    with pytest.raises(InputError, match="expected depth"):
        _ = [samples[EVALUATION_START + index] for index in range(CLIPS)]
    mean, std = measure_statistics(vae, samples, lambda: None)
    assert bool(torch.isfinite(mean).all() and (std > 0).all())


def test_what_is_written_is_read(tmp_path: Path) -> None:
    statistics = (torch.tensor([0.5, -2.0]), torch.tensor([1.0, math.pi]))
    write_statistics(statistics, tmp_path)
    for found, given in zip(read_statistics(tmp_path), statistics, strict=True):
        assert torch.equal(found, given)


def test_missing_and_foreign_files_say_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"got none; run the autoencoder's stage to its end"):
        read_statistics(tmp_path)
    (tmp_path / FILE).write_bytes(b"hello")
    with pytest.raises(FileFormatError, match=rf"{FILE}: expected mean and deviation") as caught:
        read_statistics(tmp_path)
    assert "run the autoencoder's stage again" in str(caught.value)
    other = TensorFile(tensors={"mean": torch.zeros(2)}, metadata={})
    write_tensors(other, tmp_path / FILE)
    with pytest.raises(FileFormatError, match="expected mean and deviation"):
        read_statistics(tmp_path)
