"""Stage 7: does depth of one frame, moved by the cameras, agree with other frames and with flow?

Depth is compared at gaps of 1, 4 and 8 frames; flow at gap 1, in pixels of the full image. Only
static pixels count, as far as the clip says which those are; the median bears the rest.
"""

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from diff4splat.data.clip import View
from diff4splat.data.consistency.sampling import sample
from diff4splat.data.consistency.static_pixels import static_pixels
from diff4splat.data_prep.curation.working_clip import WorkingClip, reduced_map
from diff4splat.geometry.camera import Camera, project
from diff4splat.geometry.depth import unproject
from diff4splat.geometry.rays import pixel_centers

GAPS = (1, 4, 8)
_MOST_PAIRS = 12
"""Per gap, spread evenly."""


def score_geometry(working: WorkingClip) -> WorkingClip:
    """``reprojection_error``, relative, and ``reprojection_px``; medians."""
    if working.view.depth is None or not bool((working.view.depth > 0).any()):
        return working
    static = static_pixels(working.clip, working.view)
    usable = torch.ones_like(working.view.depth, dtype=torch.bool) if static is None else static
    errors = [
        _depth_errors(working.view, usable, here, here + gap)
        for gap in GAPS
        for here in _spread(working.clip.frames - gap)
    ]
    every = torch.cat([torch.zeros(0, dtype=torch.float64), *errors])
    pixels = _flow_errors(working, usable)
    return working.scored(
        reprojection_error=float(every.median()) if len(every) else None,
        reprojection_px=float(np.median(pixels)) if len(pixels) else None,
    )


def induced_flow(
    cameras: Camera, here: int, depth: Float[Tensor, "h w"]
) -> Float64[np.ndarray, "h w 2"]:
    """Flow to the next frame of what does not move; NaN without depth or behind the camera."""
    camera = cameras[here].to(torch.float64)
    points = unproject(camera, depth.double()).reshape(-1, 3)
    uv, z = project(cameras[here + 1].to(torch.float64), points)
    flow = uv.reshape(*depth.shape, 2) - pixel_centers(camera.size_px, uv)
    known = (depth > 0) & (z.reshape(depth.shape) > 0)
    return torch.where(known[..., None], flow, torch.nan).numpy()


def _depth_errors(view: View, usable: Tensor, here: int, there: int) -> Tensor:
    depth = view.depth[here].double()
    step = max(1, min(depth.shape) // 64)
    chosen = torch.zeros_like(usable[here])
    chosen[::step, ::step] = True
    points = unproject(view.cameras[here], depth)[chosen & usable[here] & (depth > 0)]
    uv, z = project(view.cameras[there], points)
    sampled = sample(torch.where(usable[there], view.depth[there].double(), 0.0), uv)
    return ((z - sampled.depth).abs() / sampled.depth)[sampled.smooth & (z > 0)]


def _flow_errors(working: WorkingClip, usable: Tensor) -> np.ndarray:
    depth = torch.from_numpy(reduced_map(working.view.depth.numpy(), working.size_px))
    static = reduced_map(usable.numpy(), working.size_px)
    errors = []
    for here in _spread(len(working.flows)):
        flow = working.flows[here]
        off = np.linalg.norm(
            flow.forward - induced_flow(working.cameras, here, depth[here]), axis=-1
        )
        errors.append(off[np.isfinite(off) & flow.consistent & static[here]] / working.scale)
    return np.concatenate([np.zeros(0), *errors])


def _spread(count: int) -> list[int]:
    if count < 1:
        return []
    return sorted(
        set(np.linspace(0, count - 1, min(count, _MOST_PAIRS)).round().astype(int).tolist())
    )
