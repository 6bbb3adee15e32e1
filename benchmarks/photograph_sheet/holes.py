"""Holes in photographs, filled by patches, by the network and by both, against the truth.

Run ``python -m benchmarks.photograph_sheet.holes`` (needs the photographs' packages); prints
Markdown. Each photograph loses rounded boxes, as behind an object that moves away. The last row is
what ships: both, at two scales in images of 384 px and more.

    PSNR        of the pixels of the hole: a blur is best
    distance    perceptual distance of the hole and a margin around it
    better      share of the holes whose distance is less than the network's by itself
    detail      mean difference of neighbouring pixels in the hole, over that of the truth
    as drawn    the same of the layer's Gaussians; then with sharp colours
"""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from benchmarks.photograph_sheet.__main__ import SIDE_PX, prepared
from benchmarks.photograph_sheet.sources import PHOTOGRAPHS, Photograph, of_folder
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.disoccluded.patch_texture import with_patch_texture
from diff4splat.generation.layered_image.disoccluded.sharp_colors import with_sharp_colors
from diff4splat.generation.layered_image.disoccluded.static_layer import FOOTPRINT_PX
from diff4splat.generation.layered_image.disoccluded.texture import (
    means_within_objects,
    textured,
)
from diff4splat.generation.layered_image.disoccluded.two_scales import agreeing_scales
from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.inpainting import Inpaint, NetworkInpainting
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.metrics.features.gradient_pyramid import GradientPyramidFeatures
from diff4splat.metrics.image import psnr
from diff4splat.metrics.perceptual import perceptual_distance
from diff4splat.models.hub.model import load_model, with_parts
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.render.api import UNDILATED, render

MODEL, SEED, HOLES = "small", 11, 2
YAWS_DEG = (0.0, 90.0, 180.0, 270.0)
RADII, CENTRES = (0.08, 0.2), (0.3, 0.7)
"""Of the longer side; of the height and width."""
MARGIN_PX = 8
DEPTH = 5.0
Image = Float[Tensor, "h w 3"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hole:
    """A photograph and what is known of it."""

    picture: InputImage
    known: Bool[Tensor, "h w"]

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the hole with a margin."""
        spans = [(~self.known).any(axis).nonzero()[:, 0].tolist() for axis in (1, 0)]
        return tuple(slice(max(span[0] - MARGIN_PX, 0), span[-1] + 1 + MARGIN_PX) for span in spans)

    @property
    def unevenness(self) -> float:
        """Standard deviation of the mean colours in the window."""
        rows, columns = self.window
        means = means_within_objects(self.picture.rgb)[rows, columns]
        return float(means.flatten(0, 1).var(0).sum().sqrt())

    def detail(self, image: Image) -> float:
        """Mean difference of neighbours in a row, in the hole."""
        both = ~self.known[:, 1:] & ~self.known[:, :-1]
        return float(image.diff(dim=1)[both].abs().mean())


def main() -> None:
    """One row of Markdown for each way to fill a hole, of all holes and of the most even third."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photographs", type=Path, help="folder of others than the twelve")
    parser.add_argument("--side", type=int, default=SIDE_PX, help="of the images, in pixels")
    options = parser.parse_args()
    folder = options.photographs
    photographs = PHOTOGRAPHS if folder is None else of_folder(folder)
    model = with_parts(load_model(MODEL), {"image_inpainting"})
    network = NetworkInpainting(network=model.networks.image_inpainting)
    fills = {
        "patches": textured,
        "network": network,
        "both": with_patch_texture(network),
        "both, two scales": with_patch_texture(agreeing_scales(network)),
    }
    cases = list(holes(photographs, options.side))
    found = measured(fills, cases)
    even = torch.tensor([case.unevenness for case in cases]).argsort()[: len(cases) // 3]
    print("| holes | filled by | PSNR [dB] | distance | better | detail | as drawn | sharp |")
    print("|---|---|---:|---:|---:|---:|---:|---:|")
    for holes_name, chosen in (("all", slice(None)), ("most even third", even)):
        for name, values in found.items():
            print(f"| {holes_name} | {name} {row(values[chosen], found['network'][chosen])}")


def row(values: Float[Tensor, "n 5"], network: Float[Tensor, "n 5"]) -> str:
    """Means, and how often the distance is less than the network's."""
    decibel, distance, *detail = values.mean(0).tolist()
    better = float((values[:, 1] < network[:, 1]).float().mean())
    shares = " | ".join(f"{share:.2f}" for share in detail)
    return f"| {decibel:.2f} | {distance:.4f} | {better:.2f} | {shares} |"


def measured(fills: Mapping[str, Inpaint], cases: list[Hole]) -> dict[str, Float[Tensor, "n 5"]]:
    """Of each fill, PSNR, distance and three shares of detail of every hole."""
    return {
        name: torch.stack([_values(fill, case) for case in cases]) for name, fill in fills.items()
    }


def holes(photographs: Sequence[Photograph], side_px: int) -> Iterator[Hole]:
    """Some in every photograph, and in views of panoramas to four sides."""
    generator = torch.Generator().manual_seed(SEED)
    for photograph in photographs:
        for picture in _views(photograph, side_px):
            for _ in range(HOLES):
                yield Hole(picture=picture, known=~_rounded_box(picture, generator))


def _views(photograph: Photograph, side_px: int) -> list[InputImage]:
    if photograph.yaw_deg is None:
        return [prepared(photograph, MODEL, side_px)]
    return [prepared(replace(photograph, yaw_deg=yaw), MODEL, side_px) for yaw in YAWS_DEG]


def _rounded_box(picture: InputImage, generator: torch.Generator) -> Bool[Tensor, "h w"]:
    """At a random place, of random sides."""
    height, width = picture.rgb.shape[:2]
    draws = torch.rand(4, generator=generator)
    radii = (RADII[0] + (RADII[1] - RADII[0]) * draws[:2]) * max(height, width)
    row, column = (CENTRES[0] + (CENTRES[1] - CENTRES[0]) * draws[2:]).tolist()
    down = (torch.arange(height) - row * height)[:, None] / radii[0]
    return down**4 + ((torch.arange(width) - column * width) / radii[1]) ** 4 < 1


def _values(fill: Callable[[Image, Tensor], Image], case: Hole) -> Float[Tensor, " 5"]:
    truth, (rows, columns) = case.picture.rgb, case.window
    found = fill(truth, case.known)
    distance = perceptual_distance(
        found[rows, columns], truth[rows, columns], GradientPyramidFeatures()
    )
    layer = _layer(found, case)
    images = (found, drawn(layer), drawn(with_sharp_colors(layer)))
    shares = [case.detail(image) / max(case.detail(truth), 1e-6) for image in images]
    decibel = psnr(found[~case.known][None], truth[~case.known][None])
    return torch.tensor([float(decibel), float(distance), *shares])


def _layer(rgb: Image, case: Hole) -> ImageLayer:
    """Cells in the hole, as far away as each other."""
    return ImageLayer(
        camera=case.picture.camera,
        rgb=rgb,
        depth=torch.full(case.known.shape, DEPTH),
        mask=~case.known,
        opacity=OPAQUE,
        footprint_px=FOOTPRINT_PX,
    )


def drawn(layer: ImageLayer) -> Image:
    """The layer alone, over nothing."""
    found = render(
        layer_gaussians(layer), layer.camera, outputs=("rgb", "alpha"), settings=UNDILATED
    )
    return found.rgb / found.alpha.clamp_min(1e-6)[..., None]


if __name__ == "__main__":
    main()
