"""Which perceptual distance to use, from one word on the command line or in a recipe.

None                            the stand-in, which needs no weights
vgg:/path                       LPIPS, the lpips package's full state
alex:/trunk.pth,/heads.pth      LPIPS, torchvision's network and lpips' heads
"""

from pathlib import Path

from diff4splat.errors import ConfigError
from diff4splat.metrics.features.backbones import BACKBONES
from diff4splat.metrics.features.gradient_pyramid import GradientPyramidFeatures
from diff4splat.metrics.features.lpips import Lpips
from diff4splat.metrics.features.lpips_weights import read_lpips_weights
from diff4splat.metrics.features.protocol import PerceptualFeatures


def load_features(spec: str | None = None) -> PerceptualFeatures:
    """The distance that ``spec`` names; nothing is ever downloaded.

    Raises:
        ConfigError: not of the form above.
        CheckpointError, FileFormatError: the weights cannot be used.
    """
    if spec is None:
        return GradientPyramidFeatures()
    network, colon, rest = spec.partition(":")
    files = rest.split(",")
    if network not in BACKBONES or not colon or not all(files) or len(files) > 2:
        raise ConfigError(
            f"perceptual features: expected {' or '.join(f'{name}:FILE' for name in BACKBONES)}, "
            f"or two files joined by a comma, got {spec!r}; leave it out for the stand-in"
        )
    backbone = BACKBONES[network]
    return Lpips(backbone, read_lpips_weights([Path(file) for file in files], backbone))
