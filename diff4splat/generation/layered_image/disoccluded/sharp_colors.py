"""Colours with which a hidden layer, rendered alone, shows what was inpainted (ours, ADR 53).

    layer ─ Gaussians ─ render in its own camera ─ correction of the colours

Footprints overlap, so Gaussians in the inpainted colours show nine tenths of
the detail. The pixels of the image are matched to the image in the same way (``color_matching``).
"""

from dataclasses import replace

from diff4splat.generation.color_matching import InputView, matched_colors
from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.render.api import UNDILATED, render
from diff4splat.scene.harmonics import color_from_dc

STEPS = 4


def with_sharp_colors(layer: ImageLayer) -> ImageLayer:
    """The layer with colours that blending does not blur; empty layers stay."""
    cells = layer.mask.flatten().nonzero()[:, 0]
    if not len(cells):
        return layer
    gaussians = layer_gaussians(layer)
    # What the layer lets through is no matter of its colours.
    alpha = render(gaussians, layer.camera, outputs=("alpha",), settings=UNDILATED).alpha
    view = InputView(rgb=layer.rgb * alpha[..., None], camera=layer.camera, pixel_index=cells)
    harmonics = matched_colors(gaussians, view, STEPS, settings=UNDILATED)
    rgb = layer.rgb.clone()
    rgb[layer.mask] = color_from_dc(harmonics[:, 0])
    return replace(layer, rgb=rgb)
