"""What moves: the probability of every pixel, and the mask that it gives.

Axes: ``hh ww`` pixels of the copy that the networks see.

    image, text ─ object mask ─ probability ─ smoothed, shared within objects ─ mask

Models without an object mask take the probability from the motion U-Net.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.rigid_components import connected_components
from diff4splat.generation.motion.networks import (
    LEAST_PROBABILITY,
    LEAST_SHARE,
    MaskedMotion,
    ObjectMaps,
)
from diff4splat.generation.motion.object_pooling import LOW_SHARE, pooled_by_object
from diff4splat.generation.motion.sampling import MotionRequest, initial_noise
from diff4splat.models.protocols import MotionPrior

WINDOW_PX, SIGMA_PX, COLOR_SIGMA, ROUNDS = 15, 5.0, 0.05, 2
"""Joint bilateral smoothing of probabilities: window and deviations in pixels and colour."""
HYSTERESIS_LOW = 0.1
"""A component of which no pixel is more probable to move is static."""
HYSTERESIS_HIGH = 0.4
"""A component of which no pixel is as probable to move is static, but for the most probable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionProbability:
    """That a pixel moves, and how probable what moves must be."""

    probability: Float[Tensor, "hh ww"]
    least_probability: float = 0.0
    """Of the most probable pixel, for anything to move."""
    least_share: float = 0.0
    """Of the highest probability, for a component to move beside the most probable one."""
    low_share: float = 0.0
    """Of the highest probability, for a pixel to move."""

    def mask(self, threshold: float) -> Bool[Tensor, "hh ww"]:
        """Pixels whose probability is above ``threshold``.

        Where none is, the most probable component moves if it has ``least_probability``: the prompt
        may ask for motion that the image does not suggest. Connected pixels are one component,
        which moves if some of it is probable enough (hysteresis, Canny 1986).
        """
        highest = float(self.probability.max())
        if highest < self.least_probability:
            return torch.zeros_like(self.probability, dtype=torch.bool)
        low = min(threshold, max(highest / 2, HYSTERESIS_LOW))
        low = max(low, self.low_share * highest)
        component = connected_components(self.probability > low)
        best = self.probability.new_zeros(int(component.max()) + 1)
        best = best.scatter_reduce(0, component.flatten(), self.probability.flatten(), "amax")
        needed = min(max(HYSTERESIS_HIGH, self.least_share * highest), highest)
        return (component > 0) & (best >= needed)[component]


def motion_probability(
    network: MotionPrior, image: InputImage, frames: int, request: MotionRequest
) -> MotionProbability:
    """By the object mask where the text names something, else by the motion U-Net.

    It is not sampled: image and text decide.
    """
    rgb = image.rgb.movedim(-1, 0)[None]
    if request.text is not None and isinstance(network, MaskedMotion):
        maps = network.object_maps(rgb, request.text, request.classes)
        return MotionProbability(
            probability=_shared(maps, rgb),
            least_probability=LEAST_PROBABILITY,
            least_share=LEAST_SHARE,
            low_share=0.0 if maps.instances is None else LOW_SHARE,
        )
    noise = initial_noise(image, frames, request.seed)
    _, logits = network.predict_motion_and_mask(rgb, noise, noise.new_ones(1), request.text)
    return MotionProbability(probability=_shared(ObjectMaps(logits=logits), rgb))


def event_of_pixels(
    probabilities: Sequence[MotionProbability], threshold: float
) -> Int[Tensor, "hh ww"]:
    """Number of the event whose mask has the pixel, from 1; 0 where none has.

    Where several have it, it belongs to the one that is surest of it, against its own highest.
    """
    sure = torch.stack([_relative(one, threshold) for one in probabilities])
    highest, number = sure.max(0)
    return torch.where(highest > 0, number + 1, 0)


def _relative(found: MotionProbability, threshold: float) -> Float[Tensor, "hh ww"]:
    """Of the highest probability, 0 outside the mask."""
    highest = found.probability.max()
    return torch.where(found.mask(threshold), found.probability / highest, 0.0)


def _shared(maps: ObjectMaps, rgb: Float[Tensor, "1 3 hh ww"]) -> Float[Tensor, "hh ww"]:
    """Smoothed, and shared among the pixels of one object where these are known."""
    smooth = bilateral_smooth(maps.logits.sigmoid(), rgb)[0]
    return smooth if maps.instances is None else pooled_by_object(smooth, maps.instances[0])


def bilateral_smooth(
    probability: Float[Tensor, "1 hh ww"], rgb: Float[Tensor, "1 3 hh ww"]
) -> Float[Tensor, "1 hh ww"]:
    """Probabilities averaged over near pixels of one colour, so that objects move up to their edge.

    On validation worlds this raises the overlap with what moves from 0.40 to 0.50.
    """
    # Kornia takes a second to load, which static scenes need not wait for.
    from kornia.filters import joint_bilateral_blur

    smooth = probability[:, None]
    for _ in range(ROUNDS):
        smooth = joint_bilateral_blur(smooth, rgb, (WINDOW_PX,) * 2, COLOR_SIGMA, (SIGMA_PX,) * 2)
    return smooth[:, 0]
