"""Write a model with the object masks of two, as one ensemble.

``python -m benchmarks.larger_backbone.ensemble FIRST SECOND --out M``: all other parts are those
of ``FIRST``, the instance vectors those of ``SECOND``.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model, save_model
from diff4splat.models.object_mask.ensemble import ObjectMaskEnsemble


def main() -> None:
    """The model."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first")
    parser.add_argument("second")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    first = load_model(arguments.first)
    second = load_model(arguments.second, parts=("object_mask",))
    for name, model in (("FIRST", first), ("SECOND", second)):
        mask = model.config.object_mask
        if not mask.image_backbone or len(mask.backbone_sizes) > 1:
            parser.error(f"{name}: expected one object mask on an image backbone, got {mask}")
    save_model(ensemble(first, second), arguments.out)


def ensemble(first: Model, second: Model) -> Model:
    """The first model, with both object masks."""
    size = second.config.object_mask.backbone_size
    mask = replace(first.config.object_mask, second_backbone=size)
    config = replace(first.config, object_mask=mask)
    network = create_networks(config, parts=["object_mask"]).object_mask
    _load(network, first, second)
    networks = replace(first.networks, object_mask=network)
    return replace(first, config=config, networks=networks)


def _load(network: ObjectMaskEnsemble, first: Model, second: Model) -> None:
    for member, model in zip(network.members, (first, second), strict=True):
        weights = model.networks.object_mask.state_dict()
        # Only the last member has instance vectors.
        member.load_state_dict({name: weights[name] for name in member.state_dict()})


if __name__ == "__main__":
    main()
