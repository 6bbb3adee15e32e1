"""Settings of the single networks: frozen, checked when made, each number with its source.

Sources: "paper" is Diff4Splat (arXiv 2511.00503) with the section; "inferred" is our choice where
the paper is silent; other names are the work a number was taken from.
"""

import math
from dataclasses import dataclass
from typing import Literal

from diff4splat.errors import ConfigError

TIME_STRIDE = 4
"""Video frames per latent frame after the first (paper); fixed, files depend on it."""
TOKEN_PATCH = 2
"""Latent pixels per token side, in the video model and in LDRM (paper)."""
DETAIL_TOKEN_PX = 16
"""Pixels per token side that the detail decoder's three resolutions lead down to."""
MOTION_CELL_PX = 4
"""Pixels per cell side of the motion that a video model makes beside latents."""
GAUSSIAN_SPLIT = (3, 3, 4, 1, 1)
"""RGB, scale, quaternion, opacity, ray distance: K_g = 12 as in Wonderland, not in the paper."""
DEFORMATION_SPLIT = (3, 4, 3)
"""Offset, rotation, scale offset: K_d = 10 (paper)."""


def require(holds: bool, what: str, expected: str, got: object) -> None:
    """Raise a ConfigError in the usual words unless ``holds``."""
    if not holds:
        raise ConfigError(f"{what}: expected {expected}, got {got!r}")


def require_counts(config: object, *names: str) -> None:
    """Every named field must be a whole number of at least 1."""
    for name in names:
        value = getattr(config, name)
        whole = isinstance(value, int) and not isinstance(value, bool)
        require(
            whole and value >= 1,
            f"{type(config).__name__}.{name}",
            "a whole number of at least 1",
            value,
        )


