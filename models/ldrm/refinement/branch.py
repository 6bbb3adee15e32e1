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

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.decoder import RefinementDecoder, widths
from diff4splat.models.ldrm.refinement.heads import PixelHead, SurroundingsHead
from diff4splat.models.ldrm.refinement.motion_features import motion_features
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.monocular_depth.network import MonocularDepthNet


class RefinementBranch(nn.Module):
    """Raw maps of the key frames and of the surroundings."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        width = widths(config.detail.width)[0]
        self.activation = config.activation
        self.decoder = RefinementDecoder(config)
        self.pixels = PixelHead(width)
        margin = config.detail.surroundings
        self.surroundings = SurroundingsHead(width, margin) if margin else None
        own = config.detail.picture_width
        self.picture_depth = MonocularDepthNet(own) if own else None

    def forward(
        self, tokens: Float[Tensor, "b e k h4 w4"], sight: PosedVideo, *, moving: bool
    ) -> RawGaussianMaps:
        """``tokens`` of the answer are what the deformation network looks at, if it is asked."""
        batch = len(tokens)
        features = self.decoder(tokens, sight)
        raw = self._with_own_depth(self.pixels(features).unflatten(0, (batch, -1)), sight)
        features = features.unflatten(0, (batch, -1))
        around = None if self.surroundings is None else self.surroundings(features[:, 0])
        seen = features.transpose(1, 2)
        if moving:
            seen = motion_features(features, raw[:, :, -1], sight, self.activation)
        return RawGaussianMaps(gaussians=raw.transpose(1, 2), tokens=seen, surroundings=around)

    def _with_own_depth(
        self, raw: Float[Tensor, "b k 12 hh ww"], sight: PosedVideo
    ) -> Float[Tensor, "b k 12 hh ww"]:
        """One picture has no parallax that the decoder could see."""
        if self.picture_depth is None or sight.rgb.shape[2] > 1:
            return raw
        distance = self.picture_depth(sight.rgb[:, :, 0])
        return torch.cat([raw[:, :, :-1], distance[:, None].to(raw.dtype)], 2)
