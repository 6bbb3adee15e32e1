"""Sections of the page: which knobs belong together."""

from collections.abc import Mapping

OTHER = "Others"
GROUPS: Mapping[str, tuple[str, ...]] = {
    "Sampling video and motion": ("video-", "motion-", "block-caching"),
    "Networks: bits, runtimes, sizes": ("precision-", "runtime", "network-resolution", "vae-"),
    "From an image to a scene": ("color-", "subpixel-", "static-", "key-times", "fill-"),
    "Files and fits": ("scene-compression", "bake-", "fit-"),
    "Rendering": (
        *("pruning", "sh-degree", "tile-", "support-", "light-", "dilation", "precision"),
        *("rows-", "aperture-", "exposure-", "trace-"),
    ),
    "Exact velocity fields": ("sampler", "levels", "guidance-"),
    OTHER: (),
}
"""Beginnings of the names, in the order of the page; the first that fits counts."""


def group_of(knob: str) -> str:
    """The section of a knob."""
    for name, beginnings in GROUPS.items():
        if knob.startswith(beginnings):
            return name
    return OTHER
