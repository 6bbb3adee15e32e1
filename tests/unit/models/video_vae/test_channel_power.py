"""The power that each channel of a PCA shortcut adds to the pixels."""

from dataclasses import replace

import torch

from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.video_vae.pca_shortcut import PcaShortcut

CONFIG = replace(tiny_size().vae, pca_shortcut=True)


def test_energy_is_what_a_step_along_the_channel_changes() -> None:
    shortcut = PcaShortcut(CONFIG)
    power, latent = shortcut.channel_power(), torch.randn(1, 4, 2, 3, 5)
    assert power.shape == (4,) and not power.requires_grad
    for channel in range(4):
        step = torch.zeros_like(latent)
        step[:, channel, 1, 2, 3] = 1.0
        change = (shortcut.decode(latent + step) - shortcut.decode(latent)).square().sum()
        torch.testing.assert_close(change.detach(), power[channel], rtol=1e-4, atol=1e-6)


def test_of_components_it_is_their_variance() -> None:
    shortcut, std = PcaShortcut(CONFIG), torch.tensor([3.0, 2.0, 1.0, 0.5])
    values = shortcut.to_latent.in_features
    components = torch.linalg.qr(torch.randn(values, 4)).Q.mT
    shortcut.set_components(torch.randn(values), components, std)
    torch.testing.assert_close(shortcut.channel_power(), std.square())


def test_the_mean_of_images_does_not_count() -> None:
    shortcut = PcaShortcut(CONFIG)
    before = shortcut.channel_power()
    with torch.no_grad():
        shortcut.to_block.bias.add_(7.0)
    assert torch.equal(shortcut.channel_power(), before)
