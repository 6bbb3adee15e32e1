"""The project's fixed feature network: filters that nothing was trained for, on four scales.

Axes: ``n`` videos, ``t`` frames, ``c`` opponent colours, ``o`` directions, ``h w`` pixels. RGB in
[0, 1]. Two layers of the perceptual stand-in (oriented edges, rectified, pooled), then statistics:

    per scale and (c o)   mean and deviation of edges over pixels; mean of the edges of the
                          difference to the next frame: what moves, and in which pattern
    per colour            mean and deviation over pixels of the coarsest scale

averaged over frames. It never changes with the weights of a model, so numbers of different releases
can be compared; they are not those of I3D, and distances with it are no FVD.
"""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.metrics.checks import no_autocast, promote
from diff4splat.metrics.features.gradient_pyramid import edges, opponent, pyramid

GAIN = 20.0
"""Brings edges, of about 0.05, to the size at which the cubic kernel sees more than their mean."""
BATCH = 16
"""Frames at once: memory does not grow with the number of videos."""


class FixedFeatures:
    """``VideoFeatures`` and ``ImageFeatures`` without weights."""

    @property
    def name(self) -> str:
        """Says what it is, and what it is not."""
        return "fixed features: oriented edges over space and time, not I3D or CLIP"

    @torch.no_grad()
    def embed_videos(self, videos: Float[Tensor, "n t 3 h w"]) -> Float[Tensor, "n d"]:
        """Statistics of frames and of their differences; any size and number of frames."""
        (videos,) = promote(videos)
        return torch.stack([_video_statistics(video) for video in videos])

    @torch.no_grad()
    def embed_images(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n d"]:
        """Statistics of single images."""
        (images,) = promote(images)
        return _batched(_image_statistics, images)


def _video_statistics(video: Tensor) -> Tensor:
    frames = _batched(_image_statistics, video).mean(0)
    if len(video) < 2:
        return torch.cat([frames, torch.zeros_like(_change_statistics(video[:1]))[0]])
    return torch.cat([frames, _batched(_change_statistics, video.diff(dim=0)).mean(0)])


def _image_statistics(images: Tensor) -> Tensor:
    with no_autocast(images):
        scales = pyramid(opponent(images))
        parts = [part for colors in scales for part in _moments(GAIN * edges(colors))]
    return torch.cat([*parts, *_moments(scales[-1])], 1)


def _change_statistics(changes: Tensor) -> Tensor:
    with no_autocast(changes):
        scales = pyramid(opponent(changes))
        return torch.cat([GAIN * edges(colors).mean((-2, -1)) for colors in scales], 1)


def _moments(maps: Tensor) -> tuple[Tensor, Tensor]:
    return maps.mean((-2, -1)), maps.std((-2, -1), correction=0)


def _batched(statistics: Callable[[Tensor], Tensor], images: Tensor) -> Tensor:
    return torch.cat([statistics(part) for part in images.split(BATCH)])
