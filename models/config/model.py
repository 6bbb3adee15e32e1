"""The settings of a whole model, and their JSON form.

The JSON form lists every field, so that a stored model never changes when a default does.
"""

import hashlib
import json
from dataclasses import MISSING, Field, asdict, dataclass, field, fields, is_dataclass
from typing import TypeVar

from diff4splat.errors import ConfigError, InputError
from diff4splat.models.config.networks import (
    DETAIL_TOKEN_PX,
    MOTION_CELL_PX,
    TIME_STRIDE,
    TOKEN_PATCH,
    ActivationConfig,
    DeformationConfig,
    DetailConfig,
    DitConfig,
    LdrmConfig,
    TextConfig,
    VaeConfig,
    require,
    require_counts,
)

Config = TypeVar("Config")

__all__ = [
    "ActivationConfig",
    "DeformationConfig",
    "DetailConfig",
    "DitConfig",
    "LdrmConfig",
    "ModelConfig",
    "TextConfig",
    "VaeConfig",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelConfig:
    """Everything that decides the shape of the weights, and the sizes a model was made for."""

    name: str
    """Name of the size, such as ``small``; for people."""
    frames: int
    """Default number of video frames, 1 + 4 k; not stated in the paper, 49 is CogVideoX's."""
    size_px: tuple[int, int]
    """Default (height, width); 512 by 512 in the paper's later stages. Other sizes work too."""
    vae: VaeConfig
    text: TextConfig
    dit: DitConfig
    ldrm: LdrmConfig
    deformation: DeformationConfig
    activation: ActivationConfig
    detail: DetailConfig = field(default_factory=DetailConfig)

    def __post_init__(self) -> None:
        named = isinstance(self.name, str) and self.name != ""
        require(named, "ModelConfig.name", "a name", self.name)
        require_counts(self, "frames")
        pair = isinstance(self.size_px, tuple) and len(self.size_px) == 2
        whole = pair and all(isinstance(side, int) for side in self.size_px)
        require(whole, "ModelConfig.size_px", "(height, width) in whole pixels", self.size_px)
        try:
            self.latent_grid(self.frames, self.size_px)
        except InputError as error:
            raise ConfigError(f"ModelConfig {error}") from error
        sight = self.detail.used or self.ldrm.reads == "latents"
        require(sight, "LdrmConfig.reads", "latents where there is no detail decoder", "frames")
        whole = not self.detail.used or self.ldrm.grid_stride == 1
        require(whole, "LdrmConfig.grid_stride", "1 with a detail decoder", self.ldrm.grid_stride)
        fits = not self.detail.used or self.token_px == DETAIL_TOKEN_PX
        expected = f"tokens of {DETAIL_TOKEN_PX} px with a detail decoder"
        require(fits, "ModelConfig.vae", expected, self.token_px)
        fits = not self.dit.motion or self.vae.space_stride % MOTION_CELL_PX == 0
        expected = f"latent pixels of a multiple of {MOTION_CELL_PX} px for a motion"
        require(fits, "ModelConfig.vae", expected, self.vae.space_stride)
        finest = 2 ** len(self.deformation.level_widths) * self.ldrm.grid_stride
        fits = self.token_px % finest == 0
        require(fits, "ModelConfig.vae", f"tokens of a multiple of {finest} px", self.token_px)

    @property
    def token_px(self) -> int:
        """Pixels per token side; picture sides must be multiples of it."""
        return self.vae.space_stride * TOKEN_PATCH

    @property
    def motion_channels(self) -> int:
        """Channels that the video model makes beside those of the latent."""
        if not self.dit.motion:
            return 0
        return 3 * (self.vae.space_stride // MOTION_CELL_PX) ** 2

    def latent_grid(self, frames: int, size_px: tuple[int, int]) -> tuple[int, int, int]:
        """(frames, height, width) of the latent of a video.

        Raises:
            InputError: the frame count is not 1 + 4 k or a side is not a multiple of ``token_px``.
        """
        if frames < 1 or frames % TIME_STRIDE != 1:
            nearest = 1 + TIME_STRIDE * max(round((frames - 1) / TIME_STRIDE), 0)
            raise InputError(f"frames: expected 1 + 4 k, got {frames}; use {nearest}")
        for side in size_px:
            if side < 1 or side % self.token_px:
                nearest = self.token_px * max(round(side / self.token_px), 1)
                raise InputError(
                    f"picture size: expected sides that are multiples of {self.token_px} px, "
                    f"got {side}; use {nearest}"
                )
        stride = self.vae.space_stride
        return 1 + (frames - 1) // TIME_STRIDE, size_px[0] // stride, size_px[1] // stride

    def to_json(self) -> str:
        """Every field, sorted, as indented JSON."""
        return json.dumps(asdict(self), indent=2, sort_keys=True) + "\n"

    @classmethod
    def from_json(cls, text: str) -> "ModelConfig":
        """The configuration that ``to_json`` wrote.

        Raises:
            ConfigError: no JSON, an unknown or missing key, or a value out of range.
        """
        try:
            data = json.loads(text)
        except (json.JSONDecodeError, RecursionError) as error:
            raise ConfigError(f"model configuration: expected JSON, got {error}") from error
        return _build(cls, data, "model configuration")

    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that change whenever any field does."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()[:12]


def _build(kind: type[Config], data: object, where: str) -> Config:
    if not isinstance(data, dict):
        raise ConfigError(f"{where}: expected an object, got {type(data).__name__}")
    known = {entry.name: entry for entry in fields(kind)}
    for key in data:
        if key not in known:
            raise ConfigError(f"{where}: expected the keys {sorted(known)}, got {key!r}")
    missing = [name for name in known if name not in data and _is_needed(known[name])]
    if missing:
        raise ConfigError(f"{where}: expected the key {missing[0]!r}, got none")
    return kind(
        **{key: _value(known[key].type, value, f"{where}.{key}") for key, value in data.items()}
    )


def _is_needed(entry: Field) -> bool:
    return entry.default is MISSING and entry.default_factory is MISSING


def _value(kind: object, value: object, where: str) -> object:
    if is_dataclass(kind):
        return _build(kind, value, where)
    return tuple(value) if isinstance(value, list) else value
