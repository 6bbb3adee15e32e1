"""Latent Dynamic Reconstruction Model: latents and rays to Gaussian maps (Diff4Splat, Wonderland).

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent frames, rows and columns, ``f hh ww``
video frames and pixels, ``t h2 w2`` token grid, ``d`` width. Both token sequences have the same
length:

    latent ─ 1×1 to 64 ─ patch 2×2 ─ linear ─ norm ─┐
    rays ─── patch 4×16×16 ─ linear ─ norm ─────────┴─ concatenate ─ linear ─ blocks ─ norm ─ tokens
    tokens ─ transposed convolution 4×16×16 (zero at first), drop 3 frames ─ 12 channels per pixel

The zero layer makes a fresh model output exactly 0, which is the base scene.
With refinement (``refinement/``) the last line differs:

    tokens, frames, cameras ─ decoder ─┬─ 12 channels per pixel of the key frames
                                       └─ 12 channels per cell of the border layer
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.errors import ShapeError
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.norm import EPSILON
from diff4splat.models.blocks.patches import fill_first_pack, patchify
from diff4splat.models.blocks.rope import rope_tables
from diff4splat.models.blocks.transformer_block import TransformerBlock
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import GAUSSIAN_SPLIT, TIME_STRIDE, TOKEN_PATCH, LdrmConfig
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.branch import RefinementBranch
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.placement.shared_tokens import TokenGroup
from diff4splat.models.video_dit.camera_adapter import PLUCKER_CHANNELS


class Ldrm(nn.Module):
    """Gaussians for every pixel of every frame from a video latent and its cameras."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        ldrm = config.ldrm
        self.config = ldrm
        self.token_px = config.token_px
        if ldrm.input == "latents":
            self.latent_embedding = nn.Linear(config.vae.latent_channels, ldrm.embed_channels)
            self.latent_tokens = nn.Linear(ldrm.embed_channels * TOKEN_PATCH**2, ldrm.width)
        else:
            self.frame_tokens = nn.Linear(3 * TIME_STRIDE * self.token_px**2, ldrm.width)
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
        self.refinement = RefinementBranch(config) if config.refinement.used else None
        if self.refinement is None:
            self.to_gaussians = _to_pixels(ldrm, self.token_px // ldrm.grid_stride)
        self.sharing: TokenGroup | None = None

    def share_tokens(self, sharing: TokenGroup | None) -> None:
        """Let processes that compute the same sample share its tokens."""
        self.sharing = sharing
        for block in self.blocks:
            block.attention.sharing = sharing

    def forward(
        self,
        latent: Float[Tensor, "b c t h w"],
        camera: Float[Tensor, "b 6 f hh ww"],
        posed_video: PosedVideo | None = None,
        *,
        moving: bool = True,
    ) -> RawGaussianMaps:
        """Raw maps; ``camera`` is the Plücker map of the video frames relative to the first camera.

        Only refinement uses the ``posed_video``. If nothing is ``moving``, optical flow is not
        computed, and the deformation network cannot be run on the tokens.

        Raises:
            ShapeError: latent and rays belong to different videos, or the posed video is missing.
        """
        tokens = self._tokens(latent, camera, posed_video)
        if self.refinement is not None:
            return self.refinement(tokens, _require_frames(posed_video), moving=moving)
        # Latent i holds frames 4 i − 3 … 4 i: three of the first pack precede the video.
        gaussians = self.to_gaussians(tokens)[:, :, TIME_STRIDE - 1 :]
        return RawGaussianMaps(gaussians=gaussians.to(latent.dtype), tokens=tokens.to(latent.dtype))

    def _tokens(
        self, latent: Tensor, camera: Tensor, posed_video: PosedVideo | None
    ) -> Float[Tensor, "b d t h2 w2"]:
        """Normalised tokens after all blocks."""
        if self.config.input == "latents":
            content = self._latent_tokens(latent)
        else:
            content = self._frame_tokens(_require_frames(posed_video))
        tokens = self._merge_tokens(content, self._pose_tokens(camera))
        grid = tuple(tokens.shape[1:4])
        rope = rope_tables(grid, self.config.width // self.config.heads, tokens.device)
        tokens = tokens.flatten(1, 3)
        if self.sharing is not None:
            rope = self.sharing.split_rope(rope, 1)
            tokens = self.sharing.split(tokens, 1)
        for block in self.blocks:
            tokens = block(tokens, rope)
        if self.sharing is not None:
            tokens = self.sharing.join(tokens, 1)
        return self.norm_out(tokens).transpose(1, 2).unflatten(2, grid)

    def _latent_tokens(self, latent: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b t h2 w2 d"]:
        embedded = self.latent_embedding(latent.movedim(1, -1)).movedim(-1, 1)
        return self.latent_norm(
            self.latent_tokens(patchify(embedded, (1, TOKEN_PATCH, TOKEN_PATCH)))
        )

    def _frame_tokens(self, posed_video: PosedVideo) -> Float[Tensor, "b t h2 w2 d"]:
        patch = (TIME_STRIDE, self.token_px, self.token_px)
        packs = patchify(fill_first_pack(posed_video.rgb * 2 - 1), patch)
        return self.latent_norm(self.frame_tokens(packs))

    def _pose_tokens(self, camera: Float[Tensor, "b 6 f hh ww"]) -> Float[Tensor, "b t h2 w2 d"]:
        # The first frame fills its pack of four, so pose and latent tokens cover the same frames.
        patch = (TIME_STRIDE, self.token_px, self.token_px)
        return self.pose_norm(self.pose_tokens(patchify(fill_first_pack(camera), patch)))

    def _merge_tokens(self, latent: Tensor, pose: Tensor) -> Tensor:
        if latent.shape != pose.shape:
            raise ShapeError(
                f"LDRM: expected rays for the latent's token grid {tuple(latent.shape[:4])}, "
                f"got {tuple(pose.shape[:4])}; make both from the same frames and image size"
            )
        return self.merge(torch.cat([latent, pose], -1))


def _to_pixels(config: LdrmConfig, side_px: int) -> nn.ConvTranspose3d:
    """The layer from a token to the pixels of its four frames; zero when fresh."""
    block = (TIME_STRIDE, side_px, side_px)
    layer = nn.ConvTranspose3d(config.width, sum(GAUSSIAN_SPLIT), kernel_size=block, stride=block)
    return zero_(layer)


def _require_frames(posed_video: PosedVideo | None) -> PosedVideo:
    if posed_video is None:
        raise ShapeError(
            "LDRM: expected frames with their cameras for refinement, got none; "
            "hand over a PosedVideo"
        )
    return posed_video
