"""Checks that every reader makes, with messages that name the file and the line or frame.

Axes: ``t`` poses; ``labels`` name them ("line 7", "frame 3").
"""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.limits import MAX_POSES
from diff4splat.paths.messages import quoted

_ROUNDING = 1e-3
"""What rounded text may do to a rotation; the same as ``rigid.require_rigid`` allows."""


def finite_number(value: object, where: str) -> float:
    """A number out of JSON or a word of a text line.

    Raises:
        FileFormatError: it is neither, or not finite.
    """
    try:
        # JSON's true is an int in Python, but not a number in a camera file.
        number = float("?" if isinstance(value, bool) else value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise FileFormatError(
            f"{where}: expected a number, got {quoted(value)}; repair the file"
        ) from None
    if not math.isfinite(number):
        raise FileFormatError(f"{where}: expected a finite number, got {number}; repair the file")
    return number


def finite_numbers(values: Sequence[object], where: str) -> list[float]:
    """``values`` as finite numbers; see ``finite_number``."""
    return [finite_number(value, where) for value in values]


def require_pose_count(count: int, name: str) -> None:
    """Refuse files without poses, and absurdly long ones.

    Raises:
        FileFormatError: with the count.
    """
    if not 1 <= count <= MAX_POSES:
        raise FileFormatError(
            f"{name}: expected 1 to {MAX_POSES} camera poses, got {count or 'none'}; "
            "check that this is the file you meant"
        )


def exact_poses(
    poses: Float[Tensor, "t 4 4"], labels: Sequence[str], name: str
) -> Float[Tensor, "t 4 4"]:
    """``poses`` with rotations snapped to the nearest exact ones.

    Raises:
        FileFormatError: a pose is no rotation plus translation.
    """
    _require_affine(poses, labels, name)
    _require_rotations(poses[:, :3, :3], labels, name)
    return rigid.from_parts(rigid.nearest_rotation(poses[:, :3, :3]), poses[:, :3, 3])


def checked_path(
    cameras: Camera, times_s: Float[Tensor, " t"], labels: Sequence[str], name: str
) -> CameraPath:
    """A path of cameras whose poses are exact already.

    Raises:
        FileFormatError: a focal length is not above 0, or a time does not increase.
    """
    _require_positive_focal(cameras, labels, name)
    _require_increasing(times_s, labels, name)
    return CameraPath(cameras=cameras, times_s=times_s)


def _first(bad: Tensor) -> int | None:
    return int(bad.int().argmax()) if bool(bad.any()) else None


def _require_affine(poses: Float[Tensor, "t 4 4"], labels: Sequence[str], name: str) -> None:
    last_row = poses[:, 3]
    index = _first((last_row - last_row.new_tensor([0.0, 0.0, 0.0, 1.0])).abs().amax(-1) > 1e-6)
    if index is not None:
        raise FileFormatError(
            f"{name}: {labels[index]}: expected the last matrix row to be 0 0 0 1, got "
            f"{' '.join(f'{value:g}' for value in last_row[index].tolist())}; "
            "perhaps the matrix is transposed"
        )


def _require_rotations(rotations: Float[Tensor, "t 3 3"], labels: Sequence[str], name: str) -> None:
    mirrored = _first(torch.linalg.det(rotations) < 0)
    if mirrored is not None:
        raise FileFormatError(
            f"{name}: {labels[mirrored]}: expected a right-handed rotation (determinant +1), got "
            "determinant -1; one axis is mirrored, flip it in the file"
        )
    identity = torch.eye(3, dtype=rotations.dtype, device=rotations.device)
    deviation = (rotations @ rotations.mT - identity).abs().amax((-2, -1))
    # Written so that an overflow to NaN counts as bad.
    bent = _first(~(deviation <= _ROUNDING))
    if bent is not None:
        raise FileFormatError(
            f"{name}: {labels[bent]}: expected a rotation without scale or shear (deviation up to "
            f"{_ROUNDING:g}), got a deviation of {float(deviation[bent]):.2g}; repair the pose"
        )


def _require_positive_focal(cameras: Camera, labels: Sequence[str], name: str) -> None:
    index = _first((cameras.focal_px <= 0).any(-1))
    if index is not None:
        raise FileFormatError(
            f"{name}: {labels[index]}: expected focal lengths above 0, got "
            f"{float(cameras.focal_px[index].min()):g} px; repair the intrinsics"
        )


def _require_increasing(times_s: Float[Tensor, " t"], labels: Sequence[str], name: str) -> None:
    index = _first(times_s.diff() <= 0)
    if index is not None:
        raise FileFormatError(
            f"{name}: {labels[index + 1]}: expected finite times that increase from frame to "
            f"frame, got {float(times_s[index + 1]):.9g} s after {float(times_s[index]):.9g} s; "
            "remove repeated frames and put the rest in order"
        )