def require_heads(config: "TextConfig | DitConfig | LdrmConfig", smallest: int) -> None:
    """The width must split into heads of an even width of at least ``smallest``."""
    what = f"{type(config).__name__}.heads"
    require(
        config.width % config.heads == 0, what, f"a divisor of width {config.width}", config.heads
    )
    head = config.width // config.heads
    require(head % 2 == 0 and head >= smallest, what, f"even heads of at least {smallest}", head)


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
    linear_code: bool = False
    """Convolutions correct a linear code instead of doing all (ours; docs/adr/0014)."""

    def __post_init__(self) -> None:
        require_counts(self, "latent_channels", "pixel_patch", "blocks")
        known = isinstance(self.linear_code, bool)
        require(known, "VaeConfig.linear_code", "true or false", self.linear_code)
        enough = isinstance(self.widths, tuple) and len(self.widths) >= 3
        require(
            enough, "VaeConfig.widths", "at least 3 widths, for two halvings of time", self.widths
        )
        for width in self.widths:
            require(
                isinstance(width, int) and width >= 1,
                "VaeConfig.widths",
                "whole numbers above 0",
                width,
            )
        most = 3 * TIME_STRIDE * self.space_stride**2
        fits = not self.linear_code or self.latent_channels <= most
        expected = f"at most the {most} values of a block with a linear code"
        require(fits, "VaeConfig.latent_channels", expected, self.latent_channels)

    @property
    def space_stride(self) -> int:
        """Pixels per latent pixel side; 8 in the paper."""
        return self.pixel_patch * 2 ** (len(self.widths) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class TextConfig:
    """Byte-level text encoder in the manner of T5 (the paper names only T5)."""

    width: int
    """Width of the text states."""
    blocks: int
    heads: int
    feedforward_width: int
    max_bytes: int = 512
    """Longest prompt in UTF-8 bytes; inferred from Wan's 512 text tokens."""
    buckets: int = 32
    """Relative-position buckets (T5)."""
    max_distance: int = 128
    """Distance in bytes from which all positions share a bucket (T5)."""

    def __post_init__(self) -> None:
        require_counts(self, "width", "blocks", "heads", "feedforward_width", "max_bytes")
        require_counts(self, "buckets", "max_distance")
        require_heads(self, smallest=2)
        require(self.buckets % 4 == 0, "TextConfig.buckets", "a multiple of 4", self.buckets)
        far = self.buckets // 4 < self.max_distance
        require(far, "TextConfig.max_distance", f"above {self.buckets // 4}", self.max_distance)


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
    predicts: Literal["velocity", "clean"] = "velocity"
    """Velocity (paper), or the clean latent that it leads to: where a token holds more numbers than
    the width, noise does not fit through and data do (JiT, arXiv 2511.13720)."""
    draft: bool = False
    """Also sees a draft of the video, and corrects it if it predicts clean latents (ours;
    docs/adr/0016)."""

    pooled_text: bool = False
    """The mean of the text states also modulates every block, as the noise level does (Stable
    Diffusion 3, arXiv 2403.03206): what a text means for all tokens need not pass attention."""
    motion: bool = False
    """Also makes, beside the latent, where what the first frame shows goes to (ours;
    docs/adr/0018)."""
    motion_width: int = 0
    """Width of a branch that tells that motion instead, from the pixels of the first picture (ours;
    docs/adr/0022); 0 is none."""
    motion_outline: int = 0
    """Width of what that branch sees the edges of things with (ours; docs/adr/0025); 0 is none."""

    def __post_init__(self) -> None:
        require_counts(
            self, "width", "blocks", "heads", "feedforward_width", "frequency_width", "camera_width"
        )
        require_heads(self, smallest=6)
        whole = isinstance(self.motion_width, int) and not isinstance(self.motion_width, bool)
        fits = whole and self.motion_width >= 0 and self.motion_width % (2 * self.heads) == 0
        multiple = f"0 or a multiple of {2 * self.heads}, twice the heads"
        require(fits, "DitConfig.motion_width", multiple, self.motion_width)
        told = self.motion or not self.motion_width
        require(told, "DitConfig.motion", "true where a branch tells it", self.motion)
        width = self.motion_outline
        whole = isinstance(width, int) and not isinstance(width, bool) and width >= 0
        require(whole, "DitConfig.motion_outline", "a whole number of at least 0", width)
        told = bool(self.motion_width) or not width
        require(told, "DitConfig.motion_outline", "0 without a branch that it belongs to", width)
        known = self.predicts in ("velocity", "clean")
        require(known, "DitConfig.predicts", "velocity or clean", self.predicts)
        for name in ("draft", "motion", "pooled_text"):
            value = getattr(self, name)
            require(isinstance(value, bool), f"DitConfig.{name}", "true or false", value)
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
    reads: Literal["latents", "frames"] = "latents"
    """Latents (paper), or the pictures themselves: for comparison only."""

    def __post_init__(self) -> None:
        require_counts(
            self, "width", "heads", "feedforward_width", "blocks", "embed_channels", "grid_stride"
        )
        require_heads(self, smallest=6)
        require(self.grid_stride in (1, 2), "LdrmConfig.grid_stride", "1 or 2", self.grid_stride)
        known = self.reads in ("latents", "frames")
        require(known, "LdrmConfig.reads", "latents or frames", self.reads)


@dataclass(frozen=True, slots=True, kw_only=True)
class DetailConfig:
    """Decoder with pictures beside tokens (ours, docs/adr/0015); a width of 0 leaves it out."""

    width: int = 0
    """Channels at a quarter of the resolution; two thirds more at each of two coarser ones."""
    match_channels: int = 16
    """Features that are compared between frames."""
    depths: int = 24
    """Depths at which they are compared; 0 leaves the comparison out."""
    range: tuple[float, float] = (1.0, 60.0)
    """Nearest and farthest compared depth, in units of which the plane stands at 4."""
    surroundings: int = 16
    """Cells of a quarter resolution that continue the first picture beyond its borders, a multiple
    of 4: part of the layer is seen four times coarser; 0 leaves the layer out."""
    picture_width: int = 0
    """Channels at half the resolution of the decoder's network for the depth of a picture without a
    video (ours, docs/adr/0023); 0 leaves it out."""

    def __post_init__(self) -> None:
        require_counts(self, "match_channels")
        for name in ("width", "depths", "surroundings", "picture_width"):
            value = getattr(self, name)
            whole = isinstance(value, int) and not isinstance(value, bool) and value >= 0
            require(whole, f"DetailConfig.{name}", "a whole number of at least 0", value)
        coarse = self.surroundings % 4 == 0
        require(coarse, "DetailConfig.surroundings", "a multiple of 4", self.surroundings)
        pair = isinstance(self.range, tuple) and len(self.range) == 2
        pair = pair and all(isinstance(depth, int | float) for depth in self.range)
        ordered = pair and 0 < self.range[0] < self.range[1] < math.inf
        require(ordered, "DetailConfig.range", "two rising depths above 0", self.range)

    @property
    def used(self) -> bool:
        """Whether there is such a decoder."""
        return self.width > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DeformationConfig:
    """Query-time deformation network (structure: paper appendix; sizes not stated)."""

    width: int
    """Channels of the time-conditioned tokens."""
    blocks: int = 2
    """Time-conditioned residual blocks."""
    level_widths: tuple[int, int, int] = (48, 24, 12)
    """Channels of the features at 1/2, 1/4 and 1/8 of the token side."""
    octaves: int = 10
    """Frequencies 2^0 … 2^9 of the time embedding (MoVieS)."""
    noise_px: float = 0.0
    """How far trained weights move what stands still, in pixels of the model's own size: Gaussians
    that are said to move less are taken to stand (ours, measured)."""

    def __post_init__(self) -> None:
        require_counts(self, "width", "blocks", "octaves")
        small = 0 <= self.noise_px < math.inf
        require(small, "DeformationConfig.noise_px", "a number from 0 on", self.noise_px)
        three = isinstance(self.level_widths, tuple) and len(self.level_widths) == 3
        require(three, "DeformationConfig.level_widths", "three widths", self.level_widths)
        for width in self.level_widths:
            whole = isinstance(width, int) and width >= 1
            require(whole, "DeformationConfig.level_widths", "whole numbers above 0", width)


@dataclass(frozen=True, slots=True, kw_only=True)
class ActivationConfig:
    """Limits of the correction that the heads may make to the base scene; all inferred."""

    log_distance_limit: float = math.log(16)
    """L: ray distances stay within a factor e^L of the base."""
    log_scale_limit: float = math.log(16)
    """L: standard deviations stay within a factor e^L of the pixel footprint."""
    footprint_px: float = 0.35
    """Standard deviation of an uncorrected Gaussian, in cells of its own grid. With the usual
    dilation 0.35 is right for one Gaussian per pixel, 0.6 for a half grid (docs/adr/0005)."""

    def __post_init__(self) -> None:
        for name in ("log_distance_limit", "log_scale_limit", "footprint_px"):
            value = getattr(self, name)
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            positive = number and math.isfinite(value) and value > 0
            require(positive, f"ActivationConfig.{name}", "a finite number above 0", value)
