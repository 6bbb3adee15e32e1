"""Settings of the single networks: frozen, checked at construction, each number with its source.

Sources: "paper" is Diff4Splat (arXiv 2511.00503) with the section; "inferred" is our choice where
the paper is silent; other names are the work a number was taken from.
"""

import math
from dataclasses import dataclass
from typing import Literal

from diff4splat.models.config.checks import (
    MAX_COUNT,
    require,
    require_counts,
    require_heads,
    require_optional_width,
)

TIME_STRIDE = 4
"""Video frames per latent frame after the first (paper); fixed, files depend on it."""
MAX_WIDTHS = 12
"""Resolutions of an autoencoder; each halves the image."""
LEAST_TILE_LATENTS = 6
"""Latent pixels per side of a tile, which must overlap by one."""
TOKEN_PATCH = 2
"""Latent pixels per token side, in the video model and in LDRM (paper)."""
REFINEMENT_TOKEN_PX = 16
"""Pixels per token side that the refinement decoder's three resolutions lead down to."""
MOTION_CELL_PX = 4
"""Pixels per cell side of the motion U-Net's displacement field."""
GAUSSIAN_SPLIT = (3, 3, 4, 1, 1)
"""RGB, scale, quaternion, opacity, ray distance: K_g = 12 as in Wonderland, not in the paper."""
DEFORMATION_SPLIT = (3, 4, 3)
"""Offset, rotation, scale offset: K_d = 10 (paper)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VaeConfig:
    """Causal 3D video autoencoder."""

    latent_channels: int
    """c; 32 in the paper, 16 in Wan 2.1 and CogVideoX."""
    widths: tuple[int, ...]
    """Channels per resolution, finest first; Wan 2.1 uses 96, 192, 384, 384."""
    pixel_patch: int = 1
    """Pixels per side folded into channels before the first convolution (2 in Wan 2.2)."""
    blocks: int = 1
    """Residual blocks per resolution (2 in Wan 2.1)."""
    pca_shortcut: bool = False
    """Convolutions correct a linear (PCA) autoencoder instead of replacing it (ours; ADR 14)."""
    layout: Literal["plain", "wan2.1", "wan2.2", "cogvideox"] = "plain"
    """Whose layers: ours, or those of public weights, which ``VideoVae`` cannot hold."""
    decoder_widths: tuple[int, ...] = ()
    """Channels of the decoder, finest first, where they differ (Wan 2.2)."""
    groups: int = 0
    """Groups of channels that are normalised together (CogVideoX: 32); others have none."""
    tile_px: tuple[int, ...] = ()
    """(height, width) of the overlapping tiles that larger videos are cut into (CogVideoX); none:
    whole frames."""

    def __post_init__(self) -> None:
        require_counts(self, "latent_channels", "pixel_patch", "blocks")
        known = self.layout in ("plain", "wan2.1", "wan2.2", "cogvideox")
        require(known, "VaeConfig.layout", "plain, wan2.1, wan2.2 or cogvideox", self.layout)
        self._require_groups_and_tiles()
        same = isinstance(self.decoder_widths, tuple)
        same = same and len(self.decoder_widths) in (0, len(self.widths))
        require(same, "VaeConfig.decoder_widths", "none, or one per width", self.decoder_widths)
        known = isinstance(self.pca_shortcut, bool)
        require(known, "VaeConfig.pca_shortcut", "true or false", self.pca_shortcut)
        enough = isinstance(self.widths, tuple) and 3 <= len(self.widths) <= MAX_WIDTHS
        require(
            enough,
            "VaeConfig.widths",
            f"at least 3 widths, for two halvings of time, and at most {MAX_WIDTHS}",
            self.widths,
        )
        for width in (*self.widths, *self.decoder_widths):
            require(
                isinstance(width, int) and 1 <= width <= MAX_COUNT,
                "VaeConfig.widths",
                "whole numbers above 0",
                width,
            )
        most = 3 * TIME_STRIDE * self.space_stride**2
        fits = not self.pca_shortcut or self.latent_channels <= most
        expected = f"at most the {most} values of a block with a PCA shortcut"
        require(fits, "VaeConfig.latent_channels", expected, self.latent_channels)

    def _require_groups_and_tiles(self) -> None:
        require_optional_width(self, "groups")
        needed = self.layout == "cogvideox"
        fits = bool(self.groups) == needed
        fits = fits and not (needed and any(width % self.groups for width in self.widths))
        require(
            fits, "VaeConfig.groups", "a divisor of the widths of cogvideox, else 0", self.groups
        )
        tile = self.tile_px
        whole = isinstance(tile, tuple) and all(isinstance(side, int) for side in tile)
        pair = whole and len(tile) == 2 and needed
        fits = tile == () or (pair and min(tile) >= LEAST_TILE_LATENTS * self.space_stride)
        least = f"none, or two sides of at least {LEAST_TILE_LATENTS * self.space_stride} px"
        require(fits, "VaeConfig.tile_px", f"{least} with cogvideox", tile)

    @property
    def space_stride(self) -> int:
        """Pixels per latent pixel side; 8 in the paper."""
        return self.pixel_patch * 2 ** (len(self.widths) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class TextConfig:
    """Text encoder in the manner of T5 (the paper names only T5): over bytes, UMT5 or T5 itself."""

    width: int
    """Width of the text states."""
    blocks: int
    heads: int
    feedforward_width: int
    max_bytes: int = 512
    """Longest prompt in UTF-8 bytes; inferred from Wan's 512 text tokens."""
    relative_position_buckets: int = 32
    """Relative-position buckets (T5)."""
    max_distance: int = 128
    """Distance in tokens from which all positions share a bucket (T5)."""
    encoder: Literal["bytes", "umt5", "t5"] = "bytes"
    """Bytes need no vocabulary; ``umt5`` is Wan's encoder and ``t5`` CogVideoX's, with a tokenizer
    beside their weights."""
    vocabulary: int = 0
    """Tokens that ``umt5`` or ``t5`` knows."""
    head_width: int = 0
    """Width of their heads, which need not divide the width."""

    def __post_init__(self) -> None:
        require_counts(self, "width", "blocks", "heads", "feedforward_width", "max_bytes")
        require_counts(self, "relative_position_buckets", "max_distance")
        known = self.encoder in ("bytes", "umt5", "t5")
        require(known, "TextConfig.encoder", "bytes, umt5 or t5", self.encoder)
        for name in ("vocabulary", "head_width"):
            require_optional_width(self, name)
            given = self.encoder == "bytes" or getattr(self, name) > 0
            require(given, f"TextConfig.{name}", "a number above 0", getattr(self, name))
        require_heads(self, smallest=2)
        buckets = self.relative_position_buckets
        fits = buckets % 4 == 0
        require(fits, "TextConfig.relative_position_buckets", "a multiple of 4", buckets)
        far = buckets // 4 < self.max_distance
        require(far, "TextConfig.max_distance", f"above {buckets // 4}", self.max_distance)


