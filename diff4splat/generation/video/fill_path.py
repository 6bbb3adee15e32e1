"""The cameras of a path at which the video model fills: its key frames see most of what is hidden.

Axes: ``k`` cameras along the path, ``h w`` pixels. LDRM makes Gaussians of key frames alone. Key
frames spread evenly over a path may all show what the image shows: an arc is back at its start in
its middle and at its end. So the key frames are chosen one after another: each sees the most hidden
pixels that those before do not. Frames between them are spread evenly.
"""

import torch

from diff4splat.generation.inputs.input_cameras import resample_to_model_frames
from diff4splat.generation.layered_image.types import LayeredImage
from diff4splat.generation.layered_image.visibility import visible_in_earlier_frame
from diff4splat.generation.video.render_condition import RenderedImage, render_layered_image
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.spline import interpolate_keyframes

CANDIDATES = 17
"""Cameras that are compared."""
LEAST_SHARE = 1e-3
"""Share of a frame below which it counts as showing nothing hidden."""


def fill_path(image: LayeredImage, path: CameraPath) -> CameraPath | None:
    """As many cameras of ``path`` as it has, in the order of time; None if it hides nothing."""
    candidates = resample_to_model_frames(path, CANDIDATES)
    rendered = render_layered_image(image, candidates, candidates.times_s)
    keys = most_hidden(rendered, candidates, (len(path) - 1) // TIME_STRIDE)
    if not keys:
        return None
    return _through(candidates, [0, *keys])


def most_hidden(rendered: RenderedImage, path: CameraPath, count: int) -> list[int]:
    """``count`` frames that together see most of what is hidden; none if nothing is.

    Frames that add nothing are the last ones of the path that are left.
    """
    least = LEAST_SHARE * rendered.valid[0].numel()
    chosen: list[int] = []
    while len(chosen) < count:
        gains = [_new_pixels(rendered, path, chosen, frame) for frame in range(len(path))]
        best = max(range(len(path)), key=gains.__getitem__)
        if gains[best] <= least:
            break
        chosen.append(best)
    left = [frame for frame in range(len(path) - 1, 0, -1) if frame not in chosen]
    return sorted(chosen + left[: count - len(chosen)]) if chosen else []


def _new_pixels(rendered: RenderedImage, path: CameraPath, chosen: list[int], frame: int) -> int:
    """Hidden pixels of a frame that none of the chosen frames shows."""
    if frame in chosen:
        return 0
    order = torch.tensor([*chosen, frame])
    hidden, depth = ~rendered.valid[order], rendered.surface_depth[order]
    known = depth.where(depth > 0, torch.inf)
    shown = visible_in_earlier_frame(known, path.cameras[order], hidden)
    return int((hidden[-1] & ~shown[-1]).sum())


def _through(path: CameraPath, keys: list[int]) -> CameraPath:
    """Cameras of ``path`` from key frame to key frame, four steps each."""
    times_s = path.times_s.double()[keys]
    steps = torch.linspace(0, 1, TIME_STRIDE + 1, dtype=torch.float64, device=times_s.device)
    between = torch.lerp(times_s[:-1, None], times_s[1:, None], steps[1:]).flatten()
    every = torch.cat([times_s[:1], between]).to(path.times_s)
    return interpolate_keyframes(path, every)
