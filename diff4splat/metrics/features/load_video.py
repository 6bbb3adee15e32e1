"""Networks for videos from words on the command line; nothing is ever downloaded.

None         the fixed features, which need no weights
i3d:FILE     I3D: distances of distributions are then FVD and KVD
"""

from pathlib import Path

from diff4splat.errors import ConfigError
from diff4splat.metrics.features.fixed_features import FixedFeatures
from diff4splat.metrics.features.i3d import read_i3d
from diff4splat.metrics.features.protocol import VideoFeatures


def load_video_features(spec: str | None = None) -> VideoFeatures:
    """The features that ``spec`` names.

    Raises:
        ConfigError: not of the form above.
        CheckpointError, FileFormatError: the weights cannot be used.
    """
    if spec is None:
        return FixedFeatures()
    network, colon, file = spec.partition(":")
    if network != "i3d" or not colon or not file:
        raise ConfigError(
            f"--video-features: expected i3d:FILE, got {spec!r}; leave it out for fixed features"
        )
    return read_i3d(Path(file))
