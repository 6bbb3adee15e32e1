"""A short fit of a drawn world, seen from cameras that it does not learn from.

Axes: ``f`` frames, ``h w`` pixels. The reference is the truth, not a longer fit:

    image     RMSE of RGB in [0, 1] to the true frames of the held-out cameras, and the PSNR
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Frame
from diff4splat.error_time.subjects.errors import mean_psnr_db
from diff4splat.error_time.subjects.inputs import WORLDS, Inputs, world_clip
from diff4splat.fitting.fit import fit_scene
from diff4splat.fitting.fit_types import FitRequest
from diff4splat.fitting.settings import FitSettings
from diff4splat.geometry.camera import Camera
from diff4splat.io.pixels import unit_rgb
from diff4splat.render.api import render

VIEWS, HELD_OUT, TIMES, SIDE_PX = 8, 2, 6, 64
Frames = Float[Tensor, "f h w 3"]


@dataclass(frozen=True, slots=True)
class _DrawnFrames:
    """Frames in memory, view by view."""

    rgb: Frames

    def __len__(self) -> int:
        return len(self.rgb)

    def read(self, index: int) -> Frame:
        """One of them."""
        return Frame(rgb=self.rgb[index])


def run(settings: FitSettings, inputs: Inputs) -> Frames:
    """The held-out frames as the fit shows them."""
    del inputs  # one world is fitted
    capture = drawn_capture()
    with TemporaryDirectory() as folder:
        result = fit_scene(FitRequest(capture=capture, settings=settings, folder=Path(folder)))
    shown = []
    with torch.no_grad():
        for index in capture.held_out.nonzero().flatten().tolist():
            state = result.motion.state_at(result.gaussians, float(capture.times_s[index]))
            camera = capture.cameras[index].to(state.means.dtype)
            shown.append(render(state, camera).rgb.clamp(0, 1))
    return torch.stack(shown)


def truth() -> Frames:
    """The same frames as they were drawn."""
    capture = drawn_capture()
    every = capture.held_out.nonzero().flatten().tolist()
    return torch.stack([capture.frames.read(index).rgb for index in every])


def error(frames: Frames, true_frames: Frames) -> float:
    """Root mean square difference."""
    return float((frames - true_frames).square().mean().sqrt())


def more_errors(frames: Frames, true_frames: Frames) -> dict[str, float]:
    """The same in dB."""
    return {"image [dB]": mean_psnr_db(frames, true_frames)}


@cache
def drawn_capture() -> Capture:
    """A world seen by cameras around it, of which the last ones are held out."""
    clip = world_clip(WORLDS[-1], TIMES, VIEWS, SIDE_PX)
    cameras = [view.cameras for view in clip.views]
    count = VIEWS * TIMES
    held_out = torch.arange(count) >= (VIEWS - HELD_OUT) * TIMES
    return Capture(
        name="report",
        source="drawn world",
        cameras=_joined(cameras),
        times_s=clip.times_s.double().repeat(VIEWS),
        camera_index=torch.arange(VIEWS).repeat_interleave(TIMES),
        held_out=held_out,
        frames=_DrawnFrames(torch.cat([unit_rgb(view.rgb) for view in clip.views])),
    )


def _joined(cameras: list[Camera]) -> Camera:
    """One batch of all cameras of all views."""
    return Camera(
        world_from_camera=torch.cat([one.world_from_camera for one in cameras]).double(),
        focal_px=torch.cat([one.focal_px for one in cameras]).double(),
        center_px=torch.cat([one.center_px for one in cameras]).double(),
        size_px=cameras[0].size_px,
    )
