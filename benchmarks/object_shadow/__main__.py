"""How much of a shadow is explained: ``python -m benchmarks.object_shadow CLIPS MODEL``.

``CLIPS`` are of ``prepare synth --without-objects``. Of the squared difference between an image and
the same without one object, away from the object: the share that taking the shadow off explains.

Axes: ``h w`` pixels.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.errors import InputError
from diff4splat.generation.object_shadow.prediction import predicted_darkening
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.hub.model import load_model
from diff4splat.models.protocols import ShadowOfObject
from diff4splat.training.batches.shadows.samples import views_without_object
from diff4splat.training.stages.kinds.object_shadow import grown

LEAST_ERROR = 1e-4
"""Mean squared difference of a pair whose object casts a shadow."""


def main() -> None:
    """A line for all pairs, and one for those with a shadow."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", type=Path)
    parser.add_argument("model")
    arguments = parser.parse_args()
    network = load_model(arguments.model, parts=("object_shadow",)).networks.object_shadow
    before, after = np.array([errors(network, *pair) for pair in pairs(arguments.clips)]).T
    shares = 1 - after[before > LEAST_ERROR] / before[before > LEAST_ERROR]
    print(f"{len(before)} pairs: explained {1 - after.sum() / before.sum():.3f}")
    better = (shares > 0).mean()
    print(f"{len(shares)} with a shadow: mean {shares.mean():.3f}, better {better:.2f}")
    weak = before <= LEAST_ERROR
    print(f"the others: {before[weak].mean():.1e} before, {after[weak].mean():.1e} after")


def pairs(folder: Path) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    """Image, the same without an object, and the object's mask."""
    clips = ClipFolder(folder)
    for index in range(len(clips)):
        clip = clips.clip(index)
        try:
            found = views_without_object(clip)
        except InputError:
            continue
        for view, mask in found:
            yield unit_rgb(clip.views[0].rgb[0]), unit_rgb(clip.views[view].rgb[0]), mask


def errors(
    network: ShadowOfObject, image: Tensor, without: Tensor, mask: Tensor
) -> tuple[float, float]:
    """Mean squared differences before and after, where the object is not."""
    beside = ~grown(mask[None], 1)[0]
    lit = image * predicted_darkening(network, image, mask).exp()
    found = [(one - without).square().mean(-1)[beside].mean() for one in (image, lit)]
    return float(found[0]), float(found[1])


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
