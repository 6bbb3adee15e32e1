"""The settings of a whole model, and their JSON form.

The JSON form lists every field, so that a stored model never changes when a default does.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, asdict, dataclass, field, fields, is_dataclass
from typing import Any, Literal, TypeVar

from diff4splat.errors import ConfigError, FileFormatError, InputError
from diff4splat.models.config.checks import require, require_counts
from diff4splat.models.config.image_encoder import ImageEncoderConfig
from diff4splat.models.config.joint import JointConfig
from diff4splat.models.config.legacy import upgrade_config
from diff4splat.models.config.networks import (
    REFINEMENT_TOKEN_PX,
    TIME_STRIDE,
    TOKEN_PATCH,
    ActivationConfig,
    DeformationConfig,
    DitConfig,
    LdrmConfig,
    RefinementConfig,
    TextConfig,
    VaeConfig,
)
from diff4splat.models.config.priors import (
    ImageInpaintingConfig,
    MonocularDepthConfig,
    MotionUNetConfig,
    ObjectMaskConfig,
    ObjectShadowConfig,
)
from diff4splat.paths.formats.json_text import decode_json

Config = TypeVar("Config")
Fill = Literal["none", "video"]
"""What fills hidden regions: extended layers, or the video model's Gaussians."""
VERSION = 2
"""Of the JSON form; version 1 had no such key."""

__all__ = [
    "ActivationConfig",
    "DeformationConfig",
    "DitConfig",
    "ImageEncoderConfig",
    "ImageInpaintingConfig",
    "JointConfig",
    "LdrmConfig",
    "ModelConfig",
    "MonocularDepthConfig",
    "MotionUNetConfig",
    "ObjectMaskConfig",
    "ObjectShadowConfig",
    "RefinementConfig",
    "TextConfig",
    "VaeConfig",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelConfig:
    """Everything that decides the shape of the weights, and the default sizes."""

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
    refinement: RefinementConfig = field(default_factory=RefinementConfig)
    monocular_depth: MonocularDepthConfig = field(default_factory=MonocularDepthConfig)
    motion_unet: MotionUNetConfig = field(default_factory=MotionUNetConfig)
    object_mask: ObjectMaskConfig = field(default_factory=ObjectMaskConfig)
    image_inpainting: ImageInpaintingConfig = field(default_factory=ImageInpaintingConfig)
    object_shadow: ObjectShadowConfig = field(default_factory=ObjectShadowConfig)
    joint: JointConfig = field(default_factory=JointConfig)
    """Where the video model has one sequence of text and video."""
    image_encoder: ImageEncoderConfig = field(default_factory=ImageEncoderConfig)
    """Where the video model attends to states of the image."""
    default_fill: Fill = "video"
    """What fills hidden regions by default; the paper uses the video model. ``none`` where that
    model makes hidden regions worse."""
    default_guidance: float = 5.0
    """Weight of the video model's guidance where a prompt does not come with one; 1 is none."""

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
        known = self.default_fill in ("none", "video")
        require(known, "ModelConfig.default_fill", "none or video", self.default_fill)
        known = math.isfinite(self.default_guidance) and self.default_guidance >= 0
        require(known, "ModelConfig.default_guidance", "at least 0", self.default_guidance)
        self._require_fitting_refinement()
        self._require_fitting_joint()
        self._require_motion_prior()
        self._require_fitting_image_encoder()
        finest = 2 ** len(self.deformation.level_widths) * self.ldrm.grid_stride
        fits = self.token_px % finest == 0
        require(fits, "ModelConfig.vae", f"tokens of a multiple of {finest} px", self.token_px)

    def _require_fitting_refinement(self) -> None:
        """A refinement decoder takes frames and has one size of token."""
        used = self.refinement.used
        allowed = used or self.ldrm.input == "latents"
        require(allowed, "LdrmConfig.input", "latents without a refinement decoder", "frames")
        whole = not used or self.ldrm.grid_stride == 1
        expected = "1 with a refinement decoder"
        require(whole, "LdrmConfig.grid_stride", expected, self.ldrm.grid_stride)
        fits = self.monocular_depth.used or not self.refinement.depth_prior
        what, expected = "RefinementConfig.depth_prior", "false without a depth prior"
        require(fits, what, expected, self.refinement.depth_prior)
        fits = not used or self.token_px == REFINEMENT_TOKEN_PX
        expected = f"tokens of {REFINEMENT_TOKEN_PX} px with a refinement decoder"
        require(fits, "ModelConfig.vae", expected, self.token_px)

    def _require_fitting_joint(self) -> None:
        """Positions need heads and widths in whole parts; the network predicts v alone."""
        if not self.joint.used:
            return
        head = self.dit.width // self.dit.heads
        what = "DitConfig.heads"
        require(head % 8 == 0, what, "heads of a multiple of 8 with a joint sequence", head)
        require(self.dit.width % 16 == 0, "DitConfig.width", "a multiple of 16", self.dit.width)
        plain = self.dit.prediction_type == "velocity" and not self.dit.image_width
        plain = plain and not (self.dit.pooled_text or self.dit.expert_boundary)
        require(
            plain,
            "JointConfig",
            "velocity alone, no image states, pooled text or experts",
            self.dit,
        )

    def _require_motion_prior(self) -> None:
        """An object mask says what moves, a motion prior says how."""
        fits = self.motion_unet.used or not self.object_mask.used
        require(fits, "ObjectMaskConfig.width", "0 without a motion prior", self.object_mask.width)

    def _require_fitting_image_encoder(self) -> None:
        """Its states are those that the video model attends to."""
        fits = not self.image_encoder.used or self.image_encoder.width == self.dit.image_width
        expected = f"{self.dit.image_width} as DitConfig.image_width"
        require(fits, "ImageEncoderConfig.width", expected, self.image_encoder.width)

    @property
    def token_px(self) -> int:
        """Pixels per token side; image sides must be multiples of it."""
        return self.vae.space_stride * TOKEN_PATCH

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
                    f"image size: expected sides that are multiples of {self.token_px} px, "
                    f"got {side}; use {nearest}"
                )
        stride = self.vae.space_stride
        return 1 + (frames - 1) // TIME_STRIDE, size_px[0] // stride, size_px[1] // stride

    def to_json(self) -> str:
        """Every field, sorted, as indented JSON."""
        return json.dumps({"version": VERSION} | asdict(self), indent=2, sort_keys=True) + "\n"

    @classmethod
    def from_json(cls, text: str) -> "ModelConfig":
        """The configuration that ``to_json`` wrote, in this release or an earlier one.

        Raises:
            ConfigError: no JSON, an unknown or missing key, or a value out of range.
        """
        try:
            data = decode_json(text)
        except FileFormatError as error:
            raise ConfigError(f"model configuration: {error}") from error
        return _build(cls, _current(data), "model configuration")

    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that change whenever any field does."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()[:12]


def _current(data: Any) -> Any:
    """The fields of this version; anything that is no object is refused later.

    A configuration inside another file has no version; its sections show it.
    """
    if not isinstance(data, Mapping):
        return data
    version = data.get("version", VERSION if "refinement" in data else 1)
    if version not in (1, VERSION) or isinstance(version, bool):
        raise ConfigError(
            f"model configuration: expected version 1 or {VERSION}, got {version!r}; "
            "a newer diff4splat may read it"
        )
    current = {key: value for key, value in data.items() if key != "version"}
    return upgrade_config(current) if version == 1 else current


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
