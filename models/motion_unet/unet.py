"""Motion prior: a U-Net on cells that denoises displacement and predicts a motion mask (ours).

Axes: ``b`` batch, ``t`` latent frames after the first, ``n`` = b t, ``hh ww`` pixels of the first
image, ``hc wc`` its cells of 4 pixels, ``s e`` text tokens and their width, ``d`` width of the
condition. Motion in the units of ``motion_field``. Noise level 0 is data and 1 is noise.

    image, coordinates ─ conv ─┐
    object mask ─ conv (zero) ─┤
    noisy motion ─────── conv ─┴ + ─ 1/4 ─ 1/8 ─ 1/16 ─ 1/8 ─ 1/4 ─┬ conv (zero) ─ clean motion
    level, time, mean of the text ─ scale and shift of every block ┤
    text ─ text adapter ─ cross-attention in the encoder ──────────┤
                                                                   └ mean over time ─ mask logits

The latent frames of a sample interact through the mean of their features. The mask of cells is
refined at pixels (``mask_refiner``). With an object mask the motion is that of the object; a mask
of zeros is none.
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
"""The pixels of a cell and its coordinates."""
MULTIPLE_PX = 16
"""Image sides must be multiples of it: the coarsest cells."""


class MotionUNet(nn.Module):
    """Clean motion of every cell of an image in every latent frame after the first.

    Raises:
        ConfigError: ``width`` is not a multiple of twice the heads.
    """

    def __init__(
        self,
        width: int,
        heads: int,
        text: TextConfig,
        frequency_width: int = 128,
        mask_refiner_width: int = 0,
        object_mask: bool = False,
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
        mask_conv = nn.Conv2d(CELL_PX**2, fine, 3, padding=1, bias=False) if object_mask else None
        self.input_mask = None if mask_conv is None else zero_(mask_conv)
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
        # No norm before it: at low noise levels the output keeps the scale of the noisy motion.
        self.motion_head = zero_(nn.Conv2d(fine, CHANNELS, 3, padding=1))
        self.mask_head = zero_(nn.Conv2d(fine, CELL_PX**2, 3, padding=1))
        self.mask_refiner = MaskRefiner(mask_refiner_width, fine) if mask_refiner_width else None

    def forward(
        self,
        image: Float[Tensor, "b 3 hh ww"],
        noisy: Float[Tensor, "b 3 t hc wc"],
        level: Float[Tensor, " b"],
        text: Float[Tensor, "b s e"] | None = None,
        text_mask: Bool[Tensor, "b s"] | None = None,
        object_mask: Float[Tensor, "b hh ww"] | None = None,
    ) -> Float[Tensor, "b 3 t hc wc"]:
        """The clean motion (not a velocity); ``image`` is RGB in [0, 1].

        A sample without a real token in ``text_mask`` gets the output of one without text.

        Raises:
            ShapeError: the image sides are no multiples of 16, or the motion is not on its cells.
        """
        return self._motion(self.features(image, noisy, level, text, text_mask, object_mask), noisy)

    def predict_motion_and_mask(
        self,
        image: Float[Tensor, "b 3 hh ww"],
        noisy: Float[Tensor, "b 3 t hc wc"],
        level: Float[Tensor, " b"],
        text: Float[Tensor, "b s e"] | None = None,
        text_mask: Bool[Tensor, "b s"] | None = None,
        object_mask: Float[Tensor, "b hh ww"] | None = None,
    ) -> tuple[Float[Tensor, "b 3 t hc wc"], Float[Tensor, "b hh ww"]]:
        """The clean motion, and for every pixel the logit of the probability that it moves.

        Raises:
            ShapeError: as ``forward``.
        """
        features = self.features(image, noisy, level, text, text_mask, object_mask)
        pooled = features.unflatten(0, (noisy.shape[0], noisy.shape[2])).mean(1)
        mask = torch.nn.functional.pixel_shuffle(self.mask_head(pooled), CELL_PX)[:, 0]
        if self.mask_refiner is not None:
            mask = mask + self.mask_refiner(image, pooled)
        return self._motion(features, noisy), mask

    def features(
        self,
        image: Float[Tensor, "b 3 hh ww"],
        noisy: Float[Tensor, "b 3 t hc wc"],
        level: Float[Tensor, " b"],
        text: Float[Tensor, "b s e"] | None,
        text_mask: Bool[Tensor, "b s"] | None,
        object_mask: Float[Tensor, "b hh ww"] | None = None,
    ) -> Float[Tensor, "n c hc wc"]:
        """Input of both heads."""
        _require_sizes(image, noisy)
        samples, frames = noisy.shape[0], noisy.shape[2]
        tokens = None if text is None else self._adapt(text_tokens(text, text_mask))
        condition = self._condition(level, frames, tokens)
        features = self._input_features(image, noisy, object_mask)
        fine = self.fine(features, condition, samples, tokens)
        middle = self.middle(self.down_1(fine), condition, samples, tokens)
        coarse = self.coarse(self.down_2(middle), condition, samples, tokens)
        coarse = self.mid(coarse, condition)
        middle = self.middle_out(middle + _upsample(self.up_2(coarse)), condition)
        return self.fine_out(fine + _upsample(self.up_1(middle)), condition)

    def text_readings(
        self,
        text: Float[Tensor, "b s e"],
        text_mask: Bool[Tensor, "b s"] | None,
        generator: torch.Generator,
    ) -> list[Float[Tensor, "b r"]]:
        """All that a text adds: to the condition of every block, and to random features.

        For training alone: texts of one meaning should add the same to any image.
        """
        tokens = self._adapt(text_tokens(text, text_mask))
        levels = (self.fine, self.middle, self.coarse)
        of_features = [level.text_attention.added_to_random(tokens, generator) for level in levels]
        return [self._text_condition(tokens), *of_features]

    def _text_condition(self, tokens: TextTokens | None) -> Float[Tensor, "*b d"]:
        null = self.null_text_embedding
        return self.pooled_text(null if tokens is None else tokens.pooled(null))

    def _motion(
        self, features: Float[Tensor, "n c hc wc"], noisy: Float[Tensor, "b 3 t hc wc"]
    ) -> Float[Tensor, "b 3 t hc wc"]:
        motion = self.motion_head(features)
        return motion.unflatten(0, (noisy.shape[0], noisy.shape[2])).transpose(1, 2)

    def _adapt(self, tokens: TextTokens) -> TextTokens:
        return replace(tokens, states=self.text_adapter(tokens))

    def _condition(
        self, level: Float[Tensor, " b"], frames: int, tokens: TextTokens | None
    ) -> Float[Tensor, "n d"]:
        """Noise level and text of a sample, and the time of each latent frame in the clip."""
        time = torch.arange(1, frames + 1, device=level.device) / frames
        by_sample = self.level_mlp(level_embedding(level, self.frequency_width))
        by_sample = by_sample + self._text_condition(tokens)
        by_frame = self.time_mlp(level_embedding(time, self.frequency_width))
        return (by_sample[:, None] + by_frame).flatten(0, 1)

    def _input_features(
        self,
        image: Float[Tensor, "b 3 hh ww"],
        noisy: Float[Tensor, "b 3 t hc wc"],
        object_mask: Float[Tensor, "b hh ww"] | None,
    ) -> Float[Tensor, "n c hc wc"]:
        """Features of image and mask are computed once for all frames."""
        features = self.input_image(torch.cat([cells(image) * 2 - 1, cell_coordinates(noisy)], 1))
        if self.input_mask is not None and object_mask is not None:
            features = features + self.input_mask(cells(object_mask[:, None]))
        motion = self.input_motion(noisy.transpose(1, 2).flatten(0, 1))
        return (motion.unflatten(0, (noisy.shape[0], -1)) + features[:, None]).flatten(0, 1)


def widths(width: int, heads: int) -> tuple[int, int, int]:
    """Channels at 1/4, 1/8 and 1/16 of the resolution."""
    if width < 1 or heads < 1 or width % (2 * heads):
        raise ConfigError(
            f"width of the motion U-Net: expected a multiple of {2 * heads} for {heads} heads, "
            f"got {width}; change width or heads"
        )
    return width, 3 * width // 2, 2 * width


def cell_coordinates(noisy: Float[Tensor, "b 3 t hc wc"]) -> Float[Tensor, "b 2 hc wc"]:
    """X and y of the cell centres, −1 and 1 at the edges of the image."""
    y, x = (
        (2 * torch.arange(size, device=noisy.device, dtype=noisy.dtype) + 1) / size - 1
        for size in noisy.shape[3:]
    )
    grid = torch.stack(torch.meshgrid(x, y, indexing="xy"))
    return grid.expand(noisy.shape[0], -1, -1, -1)


def _upsample(maps: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c2 h2 w2"]:
    return torch.nn.functional.pixel_shuffle(maps, 2)


def _require_sizes(image: Float[Tensor, "..."], noisy: Float[Tensor, "..."]) -> None:
    size = tuple(image.shape[2:])
    if any(side == 0 or side % MULTIPLE_PX for side in size):
        raise ShapeError(
            f"image: expected multiples of {MULTIPLE_PX} pixels, got {size}; crop or resize it"
        )
    grid = tuple(side // CELL_PX for side in size)
    if tuple(noisy.shape[3:]) != grid or noisy.shape[2] == 0:
        raise ShapeError(
            f"motion: expected at least one latent frame of {grid} cells, got "
            f"{tuple(noisy.shape[2:])}; use the cells of the image"
        )
