"""Reads a clip otherwise, one usual mistake undone at a time: which of them explains the errors?"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.data_prep.doctor.comparisons import COMPARISONS, measured
from diff4splat.data_prep.doctor.matches import Matches
from diff4splat.geometry import rigid
from diff4splat.geometry.rays import pixel_centers

LIMITS = {each.name: each.limit for each in COMPARISONS}
_BETTER = 3.0
"""Times that a failed comparison must improve before a cause is named."""
Edit = Callable[[View], View]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """A mistake, and the comparisons with it undone."""

    text: str
    errors: dict[str, float | None]


def failed(errors: dict[str, float | None]) -> list[str]:
    """Names of the comparisons beyond their limits."""
    return [name for name, value in errors.items() if value is not None and value > LIMITS[name]]


def likely_cause(
    clip: Clip, matches: Matches | None, errors: dict[str, float | None]
) -> Cause | None:
    """The mistake whose correction mends most; None where none mends anything."""
    wrong = failed(errors)
    if not wrong:
        return None
    tried = [
        Cause(text=text, errors=measured(_edited(clip, edit), matches))
        for text, edit in mistakes().items()
    ]
    helpful = [cause for cause in tried if _mended(cause, errors, wrong)]
    return min(helpful, key=lambda cause: _badness(cause, wrong), default=None)


def _mended(cause: Cause, errors: dict[str, float | None], wrong: list[str]) -> bool:
    """One failed comparison is much better, and no other fails that passed."""
    better = [
        n for n in wrong if cause.errors[n] is not None and cause.errors[n] * _BETTER < errors[n]
    ]
    return bool(better) and set(failed(cause.errors)) <= set(wrong)


def _badness(cause: Cause, wrong: list[str]) -> tuple[int, float]:
    values = [cause.errors[name] for name in wrong]
    ratios = [100.0 if v is None else v / LIMITS[n] for n, v in zip(wrong, values, strict=True)]
    return len(failed(cause.errors)), sum(ratios)


def _edited(clip: Clip, edit: Edit) -> Clip:
    return replace(clip, views=tuple(edit(view) for view in clip.views))


def mistakes() -> dict[str, Edit]:
    """Corrections by the mistake that they undo."""
    units = {
        f"depth is {_times(factor)}: look at its unit": _scaled(1 / factor)
        for factor in (1e-3, 1e-2, 0.1, 10.0, 100.0, 1000.0, 1e4)
    }
    return {
        "poses are inverted: world to camera was taken for camera to world": _posed(rigid.invert),
        "axes are swapped: OpenGL cameras (y up, z back) were taken for OpenCV's": _posed(_opengl),
        "axes are swapped: NED cameras (x forward, y right) were taken for OpenCV's": _posed(_ned),
        "rotations are transposed": _posed(_transposed),
        **units,
        "depth is the length of rays, not z": _from_rays,
        "pixel centres are half a pixel too far left and up": _shifted(0.5),
        "pixel centres are half a pixel too far right and down": _shifted(-0.5),
        "images are one frame late against the poses": _late(-1),
        "images are one frame early against the poses": _late(1),
        "flow is swapped: y stands before x": _flowed(lambda flow: flow.flip(-1)),
        "flow is backwards": _flowed(lambda flow: -flow),
        "flow is twice as long: values of a finer grid": _flowed(lambda flow: flow / 2),
        "flow is half as long: values of a coarser grid": _flowed(lambda flow: flow * 2),
        "focal lengths are halved, as of an image of half the size": _zoomed(2.0),
        "focal lengths are doubled, as of an image of twice the size": _zoomed(0.5),
    }


def _times(factor: float) -> str:
    return f"{factor:g} times too large" if factor > 1 else f"{1 / factor:g} times too small"


def _posed(change: Callable[[Tensor], Tensor]) -> Edit:
    return lambda view: replace(
        view, cameras=view.cameras.with_pose(change(view.cameras.world_from_camera))
    )


def _opengl(poses: Tensor) -> Tensor:
    return poses @ torch.diag(poses.new_tensor([1.0, -1, -1, 1]))


def _ned(poses: Tensor) -> Tensor:
    axes = poses.new_tensor([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    return poses @ axes


def _transposed(poses: Tensor) -> Tensor:
    return rigid.from_parts(poses[..., :3, :3].mT, poses[..., :3, 3])


def _scaled(factor: float) -> Edit:
    return lambda view: replace(
        view, depth=None if view.depth is None else (view.depth * factor).float()
    )


def _from_rays(view: View) -> View:
    if view.depth is None:
        return view
    camera = view.cameras
    centers = pixel_centers(camera.size_px, camera.focal_px)
    flat = (centers - camera.center_px[:, None, None]) / camera.focal_px[:, None, None]
    length = (flat.square().sum(-1) + 1).sqrt()
    return replace(view, depth=(view.depth / length).float())


def _shifted(offset_px: float) -> Edit:
    return lambda view: replace(
        view, cameras=replace(view.cameras, center_px=view.cameras.center_px + offset_px)
    )


def _zoomed(factor: float) -> Edit:
    return lambda view: replace(
        view, cameras=replace(view.cameras, focal_px=view.cameras.focal_px * factor)
    )


def _late(frames: int) -> Edit:
    def edit(view: View) -> View:
        count = len(view.cameras)
        return replace(
            view, cameras=view.cameras[(torch.arange(count) + frames).clamp(0, count - 1)]
        )

    return edit


def _flowed(change: Callable[[Tensor], Tensor]) -> Edit:
    def edit(view: View) -> View:
        if view.flow is None:
            return view
        return replace(view, flow=replace(view.flow, to_next=change(view.flow.to_next)))

    return edit
