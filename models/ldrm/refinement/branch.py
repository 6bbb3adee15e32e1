"""LDRM's refinement, from tokens to raw maps (ours, ADR 15).

Axes: ``b`` batch, ``k`` key frames, ``e`` width of a token, ``h4 w4`` token grid, ``h w`` cells of
4 pixels, ``hh ww`` pixels, ``d`` channels for the deformation network.

    tokens, posed video ─ decoder ─┬─ pixel head ── raw maps ─ depth ─ optical flow ─┐
                                   ├─ border head                                    │
                                   └──────────────────────── features ───────────────┴─ motion

With a depth prior the pixel head corrects the distance at which key frames start, else that of a
plane (ADR 38).
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.decoder import RefinementDecoder, widths
from diff4splat.models.ldrm.refinement.heads import BorderHead, PixelHead, ShareHead
from diff4splat.models.ldrm.refinement.motion_features import motion_features
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, StartDistance


class RefinementBranch(nn.Module):
    """Raw maps of the key frames and of the border extension."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        channels = widths(config.refinement.channels)[0]
        self.activation, self.depth_prior = config.activation, config.refinement.depth_prior
        self.decoder = RefinementDecoder(config)
        self.pixel_head = PixelHead(channels)
        if self.depth_prior:
            self.parallax_share = ShareHead(channels)
        margin = config.refinement.border_cells
        self.border_head = BorderHead(channels, margin) if margin else None

    def forward(
        self, tokens: Float[Tensor, "b e k h4 w4"], posed_video: PosedVideo, *, moving: bool
    ) -> RawGaussianMaps:
        """Maps whose tokens are the input of the deformation network, if anything is ``moving``."""
        batch = len(tokens)
        features = self.decoder(tokens, posed_video)
        raw = self.pixel_head(features).unflatten(0, (batch, -1))
        if self.depth_prior:
            raw = _on_start(raw, posed_video.start_or_plane(), self.parallax_share(features))
        features = features.unflatten(0, (batch, -1))
        border = None if self.border_head is None else self.border_head(features[:, 0])
        motion_input = features.transpose(1, 2)
        if moving:
            motion_input = motion_features(features, raw[:, :, -1], posed_video, self.activation)
        return RawGaussianMaps(gaussians=raw.transpose(1, 2), tokens=motion_input, border=border)


def _on_start(
    raw: Float[Tensor, "b k 12 h w"], start: StartDistance, share: Float[Tensor, "n 1 h w"]
) -> Float[Tensor, "b k 12 h w"]:
    """Raw maps whose distance corrects the prior's with a share of what parallax changes."""
    appearance, distance = raw.tensor_split([-1], 2)
    share = share.unflatten(0, raw.shape[:2]).to(start.prior)
    base = start.prior[:, :, None] + share * (start.parallax - start.prior)[:, :, None]
    return torch.cat([appearance, distance + base.to(distance)], 2)
