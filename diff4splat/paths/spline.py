"""Cameras between key frames.

Axes: ``k`` keys, ``n`` requested times, ``c`` components. Positions follow the natural cubic spline
in time (twice continuously differentiable, no bending at the ends), rotations slerp, focal lengths
blend in the logarithm (a zoom at constant speed), principal points blend linearly. With knots of
distance h_i, slopes d_i and bending M_i (second derivatives), the spline solves (de Boor,
"A Practical Guide to Splines", ch. IV):

    h_{i-1} M_{i-1} + 2 (h_{i-1} + h_i) M_i + h_i M_{i+1} = 6 (d_i - d_{i-1}),    M_0 = M_last = 0
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.geometry import quaternion, rigid
from diff4splat.paths.camera_path import CameraPath, require_valid_path
from diff4splat.paths.limits import require_frames

_SWEEPS = 60
"""Each Jacobi sweep halves the error whatever the spacing, because the diagonal is twice the sum of
its neighbours: 60 reach the last bit, for a hundred thousand keys at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Bracket:
    """The keys around each requested time."""

    lower: Int[Tensor, " n"]
    upper: Int[Tensor, " n"]
    weight: Float[Tensor, " n"]
    """Of the upper key, in [0, 1]."""
    gap_s: Float[Tensor, " n"]


def interpolate_keyframes(path: CameraPath, times_s: Float[Tensor, " n"]) -> CameraPath:
    """The cameras of ``path`` at other times; beyond the first and last key they are static.

    Raises:
        InputError: the key frames are not usable, or a requested time is not finite.
    """
    require_valid_path(path, "key frames")
    if not bool(torch.isfinite(times_s).all()):
        raise InputError("key frames: expected finite times to interpolate at, got NaN or infinity")
    keys = path.cameras.to(torch.float64)
    at = _bracket(path.times_s.double(), times_s.double())
    rotations = quaternion.from_matrix(keys.world_from_camera[:, :3, :3])
    rotation = quaternion.slerp(rotations[at.lower], rotations[at.upper], at.weight)
    position = _cubic(path.times_s.double(), keys.position, at)
    pose = rigid.from_parts(quaternion.to_matrix(rotation), position)
    cameras = replace(
        keys,
        world_from_camera=pose,
        focal_px=_linear(keys.focal_px.log(), at).exp(),
        center_px=_linear(keys.center_px, at),
    )
    return CameraPath(cameras=cameras.to(path.cameras.focal_px.dtype), times_s=times_s)


def resample(path: CameraPath, frames: int, fps: float) -> CameraPath:
    """``frames`` cameras spread evenly over the whole of ``path``, played at ``fps`` from time 0.

    Raises:
        InputError: as ``interpolate_keyframes``, or the frame count or rate makes no film.
    """
    require_frames(frames, fps)
    require_valid_path(path, "key frames")
    first, last = path.times_s.double()[[0, -1]]
    share = torch.linspace(0, 1, frames, dtype=torch.float64, device=path.times_s.device)
    exact = replace(path, cameras=path.cameras.to(torch.float64), times_s=path.times_s.double())
    between = interpolate_keyframes(exact, torch.lerp(first, last, share))
    times_s = torch.arange(frames, dtype=torch.float64) / fps
    cameras = between.cameras.to(path.cameras.focal_px.dtype)
    return require_valid_path(
        CameraPath(cameras=cameras, times_s=times_s.to(path.times_s)), "resampled path"
    )


def _bracket(keys_s: Float[Tensor, " k"], times_s: Float[Tensor, " n"]) -> _Bracket:
    last = len(keys_s) - 1
    lower = (torch.searchsorted(keys_s, times_s, right=True) - 1).clamp(0, max(last - 1, 0))
    upper = (lower + 1).clamp(max=last)
    # A lone key brackets itself; the gap then only has to be other than zero.
    gap = keys_s[upper] - keys_s[lower] if last else torch.ones_like(times_s)
    return _Bracket(
        lower=lower, upper=upper, gap_s=gap, weight=((times_s - keys_s[lower]) / gap).clamp(0, 1)
    )


def _linear(values: Float[Tensor, "k c"], at: _Bracket) -> Float[Tensor, "n c"]:
    return torch.lerp(values[at.lower], values[at.upper], at.weight[:, None])


def _cubic(
    keys_s: Float[Tensor, " k"], values: Float[Tensor, "k c"], at: _Bracket
) -> Float[Tensor, "n c"]:
    bending = _bending(keys_s, values)
    upper, lower = at.weight[:, None], 1 - at.weight[:, None]
    bend = (lower**3 - lower) * bending[at.lower] + (upper**3 - upper) * bending[at.upper]
    return (
        lower * values[at.lower] + upper * values[at.upper] + bend * at.gap_s[:, None].square() / 6
    )


def _bending(keys_s: Float[Tensor, " k"], values: Float[Tensor, "k c"]) -> Float[Tensor, "k c"]:
    """Second derivatives of the natural spline at its keys."""
    if len(keys_s) < 3:
        return torch.zeros_like(values)
    gap = keys_s.diff()[:, None]
    slope = values.diff(dim=0) / gap
    before, after = gap[:-1], gap[1:]
    right_side = 6 * slope.diff(dim=0)
    end = torch.zeros_like(values[:1])
    bending = torch.zeros_like(values)
    for _ in range(_SWEEPS):
        inner = (right_side - before * bending[:-2] - after * bending[2:]) / (2 * (before + after))
        bending = torch.cat([end, inner, end])
    return bending
