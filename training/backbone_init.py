"""The image backbone's public weights, for parts that start from random ones."""

from collections.abc import Sequence

from diff4splat.errors import ConfigError
from diff4splat.models.image_backbone.public_weights import (
    public_backbone_weights,
    public_classifier_weights,
)
from diff4splat.models.image_backbone.unet import BackboneUNet
from diff4splat.models.image_classifier.network import ImageClassifier
from diff4splat.models.networks import Networks


def start_from_public_backbones(networks: Networks, parts: Sequence[str]) -> None:
    """Fill the backbone of every one of ``parts``, or the classifier.

    Raises:
        ConfigError: a part has no image backbone.
        InputError: the package with the weights is not installed.
    """
    for part in parts:
        network = getattr(networks, part)
        if isinstance(network, ImageClassifier):
            network.cells.load_state_dict(public_classifier_weights())
            continue
        if not isinstance(network, BackboneUNet):
            raise ConfigError(
                f"public_backbone: expected parts on the image backbone, got {part}; set "
                f"model.{part}.image_backbone or leave public_backbone out"
            )
        fill_backbone(network)


def fill_backbone(network: BackboneUNet) -> None:
    """Give the backbone of ``network`` its public weights.

    Raises:
        InputError: the package with the weights is not installed.
    """
    weights = public_backbone_weights(network.backbone.size)
    own = network.backbone.state_dict()
    network.backbone.load_state_dict({name: weights[name] for name in own})
