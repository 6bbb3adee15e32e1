"""The maps of a view that have one value per pixel and are never interpolated."""

from collections.abc import Callable

from torch import Tensor

from diff4splat.data.clip import View

LABELS = ("depth", "instances", "sky", "moving")


def edited_labels(view: View, edit: Callable[[Tensor], Tensor]) -> dict[str, Tensor | None]:
    """Every such map, ``t h w``, edited alike, for ``dataclasses.replace``; absent ones stay so."""
    present = {name: getattr(view, name) for name in LABELS}
    return {name: None if label is None else edit(label) for name, label in present.items()}
