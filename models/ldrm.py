"""Latent Dynamic Reconstruction Model: latents and rays to Gaussian maps (Diff4Splat, Wonderland).

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent frames, rows and columns, ``f hh ww``
video frames and pixels, ``t h2 w2`` token grid, ``d`` width. Both token sequences have the same
length:

    latent ─ 1×1 to 64 ─ patch 2×2 ─ linear ─ norm ─┐
    rays ─── patch 4×16×16 ─ linear ─ norm ─────────┴─ concatenate ─ linear ─ blocks ─ norm ─ tokens
    tokens ─ transposed convolution 4×16×16 (zero at first), drop 3 frames ─ 12 channels per pixel

The zero layer makes a fresh model answer exactly 0, which the heads read as "the base scene".
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.errors import ShapeError
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.norm import EPSILON
from diff4splat.models.blocks.patches import fill_first_pack, patchify
from diff4splat.models.blocks.rope import rope_tables
from diff4splat.models.blocks.transformer_block import TransformerBlock
from diff4splat.models.camera_adapter import PLUCKER_CHANNELS
from diff4splat.models.config import ModelConfig
from diff4splat.models.config_parts import GAUSSIAN_SPLIT, TIME_STRIDE, TOKEN_PATCH


@dataclass(frozen=True, slots=True, kw_only=True)
class ReconstructionMaps:
    """Raw attributes of one Gaussian per grid cell, and the tokens they came from."""

    gaussians: Float[Tensor, "b 12 f hh ww"]
    """Channels RGB 3, scale 3, quaternion 4, opacity 1, ray distance 1; zero is the base scene."""
    tokens: Float[Tensor, "b d t h2 w2"]
    """Canonical latent for the deformation network."""


class Ldrm(nn.Module):
    """Gaussians for every pixel of every frame from a video latent and its cameras."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        ldrm = config.ldrm
        self.config = ldrm
        self.token_px = config.token_px
        self.latent_embedding = nn.Linear(config.vae.latent_channels, ldrm.embed_channels)
        self.latent_tokens = nn.Linear(ldrm.embed_channels * TOKEN_PATCH**2, ldrm.width)
        self.latent_norm = nn.LayerNorm(ldrm.width, eps=EPSILON)
        self.pose_tokens = nn.Linear(PLUCKER_CHANNELS * TIME_STRIDE * self.token_px**2, ldrm.width)
        self.pose_norm = nn.LayerNorm(ldrm.width, eps=EPSILON)
        self.merge = nn.Linear(2 * ldrm.width, ldrm.width)
        self.blocks = nn.ModuleList(
            [
                TransformerBlock(ldrm.width, ldrm.heads, ldrm.feedforward_width)
                for _ in range(ldrm.blocks)
            ]
        )
        self.norm_out = nn.LayerNorm(ldrm.width, eps=EPSILON)
        side = self.token_px // ldrm.grid_stride
        self.to_gaussians = zero_(
            nn.ConvTranspose3d(
                *(ldrm.width, sum(GAUSSIAN_SPLIT)),
                kernel_size=(TIME_STRIDE, side, side),
                stride=(TIME_STRIDE, side, side),
            )
        )

    def forward(
        self, latent: Float[Tensor, "b c t h w"], camera: Float[Tensor, "b 6 f hh ww"]
    ) -> ReconstructionMaps:
        """Raw maps; ``camera`` is the Plücker map of the video frames relative to the first camera.

        Raises:
            ShapeError: latent and rays do not belong to the same video.
        """
        tokens = self._merge_tokens(self._latent_tokens(latent), self._pose_tokens(camera))
        grid = tuple(tokens.shape[1:4])
        rope = rope_tables(grid, self.config.width // self.config.heads, tokens.device)
        tokens = tokens.flatten(1, 3)
        for block in self.blocks:
            tokens = block(tokens, rope)
        maps = self.norm_out(tokens).transpose(1, 2).unflatten(2, grid)
        # Latent i holds frames 4 i − 3 … 4 i: three of the first pack lie before the video.
        gaussians = self.to_gaussians(maps)[:, :, TIME_STRIDE - 1 :]
        return ReconstructionMaps(
            gaussians=gaussians.to(latent.dtype), tokens=maps.to(latent.dtype)
        )

    def _latent_tokens(self, latent: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b t h2 w2 d"]:
        embedded = self.latent_embedding(latent.movedim(1, -1)).movedim(-1, 1)
        return self.latent_norm(
            self.latent_tokens(patchify(embedded, (1, TOKEN_PATCH, TOKEN_PATCH)))
        )

    def _pose_tokens(self, camera: Float[Tensor, "b 6 f hh ww"]) -> Float[Tensor, "b t h2 w2 d"]:
        # The first frame fills its pack of four, so pose and latent tokens cover the same frames.
        patch = (TIME_STRIDE, self.token_px, self.token_px)
        return self.pose_norm(self.pose_tokens(patchify(fill_first_pack(camera), patch)))

    def _merge_tokens(self, latent: Tensor, pose: Tensor) -> Tensor:
        if latent.shape != pose.shape:
            raise ShapeError(
                f"LDRM: expected rays for the latent's token grid {tuple(latent.shape[:4])}, "
                f"got {tuple(pose.shape[:4])}; make both from the same frames and picture size"
            )
        return self.merge(torch.cat([latent, pose], -1))
