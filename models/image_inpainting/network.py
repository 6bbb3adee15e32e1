"""MI-GAN: what an image may show where nothing is known (Sargsyan et al., ICCV 2023).

Axes: ``n`` images, ``h w`` pixels.

    image, mask ─ encoder ─┬─ coarsest level ─ decoder ─ images of every size, added up
                           └─ states of every size, added to the decoder's

The published network was trained by an adversarial loss on Places2, on squares of 512 pixels. It
adds noise of at most 0.07 to its states, which changes nothing that can be seen; here there is
none. Gains of its activations are part of the weights (``public_weights``).
"""

from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.models.image_inpainting.separable_conv import SeparableConv, activated, doubled


class ImageInpainting(nn.Module):
    """``widths`` are channels from the level of pixels to the coarsest, each half as large."""

    def __init__(self, widths: Sequence[int]) -> None:
        super().__init__()
        finer, coarser = widths[:-1], widths[1:]
        self.multiple_px = 2 ** len(finer)
        self.input = nn.Conv2d(4, widths[0], 1)
        self.encoder = nn.ModuleList(map(EncoderLevel, finer, coarser))
        self.coarsest = CoarsestLevel(widths[-1])
        self.decoder = nn.ModuleList(map(DecoderLevel, coarser[::-1], finer[::-1]))

    def forward(
        self, image: Float[Tensor, "n 3 h w"], known: Bool[Tensor, "n h w"]
    ) -> Float[Tensor, "n 3 h w"]:
        """The image where it is ``known``, completed elsewhere.

        ``image`` is RGB in [0, 1], its sides multiples of ``multiple_px``.
        """
        mask = known[:, None].to(image)
        masked = torch.cat([mask - 0.5, (2 * image - 1) * mask], 1)
        # Channels last: twice as fast on a CPU.
        states = activated(self.input(masked.contiguous(memory_format=torch.channels_last)))
        by_level = []
        for level in self.encoder:
            states, same = level(states)
            by_level.append(same)
        states, found = self.coarsest(states)
        for level in self.decoder:
            states, found = level(states, by_level.pop(), found)
        return torch.where(mask > 0, image, (found / 2 + 0.5).clamp(0, 1))


class EncoderLevel(nn.Module):
    """From states of one size to those of half of it."""

    def __init__(self, channels: int, out_channels: int) -> None:
        super().__init__()
        self.same = SeparableConv(channels, channels)
        self.halved = SeparableConv(channels, out_channels, "halved")

    def forward(self, states: Tensor) -> tuple[Tensor, Tensor]:
        """The halved states, and those of the same size."""
        same = self.same(states)
        return self.halved(same), same


class CoarsestLevel(nn.Module):
    """Where encoder and decoder meet."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.encoder = nn.ModuleList(SeparableConv(channels, channels) for _ in range(2))
        self.decoder = nn.ModuleList(SeparableConv(channels, channels) for _ in range(2))
        self.image = nn.Conv2d(channels, 3, 1)

    def forward(self, states: Tensor) -> tuple[Tensor, Tensor]:
        """States, and the first image in [−1, 1]."""
        same = self.encoder[0](states)
        states = self.decoder[0](self.encoder[1](same))
        states = self.decoder[1](states + same)
        return states, self.image(states)


class DecoderLevel(nn.Module):
    """From states and image of one size to those of twice that."""

    def __init__(self, channels: int, out_channels: int) -> None:
        super().__init__()
        self.doubled = SeparableConv(channels, out_channels, "doubled")
        self.same = SeparableConv(out_channels, out_channels)
        self.image = nn.Conv2d(out_channels, 3, 1)

    def forward(self, states: Tensor, encoded: Tensor, image: Tensor) -> tuple[Tensor, Tensor]:
        """``encoded`` are the encoder's states of the larger size."""
        states = self.same(self.doubled(states) + encoded)
        return states, doubled(image) + self.image(states)
