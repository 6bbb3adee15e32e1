"""The linear code that training starts from, against a singular value decomposition."""

import numpy as np
import torch

from diff4splat.models.config.model import VaeConfig
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.training.pca_init import BlockStatistics, set_principal_components

CONFIG = VaeConfig(latent_channels=5, widths=(2, 3, 4), pixel_patch=1, pca_shortcut=True)


def textured(clips: int) -> torch.Tensor:
    """Videos with a few strong directions, so that components differ."""
    generator = torch.Generator().manual_seed(0)
    weights = torch.rand(clips, 1, 5, 8, 8, generator=generator)
    return torch.cat([weights, 0.5 * weights, 1 - weights], 1) * 2 - 1


def test_components_are_those_of_the_blocks() -> None:
    vae, video = VideoVae(CONFIG), textured(40)
    moments = BlockStatistics(vae.pca_shortcut)
    for part in video.split(7):
        moments.add(part)
    set_principal_components(vae.pca_shortcut, moments)
    rows = vae.pca_shortcut.blocks(video).flatten(0, -2).double().numpy()
    centred = rows - rows.mean(0)
    _, size, directions = np.linalg.svd(centred, full_matrices=False)
    latent = vae.pca_shortcut.encode(video).movedim(1, -1).flatten(0, -2).detach().double().numpy()
    want = centred @ directions[:5].T / (size[:5] / np.sqrt(len(rows)))
    np.testing.assert_allclose(np.abs(latent), np.abs(want), atol=2e-4)


def test_a_fresh_autoencoder_is_its_pca_shortcut() -> None:
    vae, video = VideoVae(CONFIG), textured(3)
    moments = BlockStatistics(vae.pca_shortcut)
    moments.add(textured(30))
    set_principal_components(vae.pca_shortcut, moments)
    answer = vae.encode(video)
    torch.testing.assert_close(answer.mean, vae.pca_shortcut.encode(video))
    assert bool((answer.log_variance == -6.0).all())
    decoded = vae.decode(answer.mean)
    torch.testing.assert_close(decoded, vae.pca_shortcut.decode(answer.mean)[:, :, 3:])
    left = (decoded - video).square().mean()
    assert left < (video - video.mean()).square().mean()


def test_clips_without_any_variation_give_finite_weights() -> None:
    vae = VideoVae(CONFIG)
    moments = BlockStatistics(vae.pca_shortcut)
    moments.add(torch.zeros(2, 3, 5, 8, 8))
    set_principal_components(vae.pca_shortcut, moments)
    assert all(bool(p.isfinite().all()) for p in vae.pca_shortcut.parameters())
    torch.testing.assert_close(
        vae.decode(vae.encode(torch.zeros(1, 3, 1, 8, 8)).mean).amax(), torch.tensor(0.0)
    )
