"""Covisibility: the pixels of a target image whose surface is visible in the input.

Axes: ``p`` target images, ``h w`` pixels. The surface point of a pixel, unprojected with its true
depth, is visible in an input frame if it lies in front of the camera, inside the image, and within
``DEPTH_TOLERANCE`` of the true depth there. Sky has no depth and is never covisible.

Static surfaces are tested in all input frames. The position of a moving surface is known at the
target time only, so it is tested in the input frames before and after that time. A surface that
moves farther than its size between them counts as occluded.

Source of the mask: Gao et al., Monocular Dynamic View Synthesis: A Reality Check, NeurIPS 2022
(arXiv 2210.13445). Without true depth, they use forward-backward optical flow and require more than
five input frames, and a tenth of all, that show the pixel. Here one frame is enough.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.evaluation.protocols.protocol import Pair
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.normalise_scale import valid_depth

DEPTH_TOLERANCE = 0.05
"""Largest difference of two depths of one surface, relative to the depth in the input frame."""
STATIC_DISPLACEMENT = 1e-3 * PLANE_DEPTH
"""Largest displacement of a static point in model units: a thousandth of the median depth of the
first frame."""
INSTANCE_COUNT = 256
NO_INSTANCE = 0
"""Instance number of sky and of pixels without an instance."""


def covisible_masks(sample: EvalSample) -> Bool[Tensor, "p h w"] | None:
    """Covisible pixels of every target image; None for clips without depth."""
    if not sample.has_depth:
        return None
    is_static = static_instances(sample.clip)
    return torch.stack([_covisible_mask(sample, pair, is_static) for pair in sample.targets.pairs])


def static_instances(clip: Clip) -> Bool[Tensor, " 256"]:
    """Instance numbers that are static: those with tracked points, none of which moves."""
    is_static = torch.zeros(INSTANCE_COUNT, dtype=torch.bool)
    if clip.tracks is None:
        return is_static
    positions, instances = clip.tracks.positions.double(), clip.tracks.instances.long()
    displacement = (positions - positions[:1]).norm(dim=-1)
    # Written so that NaN counts as moving.
    moves = ~(displacement <= STATIC_DISPLACEMENT).all(0)
    is_static[instances] = True
    is_static[instances[moves]] = False
    is_static[NO_INSTANCE] = False
    return is_static


def _covisible_mask(
    sample: EvalSample, pair: Pair, is_static: Bool[Tensor, " 256"]
) -> Bool[Tensor, "h w"]:
    depth = sample.true_depth(pair).double()
    valid = valid_depth(depth)
    points = unproject(sample.camera(pair).to(torch.float64), depth)
    static_mask = _static_pixels(sample.clip.views[pair[0]], pair[1], is_static)
    neighbours = sample.neighbouring_inputs(pair[1])
    covisible = torch.zeros_like(valid)
    for frame in sample.input_frames:
        visible = visible_in(sample.input_view, frame, points)
        covisible |= visible if frame in neighbours else visible & static_mask
    # A pixel without depth has no surface point.
    return covisible & valid


def _static_pixels(view: View, frame: int, is_static: Bool[Tensor, " 256"]) -> Bool[Tensor, "h w"]:
    """Pixels of static instances; none if the view has no instances."""
    if view.instances is None:
        return torch.zeros(view.cameras.size_px, dtype=torch.bool)
    return is_static[view.instances[frame].long()]


def visible_in(view: View, frame: int, points: Float[Tensor, "h w 3"]) -> Bool[Tensor, "h w"]:
    """World points that are visible in a frame: in front, inside, and at the true depth."""
    height, width = view.cameras.size_px
    flat = project(view.cameras[frame].to(torch.float64), points.flatten(0, 1))
    pixels, z = (part.unflatten(0, (height, width)) for part in flat)
    columns, rows = pixels.floor().unbind(-1)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    # Outside the image, any pixel will do: its value is masked out.
    rows_columns = [torch.where(inside, index, 0.0).long() for index in (rows, columns)]
    depth = view.depth[frame].double()[rows_columns[0], rows_columns[1]]
    # Behind the camera z is negative and equals no depth.
    return inside & valid_depth(depth) & ((z - depth).abs() <= DEPTH_TOLERANCE * depth)
