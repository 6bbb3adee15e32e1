"""What moves, and clean motion from a noisy one, by picture and words: a U-Net on cells (ours).

Axes: ``b`` batch, ``t`` latent frames after the first, ``n`` = b t, ``hh ww`` pixels of the first
picture, ``hc wc`` its cells of 4 pixels, ``s e`` text tokens and their width, ``d`` width of the
condition. Motion in the units of ``video_motion``. Noise level 0 is data and 1 is noise.

    picture, place ─ conv ─┐
    noisy motion ─── conv ─┴ + ─ 1/4 ─ 1/8 ─ 1/16 ─ 1/8 ─ 1/4 ─┬ conv (zero) ─ clean motion
    level, time, mean of the words ─ scale and shift of every block ┤
    words ─ reader ─ attention of every cell, on the way down ──────┤
                                                                    └ mean over time ─ what moves

The latent frames of a sample see each other through the mean of their features. Cells know which
thing moves; where it ends, a second look at the pixels tells (``outline``).
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.models.blocks.conv_block import CELL_PX, cells
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.time_embedding import EmbeddingMlp, level_embedding
from diff4splat.models.config.networks import TextConfig
from diff4splat.models.motion_unet.layers import ModulatedConvBlock, UNetLevel
from diff4splat.models.motion_unet.mask_refiner import MaskRefiner
from diff4splat.models.motion_unet.text_adapter import TextAdapter
from diff4splat.models.motion_unet.text_tokens import TextTokens, text_tokens

CHANNELS = 3
IMAGE_CHANNELS = 3 * CELL_PX**2 + 2
"""The pixels of a cell and its place."""
MULTIPLE_PX = 16
"""What the size of a picture must be a multiple of: the coarsest cells."""


class MotionUNet(nn.Module):
    """Clean motion of every cell of a picture in every latent frame after the first.

    Raises:
        ConfigError: ``width`` cannot be shared by the heads at all three resolutions.
    """

    def __init__(
        self,
        width: int,
        heads: int,
        text: TextConfig,
        frequency_width: int = 128,
        mask_refiner_width: int = 0,
    ) -> None:
        super().__init__()
        fine, middle, coarse = widths(width, heads)
        self.frequency_width = frequency_width
        self.level_mlp = EmbeddingMlp(frequency_width, width)
        self.time_mlp = EmbeddingMlp(frequency_width, width)
        self.text_adapter = TextAdapter(text)
        self.pooled_text = nn.Linear(text.width, width)
        self.null_text_embedding = nn.Parameter(torch.zeros(text.width))
        self.input_image = nn.Conv2d(IMAGE_CHANNELS, fine, 3, padding=1)
        self.input_motion = nn.Conv2d(CHANNELS, fine, 3, padding=1, bias=False)
        self.fine, self.middle, self.coarse = (
            UNetLevel(channels, width, heads, text.width) for channels in (fine, middle, coarse)
        )
        self.down_1 = nn.Conv2d(fine, middle, 2, stride=2)
        self.down_2 = nn.Conv2d(middle, coarse, 2, stride=2)
        self.mid = ModulatedConvBlock(coarse, width)
        self.up_2 = nn.Conv2d(coarse, 4 * middle, 1)
        self.up_1 = nn.Conv2d(middle, 4 * fine, 1)
        self.middle_out = ModulatedConvBlock(middle, width)
        self.fine_out = ModulatedConvBlock(fine, width)
        # No norm before it: at low levels the answer is the noisy motion itself, size and all.
        self.motion_head = zero_(nn.Conv2d(fine, CHANNELS, 3, padding=1))
        self.mask_head = zero_(nn.Conv2d(fine, CELL_PX**2, 3, padding=1))
        self.mask_refiner = MaskRefiner(mask_refiner_width, fine) if mask_refiner_width else None

    def forward(
        self,
        picture: Float[Tensor, "b 3 hh ww"],
        noisy: Float[Tensor, "b 3 t hc wc"],
        level: Float[Tensor, " b"],
        text: Float[Tensor, "b s e"] | None = None,
        text_mask: Bool[Tensor, "b s"] | None = None,
    ) -> Float[Tensor, "b 3 t hc wc"]:
        """The clean motion (not a velocity); ``picture`` is RGB in [0, 1].

        A sample of which no token is real in ``text_mask`` gets the answer of one without a text.

        Raises:
            ShapeError: the picture is no multiple of 16 pixels, or the motion not on its cells.
        """
        return self._motion(self.features(picture, noisy, level, text, text_mask), noisy)

    def predict_motion_and_mask(
        self,
        picture: Float[Tensor, "b 3 hh ww"],
        noisy: Float[Tensor, "b 3 t hc wc"],
        level: Float[Tensor, " b"],
        text: Float[Tensor, "b s e"] | None = None,
        text_mask: Bool[Tensor, "b s"] | None = None,
    ) -> tuple[Float[Tensor, "b 3 t hc wc"], Float[Tensor, "b hh ww"]]:
        """The clean motion, and for every pixel the logit of how likely it moves at all.

        Raises:
            ShapeError: as ``forward``.
        """
        features = self.features(picture, noisy, level, text, text_mask)
        told = features.unflatten(0, (len(noisy), noisy.shape[2])).mean(1)
        moves = torch.nn.functional.pixel_shuffle(self.mask_head(told), CELL_PX)[:, 0]
        if self.mask_refiner is not None:
            moves = moves + self.mask_refiner(picture, told)
        return self._motion(features, noisy), moves

    def features(
        self,
        picture: Float[Tensor, "b 3 hh ww"],
        noisy: Float[Tensor, "b 3 t hc wc"],
        level: Float[Tensor, " b"],
        text: Float[Tensor, "b s e"] | None,
        text_mask: Bool[Tensor, "b s"] | None,
    ) -> Float[Tensor, "n c hc wc"]:
        """What both answers are read from."""
        _require_sizes(picture, noisy)
        samples, frames = len(noisy), noisy.shape[2]
        words = None if text is None else self._read(text_tokens(text, text_mask))
        condition = self._condition(level, frames, words)
        fine = self.fine(self._input_features(picture, noisy), condition, samples, words)
        middle = self.middle(self.down_1(fine), condition, samples, words)
        coarse = self.coarse(self.down_2(middle), condition, samples, words)
        coarse = self.mid(coarse, condition)
        middle = self.middle_out(middle + _upsample(self.up_2(coarse)), condition)
        return self.fine_out(fine + _upsample(self.up_1(middle)), condition)

    def _motion(
        self, features: Float[Tensor, "n c hc wc"], noisy: Float[Tensor, "b 3 t hc wc"]
    ) -> Float[Tensor, "b 3 t hc wc"]:
        motion = self.motion_head(features)
        return motion.unflatten(0, (len(noisy), noisy.shape[2])).transpose(1, 2)

    def _read(self, words: TextTokens) -> TextTokens:
        return replace(words, states=self.text_adapter(words))

    def _condition(
        self, level: Float[Tensor, " b"], frames: int, words: TextTokens | None
    ) -> Float[Tensor, "n d"]:
        """Level and words of a sample, and the time of a latent frame as a share of the clip."""
        time = torch.arange(1, frames + 1, device=level.device) / frames
        pooled = (
            self.null_text_embedding if words is None else words.pooled(self.null_text_embedding)
        )
        by_sample = self.level_mlp(level_embedding(level, self.frequency_width))
        by_sample = by_sample + self.pooled_text(pooled)
        by_frame = self.time_mlp(level_embedding(time, self.frequency_width))
        return (by_sample[:, None] + by_frame).flatten(0, 1)

    def _input_features(
        self, picture: Float[Tensor, "b 3 hh ww"], noisy: Float[Tensor, "b 3 t hc wc"]
    ) -> Float[Tensor, "n c hc wc"]:
        """The picture's features are made once for all frames."""
        seen = self.input_image(torch.cat([cells(picture) * 2 - 1, cell_coordinates(noisy)], 1))
        motion = self.input_motion(noisy.transpose(1, 2).flatten(0, 1))
        return (motion.unflatten(0, (len(noisy), -1)) + seen[:, None]).flatten(0, 1)


