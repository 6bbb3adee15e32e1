"""Write a model whose object shadow starts from its depth prior, to train further.

``python -m benchmarks.object_shadow.start --model small --out start``: the U-Net of the
depth prior knows surfaces and objects; the mask and the object's coordinates, which it has never
seen, count nothing.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from torch import Tensor, nn

from diff4splat.models.config.priors import ObjectShadowConfig
from diff4splat.models.hub.model import Model, load_model, save_model
from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.networks import Networks
from diff4splat.models.object_shadow.network import INPUTS, ObjectShadowNet

COLORS, COORDINATES = 3, 2
"""Channels that both networks see: first and last."""


def main() -> None:
    """The model with one part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", required=True)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    save_model(with_shadow(load_model(arguments.model, parts=("monocular_depth",))), arguments.out)


def with_shadow(model: Model) -> Model:
    """A model with an object shadow alone, as wide as the U-Net of the depth prior."""
    width = model.config.monocular_depth.channels
    network = ObjectShadowNet(width)
    start_from_depth(network, model.networks.monocular_depth)
    return replace(
        model,
        config=replace(model.config, object_shadow=ObjectShadowConfig(width=width)),
        networks=Networks(object_shadow=network),
        trained=frozenset({"object_shadow"}),
    )


def start_from_depth(network: ObjectShadowNet, depth: nn.Module) -> None:
    """Give ``network`` the weights of the depth prior's U-Net; its head stays zero."""
    given = getattr(depth, "unet", depth).state_dict()
    own = network.state_dict()
    for name in own:
        if not name.startswith("head."):
            own[name] = given[name]
    own["input_conv.weight"] = widened(given["input_conv.weight"])
    network.load_state_dict(own)


def widened(weight: Tensor) -> Tensor:
    """The first convolution with zeros for the channels that only the object shadow sees."""
    pixels = FOLDED_PX**2
    wide = weight.new_zeros(weight.shape[0], (INPUTS + COORDINATES) * pixels, *weight.shape[2:])
    wide[:, : COLORS * pixels] = weight[:, : COLORS * pixels]
    wide[:, -COORDINATES * pixels :] = weight[:, -COORDINATES * pixels :]
    return wide


if __name__ == "__main__":
    main()