@dataclass(frozen=True, slots=True, kw_only=True)
class DitConfig:
    """Latent video diffusion transformer; block layout of Wan 2.1."""

    width: int
    """4096 in the paper."""
    blocks: int
    """32 in the paper."""
    heads: int
    """32 (inferred: Snap's video model with the paper's other numbers, heads of 128)."""
    feedforward_width: int
    """Four times the width (inferred; CogVideoX)."""
    frequency_width: int = 256
    """Width of the sinusoid of the noise level (Wan)."""
    camera_width: int = 64
    """Hidden width of the camera adapter (inferred; AC3D finds a narrow one enough)."""
    prediction_type: Literal["velocity", "clean"] = "velocity"
    """Velocity (paper), or the clean latent. Where a token holds more numbers than the width, noise
    does not fit through the network and data do (JiT, arXiv 2511.13720)."""
    render_condition: bool = False
    """Takes the layered image rendered along the path, with a mask of valid pixels. If it predicts
    clean latents it corrects that render (ours; as GEN3C and ViewCrafter; ADR 16, 26)."""
    padded_text_tokens: int = 0
    """Prompts count as padded to so many tokens, which are attended to (Wan: 512 with zeros,
    CogVideoX: 226 before the text encoder); 0: only real tokens are."""
    condition_channels: int = 0
    """Channels of a mask and image latents beside the noisy ones (Wan image-to-video: 20,
    CogVideoX: 16 without a mask); 0: the first latent frame is the image's."""
    image_width: int = 0
    """Width of image states that every block also attends to (Wan image-to-video: 1280, CLIP)."""
    expert_boundary: float = 0.0
    """Noise level from which another network of the same settings is asked (Wan 2.2 A14B: 0.875, or
    0.9 from an image); 0: one network for all levels."""
    pooled_text: bool = False
    """The mean of the text states also modulates every block, as the noise level does (Stable
    Diffusion 3, arXiv 2403.03206)."""

    def __post_init__(self) -> None:
        require_counts(
            self, "width", "blocks", "heads", "feedforward_width", "frequency_width", "camera_width"
        )
        require_heads(self, smallest=6)
        known = self.prediction_type in ("velocity", "clean")
        require(known, "DitConfig.prediction_type", "velocity or clean", self.prediction_type)
        for name in ("render_condition", "pooled_text"):
            value = getattr(self, name)
            require(isinstance(value, bool), f"DitConfig.{name}", "true or false", value)
        for name in ("padded_text_tokens", "condition_channels", "image_width"):
            require_optional_width(self, name)
        boundary = self.expert_boundary
        number = isinstance(boundary, int | float) and not isinstance(boundary, bool)
        inside = number and 0 <= boundary < 1
        require(inside, "DitConfig.expert_boundary", "a number from 0 on, below 1", boundary)
        one = not (self.pooled_text and self.padded_text_tokens)
        require(one, "DitConfig.pooled_text", "false with padded_text_tokens", self.pooled_text)
        require(
            self.frequency_width % 2 == 0,
            "DitConfig.frequency_width",
            "an even number",
            self.frequency_width,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LdrmConfig:
    """Latent Dynamic Reconstruction Model."""

    width: int
    """Not stated in the paper; 1024 in Wonderland, whose model it extends."""
    heads: int
    """Not stated in the paper."""
    feedforward_width: int
    """Not stated in the paper; four times the width is usual."""
    blocks: int = 16
    """16 in the paper."""
    embed_channels: int = 64
    """Latent channels are first projected to 64 (paper)."""
    grid_stride: Literal[1, 2] = 1
    """1: a Gaussian per pixel (paper); 2: one per 2 by 2 pixels (Wonderland, high resolution)."""
    input: Literal["latents", "frames"] = "latents"
    """Latents (paper), or the video frames themselves: for comparison only."""

    def __post_init__(self) -> None:
        require_counts(
            self, "width", "heads", "feedforward_width", "blocks", "embed_channels", "grid_stride"
        )
        require_heads(self, smallest=6)
        require(self.grid_stride in (1, 2), "LdrmConfig.grid_stride", "1 or 2", self.grid_stride)
        known = self.input in ("latents", "frames")
        require(known, "LdrmConfig.input", "latents or frames", self.input)


@dataclass(frozen=True, slots=True, kw_only=True)
class RefinementConfig:
    """LDRM's convolutional decoder, which takes frames beside tokens (ours, ADR 15)."""

    channels: int = 0
    """At a quarter of the resolution, two thirds more at each of two coarser ones; 0: none."""
    match_channels: int = 16
    """Feature channels that are compared across frames."""
    cost_volume_depths: int = 24
    """Depths at which they are compared; 0 leaves the cost volume out."""
    depth_range: tuple[float, float] = (1.0, 60.0)
    """Nearest and farthest compared depth in scene units; the plane prior is at 4."""
    border_cells: int = 16
    """Cells of 4 px by which the border layer extends the first frame, a multiple of 4; 0 leaves
    the layer out."""
    depth_prior: bool = False
    """Key frames start from the depth prior's depth in place of a plane (ours, ADR 38)."""

    def __post_init__(self) -> None:
        require_counts(self, "match_channels")
        known = isinstance(self.depth_prior, bool)
        require(known, "RefinementConfig.depth_prior", "true or false", self.depth_prior)
        fits = self.used or not self.depth_prior
        require(fits, "RefinementConfig.depth_prior", "false without channels", self.depth_prior)
        for name in ("channels", "cost_volume_depths", "border_cells"):
            require_optional_width(self, name)
        coarse = self.border_cells % 4 == 0
        require(coarse, "RefinementConfig.border_cells", "a multiple of 4", self.border_cells)
        pair = isinstance(self.depth_range, tuple) and len(self.depth_range) == 2
        pair = pair and all(isinstance(depth, int | float) for depth in self.depth_range)
        ordered = pair and 0 < self.depth_range[0] < self.depth_range[1] < math.inf
        expected = "two rising depths above 0"
        require(ordered, "RefinementConfig.depth_range", expected, self.depth_range)

    @property
    def used(self) -> bool:
        """Whether there is such a decoder."""
        return self.channels > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DeformationConfig:
    """Query-time deformation network (structure: paper appendix; sizes not stated)."""

    width: int
    """Channels of the time-conditioned tokens."""
    blocks: int = 2
    """Time-conditioned residual blocks."""
    level_widths: tuple[int, int, int] = (48, 24, 12)
    """Channels of the features at 1/2, 1/4 and 1/8 of the token side."""
    time_frequencies: int = 10
    """Frequencies 2^0 … 2^9 of the time embedding (MoVieS)."""
    static_threshold_px: float = 0.0
    """Displacement below which a Gaussian is static, in pixels at the model's default size: trained
    weights move static surfaces by about as much (ours, measured)."""

    def __post_init__(self) -> None:
        require_counts(self, "width", "blocks", "time_frequencies")
        threshold = self.static_threshold_px
        number = isinstance(threshold, int | float) and not isinstance(threshold, bool)
        small = number and 0 <= threshold < math.inf
        require(small, "DeformationConfig.static_threshold_px", "a number from 0 on", threshold)
        three = isinstance(self.level_widths, tuple) and len(self.level_widths) == 3
        require(three, "DeformationConfig.level_widths", "three widths", self.level_widths)
        for width in self.level_widths:
            whole = isinstance(width, int) and 1 <= width <= MAX_COUNT
            require(whole, "DeformationConfig.level_widths", "whole numbers above 0", width)


@dataclass(frozen=True, slots=True, kw_only=True)
class ActivationConfig:
    """Limits of the correction that the heads may make to the base scene; all inferred."""

    log_distance_limit: float = math.log(16)
    """L: ray distances stay within a factor e^L of the base."""
    log_scale_limit: float = math.log(16)
    """L: standard deviations stay within a factor e^L of the pixel footprint."""
    footprint_px: float = 0.35
    """Standard deviation of an uncorrected Gaussian, in cells of its grid. With the usual
    dilation 0.35 is right for one Gaussian per pixel, 0.6 for a half grid (docs/adr/0005)."""

    def __post_init__(self) -> None:
        for name in ("log_distance_limit", "log_scale_limit", "footprint_px"):
            value = getattr(self, name)
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            positive = number and math.isfinite(value) and value > 0
            require(positive, f"ActivationConfig.{name}", "a finite number above 0", value)
