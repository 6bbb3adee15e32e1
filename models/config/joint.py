"""Settings of a video model whose text and video tokens are one sequence (CogVideoX)."""

import math
from dataclasses import dataclass
from typing import Literal

from diff4splat.models.config.checks import MAX_COUNT, require, require_optional_width

POSITIONS = ("sinusoidal", "rotary", "learned")
BETAS = ("scaled_linear", "linear", "cosine")


@dataclass(frozen=True, slots=True, kw_only=True)
class JointConfig:
    """What CogVideoX (arXiv 2408.06072) has beyond ``DitConfig``; its noise schedule too."""

    level_width: int = 0
    """Width of the embedded noise level (512 in CogVideoX); 0: no joint sequence, as in Wan."""
    patch_frames: int = 1
    """Latent frames per token (2 in CogVideoX 1.5)."""
    positions: Literal["sinusoidal", "rotary", "learned"] = "sinusoidal"
    """Added sinusoids (2B), rotated queries and keys (5B), or a learned table beside these
    (5B-I2V)."""
    base_grid: tuple[int, int, int] = (13, 30, 45)
    """Latent frames, rows and columns of tokens that the weights were trained at."""
    space_scale: float = 1.875
    """By which added positions of rows and columns are divided (2B)."""
    time_scale: float = 1.0
    """By which those of frames are."""
    offset_width: int = 0
    """Width of the embedding of a constant (512 in CogVideoX1.5-5B-I2V); 0: none."""
    inverse_image_scale: bool = False
    """Image latents beside the noisy ones are divided by the scale of latents (1.5-I2V)."""
    betas: Literal["scaled_linear", "linear", "cosine"] = "scaled_linear"
    """How noise grows over 1000 steps."""
    first_beta: float = 0.00085
    last_beta: float = 0.012
    snr_shift: float = 1.0
    """By which the signal-to-noise ratio is divided (3 in 2B)."""
    zero_terminal_snr: bool = True
    """The last step is pure noise (arXiv 2305.08891)."""

    def __post_init__(self) -> None:
        for name in ("level_width", "offset_width"):
            require_optional_width(self, name)
        for name, known in {"positions": POSITIONS, "betas": BETAS}.items():
            value = getattr(self, name)
            require(value in known, f"JointConfig.{name}", " or ".join(known), value)
        for name in ("inverse_image_scale", "zero_terminal_snr"):
            value = getattr(self, name)
            require(isinstance(value, bool), f"JointConfig.{name}", "true or false", value)
        patch = self.patch_frames
        require(patch in (1, 2), "JointConfig.patch_frames", "1 or 2", patch)
        fits = patch == 1 or self.positions == "rotary"
        require(fits, "JointConfig.positions", "rotary with two frames per token", self.positions)
        self._require_numbers()

    def _require_numbers(self) -> None:
        grid = self.base_grid
        three = isinstance(grid, tuple) and len(grid) == 3
        whole = three and all(isinstance(n, int) and 1 <= n <= MAX_COUNT for n in grid)
        require(whole, "JointConfig.base_grid", "three whole numbers above 0", grid)
        for name in ("space_scale", "time_scale", "first_beta", "last_beta", "snr_shift"):
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            positive = number and 0 < value < math.inf
            require(positive, f"JointConfig.{name}", "a finite number above 0", value)
        rising = self.first_beta <= self.last_beta < 1
        require(rising, "JointConfig.last_beta", "at least first_beta and below 1", self.last_beta)

    @property
    def used(self) -> bool:
        """Whether the model has one sequence of text and video."""
        return self.level_width > 0
