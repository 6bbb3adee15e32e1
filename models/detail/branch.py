"""Everything after the tokens when there is a detail decoder: features, raw maps, motion cues.

Axes: ``b`` batch, ``k`` key frames, ``e`` width of a token, ``h4 w4`` token grid, ``h w`` cells of
4 pixels, ``hh ww`` pixels, ``d`` channels for the deformation network.

    tokens, sight ─ decoder ─┬─ pixel head ─── raw maps ─ depth ─ pixels followed ───────┐
                             ├─ surroundings                                             │
                             └──────────────────────────── features ─────────────────────┴─ motion

Where there is one picture alone, a network of its own tells its depth (``picture_depth``).
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.config import ModelConfig
from diff4splat.models.detail.decoder import DetailDecoder, widths
from diff4splat.models.detail.heads import PixelHead, SurroundingsHead
from diff4splat.models.detail.picture_depth import PictureDepth
from diff4splat.models.detail.sight import Sight
from diff4splat.models.detail.stabilise import motion_cues
from diff4splat.models.maps import ReconstructionMaps


class DetailBranch(nn.Module):
    """Raw maps of the key frames and of the surroundings."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        width = widths(config.detail.width)[0]
        self.activation = config.activation
        self.decoder = DetailDecoder(config)
        self.pixels = PixelHead(width)
        margin = config.detail.surroundings
        self.surroundings = SurroundingsHead(width, margin) if margin else None
        own = config.detail.picture_width
        self.picture_depth = PictureDepth(own) if own else None

    def forward(
        self, tokens: Float[Tensor, "b e k h4 w4"], sight: Sight, *, moving: bool
    ) -> ReconstructionMaps:
        """``tokens`` of the answer are what the deformation network looks at, if it is asked."""
        batch = len(tokens)
        features = self.decoder(tokens, sight)
        raw = self._with_own_depth(self.pixels(features).unflatten(0, (batch, -1)), sight)
        features = features.unflatten(0, (batch, -1))
        around = None if self.surroundings is None else self.surroundings(features[:, 0])
        seen = features.transpose(1, 2)
        if moving:
            seen = motion_cues(features, raw[:, :, -1], sight, self.activation)
        return ReconstructionMaps(gaussians=raw.transpose(1, 2), tokens=seen, surroundings=around)

    def _with_own_depth(
        self, raw: Float[Tensor, "b k 12 hh ww"], sight: Sight
    ) -> Float[Tensor, "b k 12 hh ww"]:
        """One picture has no parallax that the decoder could see."""
        if self.picture_depth is None or sight.rgb.shape[2] > 1:
            return raw
        distance = self.picture_depth(sight.rgb[:, :, 0])
        return torch.cat([raw[:, :, :-1], distance[:, None].to(raw.dtype)], 2)
