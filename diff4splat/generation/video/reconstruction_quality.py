"""How well a reconstructed scene shows the frames of its video, and those between them.

Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import torch

from diff4splat.data.capture.capture import Capture
from diff4splat.generation.inputs.input_video import InputVideo, VideoChoice, read_image
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
    others = _spread(video.other_index.tolist())
    values = [_psnr_db(scene, capture, number, choice) for number in others]
    seen = [_psnr_db(scene, capture, number, choice) for number in _spread(video.index.tolist())]
    return ReconstructionQuality(
        input_frames_db=sum(seen) / len(seen),
        other_frames_db=sum(values) / len(values) if values else None,
        other_frames=len(values),
    )


def _psnr_db(scene: Scene, capture: Capture, number: int, choice: VideoChoice) -> float:
    """Of one frame, by its time."""
    time_s = float(capture.times_s[number])
    place = int((scene.path.times_s - time_s).abs().argmin())
    view = render(scene, scene.path.cameras[place], float(scene.path.times_s[place]))
    truth = read_image(capture, number, choice).rgb
    return min(float(psnr(view.rgb.clamp(0, 1), truth)), BEST_PSNR_DB)


def _spread(numbers: list[int]) -> list[int]:
    """At most MOST_FRAMES of them, evenly."""
    count = min(len(numbers), MOST_FRAMES)
    places = torch.linspace(0, len(numbers) - 1, count).round().long().tolist() if count else []
    return [numbers[place] for place in places]
