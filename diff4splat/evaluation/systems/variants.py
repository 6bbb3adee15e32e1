"""The same generation with one thing changed: a network left out, or another fill.

A variant that runs the networks of the full system gives its scene bit for bit: it is not computed
again, and its row differs by exactly 0.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from diff4splat.evaluation.systems.evaluated_system import Generator
from diff4splat.evaluation.systems.network_names import NETWORKS, Network

REMOVED_PARTS: dict[Network, tuple[str, ...]] = {
    "depth": ("monocular_depth",),
    "motion": ("motion_unet",),
    "object-mask": ("object_mask",),
    "image-classifier": ("image_classifier",),
    "image-inpainting": ("image_inpainting",),
    "object-shadow": ("object_shadow",),
    "text": ("text_encoder",),
    "video": ("dit",),
    "ldrm": ("vae", "ldrm"),
    "deformation": ("deformation",),
}
"""Networks that stay out."""
ABLATION_ROWS: dict[Network, str] = {
    "depth": "without depth prior",
    "motion": "without motion prior",
    "object-mask": "without object mask",
    "image-classifier": "without image classifier",
    "image-inpainting": "without image inpainting",
    "object-shadow": "without object shadow",
    "text": "without text encoder",
    "video": "without video model",
    "ldrm": "without VAE and LDRM",
    "deformation": "without deformation",
}
EXTENSION = "border extension"


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """A row of the table: the system with one thing changed."""

    row: str
    system: Generator
    same: bool
    """Whether it runs what the full system runs."""


def ablations(generator: Generator, networks: Iterable[Network]) -> tuple[Variant, ...]:
    """One variant per network that is left out, in the order of the table."""
    wanted = set(networks)
    return tuple(
        _variant(ABLATION_ROWS[name], generator, without=REMOVED_PARTS[name])
        for name in NETWORKS
        if name in wanted
    )


def border_extension(generator: Generator) -> Variant:
    """Extended layers in what the image hides; no video model."""
    return _variant(EXTENSION, generator, fill="none")


def unfilled(generator: Generator) -> Generator:
    """Nothing in what the image hides: its own layers alone."""
    settings = replace(generator.settings, fill="none", extended_layers=False)
    return replace(generator, settings=settings)


def _variant(row: str, full: Generator, **settings: object) -> Variant:
    changed = replace(full, settings=replace(full.settings, **settings))
    return Variant(row=row, system=changed, same=changed.parts == full.parts)
