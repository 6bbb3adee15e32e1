"""The linear code of an autoencoder from principal components of training clips.

Axes: ``n`` values of a block of 4 frames, ``c`` latent channels. Components are eigenvectors of the
blocks' covariance; latents along them get variance 1 on the same clips. Equal samples give equal
weights, so a run that is taken up again computes what it then overwrites with its checkpoint.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.video_vae.pca_shortcut import PcaShortcut
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.progress.phases import Phases
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.latents.video_latents import network_video
from diff4splat.training.trainer.loading.loader import load_batch, require_batch

CLIPS = 64
LEAST_STD = 1e-3
"""Directions in which blocks hardly vary are not blown up."""


@torch.no_grad()
def init_from_principal_components(vae: VideoVae, samples: ClipSamples, phases: Phases) -> None:
    """Set the code of ``vae`` from the first training samples.

    Raises:
        InputError: neither samples nor those in their place can be used.
    """
    with phases.phase("linear code", CLIPS) as advance:
        moments = BlockStatistics(vae.pca_shortcut)
        for index in range(CLIPS):
            moments.add(network_video(require_batch(load_batch(samples, [index]))))
            advance()
    set_principal_components(vae.pca_shortcut, moments)


class BlockStatistics:
    """Sums over blocks, in double precision."""

    def __init__(self, code: PcaShortcut) -> None:
        self.code = code
        values = code.to_latent.in_features
        self.count = 0
        self.total = torch.zeros(values, dtype=torch.float64)
        self.squares = torch.zeros(values, values, dtype=torch.float64)

    def add(self, video: Float[Tensor, "b 3 f h w"]) -> None:
        """Every block of a video."""
        rows = self.code.blocks(video).flatten(0, -2).double().cpu()
        self.count += len(rows)
        self.total += rows.sum(0)
        self.squares += rows.mT @ rows


def set_principal_components(code: PcaShortcut, moments: BlockStatistics) -> None:
    """The directions of largest variance become the code."""
    mean = moments.total / moments.count
    covariance = moments.squares / moments.count - torch.outer(mean, mean)
    variance, directions = torch.linalg.eigh(covariance)
    latents = code.to_latent.out_features
    std = variance.flip(0)[:latents].clamp_min(LEAST_STD**2).sqrt()
    components = directions.flip(1)[:, :latents].mT
    code.set_components(mean.float(), components.float(), std.float())
