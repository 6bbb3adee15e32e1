"""A camera path in plain numbers, and what about it should make one look twice.

Axes: ``t`` frames. Lengths in scene units, angles in degrees, measured in float64.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.paths.camera_path import CameraPath, require_valid_path

_LARGE_TURN_DEG = 45.0
"""Half the horizontal field of a wide lens: two such frames hardly overlap."""

_JUMP = 8.0
"""A step this many times those around it is a cut, not a move; eased paths stay below 4."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSummary:
    """What a person wants to know before a model runs."""

    frames: int
    seconds: float
    """From the first camera to the last."""
    travel: float
    """Length of the whole way."""
    farthest: float
    """Largest distance from the first camera."""
    largest_step: float
    turn_deg: float
    """All turning added up."""
    largest_turn_deg: float
    """Between two frames."""
    focal_range_px: tuple[float, float]
    size_px: tuple[int, int]
    """(height, width) of the image that the focal lengths are for."""
    warnings: tuple[str, ...]


def summarize(path: CameraPath, near_depth: float | None = None) -> PathSummary:
    """Measure ``path``; with ``near_depth``, also rate its size."""
    require_valid_path(path, "camera path")
    position = path.cameras.position.double()
    steps = (position[1:] - position[:-1]).norm(dim=-1)
    turns = _turns_deg(path.cameras.world_from_camera[:, :3, :3].double())
    farthest = float((position - position[0]).norm(dim=-1).max())
    return PathSummary(
        frames=len(path),
        seconds=float(path.times_s[-1].double() - path.times_s[0].double()),
        travel=float(steps.sum()),
        farthest=farthest,
        largest_step=_largest(steps),
        turn_deg=float(turns.sum()),
        largest_turn_deg=_largest(turns),
        focal_range_px=(float(path.cameras.focal_px.min()), float(path.cameras.focal_px.max())),
        size_px=path.cameras.size_px,
        warnings=(
            *_turn_warning(turns),
            *_jump_warning(steps),
            *_size_warning(farthest, near_depth),
        ),
    )


def _largest(values: Float[Tensor, " t"]) -> float:
    return float(values.max()) if len(values) else 0.0


def _turns_deg(rotations: Float[Tensor, "t 3 3"]) -> Float[Tensor, " s"]:
    """Angles between consecutive rotations; atan2 keeps the small ones, which acos would lose."""
    relative = quaternion.from_matrix(rotations[:-1].mT @ rotations[1:])
    return torch.rad2deg(2 * torch.atan2(relative[:, 1:].norm(dim=-1), relative[:, 0]))


def _turn_warning(turns_deg: Float[Tensor, " s"]) -> list[str]:
    if _largest(turns_deg) <= _LARGE_TURN_DEG:
        return []
    index = int(turns_deg.argmax())
    return [
        f"frame {index + 1}: the camera turns {float(turns_deg[index]):.0f} degrees in one step; "
        "use more frames or a smaller turn"
    ]


def _jump_warning(steps: Float[Tensor, " s"]) -> list[str]:
    if len(steps) < 5:
        return []
    # Two steps on either side, because a move that turns round has no speed in one.
    windows = torch.nn.functional.pad(steps, (2, 2)).unfold(0, 5, 1)
    nearby = windows[:, [0, 1, 3, 4]].amax(-1)
    jumps = (steps > _JUMP * nearby) & (steps > 1e-6 * steps.sum())
    if not bool(jumps.any()):
        return []
    index = int(jumps.int().argmax())
    return [
        f"frame {index + 1}: the camera jumps {float(steps[index]):.3g} units in one step, far "
        "more than before and after; check the poses there"
    ]


def _size_warning(farthest: float, near_depth: float | None) -> list[str]:
    if near_depth is None or farthest <= near_depth:
        return []
    return [
        f"the camera goes {farthest / near_depth:.1f} near depths away from where it starts; "
        "expect to see places that the image does not show"
    ]
