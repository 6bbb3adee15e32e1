"""EfficientNet-Lite0 as a classifier of every cell of an image (public weights, ImageNet).

Axes: ``n`` images, ``h w`` pixels, ``k`` classes. The published network averages the last features
over the image, then classifies them; here every cell is classified (class activation maps, arXiv
1512.04150).
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.captions.image_classes.class_nouns import CLASSES
from diff4splat.models.image_backbone.efficientnet_lite import FEATURE_CHANNELS, EfficientNetLite

HEAD_CHANNELS = 1280


class CellClassifier(nn.Module):
    """Logits of ImageNet's classes for cells of 32 pixels."""

    def __init__(self) -> None:
        super().__init__()
        self.backbone = EfficientNetLite()
        self.head = nn.Conv2d(FEATURE_CHANNELS["lite0"][-1], HEAD_CHANNELS, 1)
        self.classes = nn.Conv2d(HEAD_CHANNELS, CLASSES, 1)

    def forward(self, image: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n k hc wc"]:
        """``image`` is RGB in [0, 1], its sides multiples of 32."""
        features = torch.nn.functional.relu6(self.head(self.backbone(image)[-1]))
        return self.classes(features)