def widths(width: int, heads: int) -> tuple[int, int, int]:
    """Channels at 1/4, 1/8 and 1/16 of the resolution."""
    if width < 1 or heads < 1 or width % (2 * heads):
        raise ConfigError(
            f"width of the motion branch: expected a multiple of {2 * heads} for {heads} heads, "
            f"got {width}; change width or heads"
        )
    return width, 3 * width // 2, 2 * width


def cell_coordinates(noisy: Float[Tensor, "b 3 t hc wc"]) -> Float[Tensor, "b 2 hc wc"]:
    """X and y of the cells' centres, −1 and 1 at the edges of the picture."""
    y, x = (
        (2 * torch.arange(size, device=noisy.device, dtype=noisy.dtype) + 1) / size - 1
        for size in noisy.shape[3:]
    )
    grid = torch.stack(torch.meshgrid(x, y, indexing="xy"))
    return grid.expand(len(noisy), -1, -1, -1)


def _upsample(maps: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c2 h2 w2"]:
    return torch.nn.functional.pixel_shuffle(maps, 2)


def _require_sizes(picture: Float[Tensor, "..."], noisy: Float[Tensor, "..."]) -> None:
    size = tuple(picture.shape[2:])
    if any(side == 0 or side % MULTIPLE_PX for side in size):
        raise ShapeError(
            f"picture: expected multiples of {MULTIPLE_PX} pixels, got {size}; crop or resize it"
        )
    grid = tuple(side // CELL_PX for side in size)
    if tuple(noisy.shape[3:]) != grid or noisy.shape[2] == 0:
        raise ShapeError(
            f"motion: expected at least one latent frame of {grid} cells, got "
            f"{tuple(noisy.shape[2:])}; make it on the cells of the picture"
        )
