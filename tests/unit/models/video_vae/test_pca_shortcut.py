"""Principal components as a shortcut of the autoencoder, against numpy."""

from dataclasses import replace

import numpy as np
import torch

from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.training.pca_init import BlockStatistics, set_principal_components

CONFIG = replace(tiny_size().vae, pca_shortcut=True)


def test_components_are_those_of_numpy_and_start_the_autoencoder() -> None:
    vae, video = VideoVae(CONFIG), torch.rand(2, 3, 5, 32, 48)
    statistics = BlockStatistics(vae.pca_shortcut)
    statistics.add(video)
    set_principal_components(vae.pca_shortcut, statistics)
    rows = vae.pca_shortcut.blocks(video).flatten(0, -2).double().numpy()
    mean = rows.mean(0)
    directions = np.linalg.svd(rows - mean, full_matrices=False)[2][:4]
    want = (rows - mean) @ directions.T @ directions + mean
    latent = vae.encode(video).mean
    got = vae.pca_shortcut.to_block(latent.movedim(1, -1)).detach().flatten(0, -2).double().numpy()
    np.testing.assert_allclose(got, want, atol=1e-4)
    np.testing.assert_allclose(
        latent.detach().movedim(1, -1).flatten(0, -2).var(0, correction=0), 1, rtol=1e-2
    )
    assert vae.decode(latent).shape == video.shape
