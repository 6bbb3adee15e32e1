"""What an import must know of a family of public models."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from torch import Tensor

from diff4splat.models.config.image_encoder import ImageEncoderConfig
from diff4splat.models.config.joint import JointConfig
from diff4splat.models.config.networks import DitConfig, TextConfig, VaeConfig
from diff4splat.models.public_weights.options import ImportOptions
from diff4splat.models.public_weights.source_folder import SourceFolder


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightSource:
    """A folder of public weights that becomes a part of our model, or a piece of one."""

    folder: str
    rename: Callable[[str], str | None]
    """Public name → ours, without the prefix; None for a weight that nothing uses."""
    prefix: str = ""
    """Of our names, where a part is made of several folders."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicNetworks:
    """Our settings for the networks of one public model, and where their weights are."""

    name: str
    size_px: tuple[int, int]
    """(height, width) that the weights were trained at."""
    vae: VaeConfig
    text: TextConfig
    dit: DitConfig
    joint: JointConfig = field(default_factory=JointConfig)
    image_encoder: ImageEncoderConfig = field(default_factory=ImageEncoderConfig)
    sources: Mapping[str, tuple[WeightSource, ...]]
    """By part of our model."""
    statistics: Mapping[str, Tensor]
    """Mean and standard deviation of the latents, which are no weights there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Public models of one architecture."""

    pipelines: tuple[str, ...]
    """Classes that ``model_index.json`` may name."""
    read: Callable[[SourceFolder, ImportOptions], PublicNetworks]
    """Settings of a folder; raises a CheckpointError for what cannot be imported."""
    tokenizer: Callable[[SourceFolder], bytes]
    """Vocabulary of the text encoder as ``tokenizer.json``."""
