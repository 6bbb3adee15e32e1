"""An image as a depth network takes it: size, channel order, normalisation."""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.models.depth_priors.contracts import DepthContract
from diff4splat.models.depth_priors.graph_facts import TensorFacts

MOST_SIDE_PX = 4096
"""Of an input that a graph may ask for."""


def input_size(
    contract: DepthContract, image: TensorFacts, size_px: tuple[int, int]
) -> tuple[int, int]:
    """(height, width) that the network gets for an image of ``size_px``.

    A side that the graph fixes is taken; else the shape is kept, one side is about the contract's,
    whichever takes the smaller change, and both are multiples of its patch (as image processors of
    DPT do).

    Raises:
        FileFormatError: the graph asks for sides that are no image.
    """
    fixed = image.shape[-2:]
    scale = min((contract.side_px / side for side in size_px), key=lambda scale: abs(1 - scale))
    chosen = []
    for side, given in zip(size_px, fixed, strict=True):
        if given is not None:
            chosen.append(given)
        elif contract.square:
            chosen.append(contract.side_px)
        else:
            multiple = contract.multiple_px
            chosen.append(max(round(scale * side / multiple), 1) * multiple)
    if max(chosen) > MOST_SIDE_PX:
        raise FileFormatError(
            f"depth network: expected an input of at most {MOST_SIDE_PX} pixels a side, got "
            f"{chosen[1]}×{chosen[0]}; export it for a smaller one, or crop the image"
        )
    return chosen[0], chosen[1]


def network_input(
    contract: DepthContract, image: TensorFacts, rgb: Float[Tensor, "h w 3"]
) -> Float[Tensor, "*b 3 h2 w2"]:
    """RGB in [0, 1] resized (bicubic, averaging where it shrinks) and normalised; RGB order."""
    size = input_size(contract, image, (rgb.shape[0], rgb.shape[1]))
    pixels = torch.nn.functional.interpolate(
        rgb.movedim(-1, 0)[None].float(), size, mode="bicubic", align_corners=False, antialias=True
    ).clamp(0, 1)
    mean, std = (torch.tensor(row)[:, None, None] for row in (contract.mean, contract.std))
    pixels = (pixels - mean) / std
    pixels = pixels[None] if len(image.shape) == 5 else pixels
    return pixels.half() if image.dtype == "float16" else pixels
