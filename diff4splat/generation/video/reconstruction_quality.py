"""How well a reconstructed scene shows the frames of its video, and those between them.

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.generation.inputs.input_video import InputVideo, VideoChoice, evenly, read_image
from diff4splat.metrics.image import psnr
from diff4splat.outputs.card import BEST_PSNR_DB
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

MOST_FRAMES = 8
"""Of each kind that are rendered, spread evenly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReconstructionQuality:
    """Mean PSNR at the image size of the networks."""

    input_frames_db: float
    other_frames_db: float | None
    """Frames of the same camera that the networks did not see; None if there are none."""
    other_frames: int
    """How many of these were rendered."""


@torch.no_grad()
def measure_quality(
    scene: Scene, video: InputVideo, capture: Capture, choice: VideoChoice
) -> ReconstructionQuality:
    """Of a scene whose path is ``video.full_path``.

    Raises:
        FileFormatError: a frame cannot be read.
    """
    places = evenly(torch.arange(len(video.index)), MOST_FRAMES).tolist()
    times_s = video.path.times_s.tolist()
    seen = [_psnr_db(scene, times_s[place], video.rgb[place]) for place in places]
    others = [
        _psnr_db(scene, float(capture.times_s[number]), read_image(capture, number, choice).rgb)
        for number in evenly(video.other_index, MOST_FRAMES).tolist()
    ]
    return ReconstructionQuality(
        input_frames_db=sum(seen) / len(seen),
        other_frames_db=sum(others) / len(others) if others else None,
        other_frames=len(others),
    )


def _psnr_db(scene: Scene, time_s: float, truth: Float[Tensor, "h w 3"]) -> float:
    """Of the frame of the path at that time."""
    place = int((scene.path.times_s - time_s).abs().argmin())
    view = render(scene, scene.path.cameras[place], float(scene.path.times_s[place]))
    return min(float(psnr(view.rgb.clamp(0, 1), truth)), BEST_PSNR_DB)
