"""Write a model to train further: ``python -m benchmarks.larger_backbone --model M --out start``.

``M`` is a model whose depth prior, or other ``--part``, has another backbone.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import get_args

import cv2
import numpy as np
import torch
from jaxtyping import Float

from benchmarks.larger_backbone.fitted_start import start_from
from diff4splat.models.config.priors import BackboneSize
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model, save_model

PARTS = ("monocular_depth", "object_mask")
"""Those on an image backbone."""
PHOTOGRAPHS = (
    *("astronaut", "coffee", "chelsea", "rocket", "camera", "hubble_deep_field"),
    *("immunohistochemistry", "retina", "brick", "grass", "gravel"),
)
"""Of scikit-image."""
SIDES_PX, WINDOWS = (128, 192, 256, 384), 6
"""Of windows, and how many of each side are cut from a photograph."""
INPUT_PX = 128
"""What the network sees of a photograph, whatever the window."""


def main() -> None:
    """The model, one of its parts on another backbone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=PARTS, default=PARTS[0])
    parser.add_argument("--size", choices=get_args(BackboneSize), default="lite2")
    parser.add_argument("--model", required=True)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    model = load_model(arguments.model)
    if getattr(model.config, arguments.part).backbone_size == arguments.size:
        expected = f"--model: expected another backbone than {arguments.size}"
        parser.error(f"{expected}, got it; name one in --size")
    larger, left = with_backbone(model, arguments.part, arguments.size)
    save_model(larger, arguments.out)
    print("left of the variance, finest level first:", *(f"{share:.2f}" for share in left))


def with_backbone(model: Model, part: str, size: BackboneSize) -> tuple[Model, list[float]]:
    """The model with one part on the backbone of ``size``, and what every level misses."""
    config = replace(getattr(model.config, part), backbone_size=size)
    config = replace(model.config, **{part: config})
    larger = getattr(create_networks(config, parts=[part]), part)
    images = torch.from_numpy(np.stack(list(windows()))).movedim(-1, 1) / 255
    left = start_from(getattr(model.networks, part), larger, images)
    networks = replace(model.networks, **{part: larger})
    return replace(model, config=config, networks=networks), left


def windows() -> Iterator[Float[np.ndarray, "h w 3"]]:
    """Windows of photographs at random places, all of one size."""
    import skimage.data

    generator = np.random.default_rng(0)
    for name in PHOTOGRAPHS:
        image = np.atleast_3d(getattr(skimage.data, name)())[..., :3]
        image = np.broadcast_to(image, (*image.shape[:2], 3)).astype(np.float32)
        for side in (one for one in SIDES_PX if one <= min(image.shape[:2])):
            for _ in range(WINDOWS):
                y, x = generator.integers(0, np.array(image.shape[:2]) - side + 1)
                window = np.ascontiguousarray(image[y : y + side, x : x + side])
                yield cv2.resize(window, (INPUT_PX, INPUT_PX), interpolation=cv2.INTER_AREA)


if __name__ == "__main__":
    main()
