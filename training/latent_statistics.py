"""Mean and deviation of the latents of a trained autoencoder, over fixed evaluation samples.

Everything after the autoencoder works with standardised latents (``models/video_vae/vae.py``). The
statistics are of the averaged weights, and lie beside their checkpoints.

Axes: ``c`` latent channels.
"""

from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.scene_files.tensor_checks import take_floats
from diff4splat.io.scene_files.tensor_file import TensorFile, read_tensors, write_tensors
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.progress.phases import Advance
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.latents.video_latents import network_video
from diff4splat.training.trainer.loading.loader import load_batch, require_batch
from diff4splat.training.trainer.loading.samples import EVALUATION_START

FILE = "latent_statistics.safetensors"
CLIPS = 16
LEAST_STD = 1e-3
"""A channel that never varies is left nearly as it is instead of being blown up."""

Statistics = tuple[Float[Tensor, " c"], Float[Tensor, " c"]]


@torch.no_grad()
def measure_statistics(vae: VideoVae, samples: ClipSamples, advance: Advance) -> Statistics:
    """Mean and standard deviation per channel of what the encoder answers without noise.

    Raises:
        InputError: neither evaluation samples nor those in their place can be used.
    """
    total = squares = torch.zeros(vae.config.latent_channels, dtype=torch.float64)
    count = 0
    for index in range(CLIPS):
        batch = require_batch(load_batch(samples, [EVALUATION_START + index]))
        latent = vae.encode(network_video(batch)).mean.double()
        total = total + latent.sum((0, 2, 3, 4)).cpu()
        squares = squares + latent.square().sum((0, 2, 3, 4)).cpu()
        count += latent[:, 0].numel()
        advance()
    mean = total / count
    deviation = (squares / count - mean.square()).clamp_min(LEAST_STD**2).sqrt()
    return mean.float(), deviation.float()


def write_statistics(statistics: Statistics, folder: Path) -> None:
    """Beside the checkpoints of the autoencoder's stage."""
    mean, deviation = statistics
    content = TensorFile(tensors={"mean": mean, "std": deviation}, metadata={"clips": str(CLIPS)})
    write_tensors(content, folder / FILE)


def has_statistics(folder: Path) -> bool:
    """Whether the autoencoder's stage came to a stop there."""
    return (folder / FILE).is_file()


def read_statistics(folder: Path) -> Statistics:
    """What ``write_statistics`` wrote.

    Raises:
        CheckpointError: the autoencoder's stage did not come to its end.
        FileFormatError: the file is damaged.
    """
    file = folder / FILE
    if not file.is_file():
        raise CheckpointError(
            f"{file}: expected the statistics of the latents, got none; "
            "run the autoencoder's stage to its end"
        )
    try:
        stored = read_tensors(file)
        mean = take_floats(stored, "mean", (None,))
        return mean, take_floats(stored, "std", tuple(mean.shape))
    except FileFormatError as error:
        raise FileFormatError(
            f"{file}: expected mean and deviation of the latents, got a damaged file; "
            "run the autoencoder's stage again, which writes it anew"
        ) from error
