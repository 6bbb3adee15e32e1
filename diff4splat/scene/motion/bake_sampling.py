"""Any motion, sampled at key times, and key frames held against it at the times between.

Axes: ``m`` moving Gaussians. A key is what carries the canonical state to the state at its time:

    offset = mean_t − mean     rotation = quat⁻¹ ⊗ quat_t     log-scale offset = ln(scale_t / scale)
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.bake_error import BakeError, compare
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion

_PROBES = 5
"""Times per gap at which the error is looked at, at least."""
_PROBES_OF_ALL = 32
"""Times over the whole range at which it is looked at, at least."""

Interpolation = Literal["linear", "cubic"]
Key = tuple[Tensor, Tensor, Tensor]
"""Offset, rotation and log-scale offset of all moving Gaussians at one time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampler:
    """The moving Gaussians alone, how they move, and who looks at them."""

    gaussians: Gaussians
    motion: Motion
    """Of the moving Gaussians alone."""
    cameras: Camera
    """A batch."""
    moving_index: Int[Tensor, " m"]
    """Which they are among all."""
    interpolation: Interpolation

    def kinks_s(self) -> list[float]:
        """Times at which the motion has a kink: a key belongs there before anywhere else."""
        if isinstance(self.motion, HexPlaneMotion):
            return self.rounded(self.motion.planes.node_times_s)
        if isinstance(self.motion, KeyframeMotion):
            return self.rounded(self.motion.key_times_s.tolist())
        return []

    def rounded(self, times_s: Iterable[float]) -> list[float]:
        """Times as the key frames hold them, in order and each once."""
        held = torch.tensor(sorted(times_s), dtype=self.gaussians.means.dtype)
        return [float(time_s) for time_s in held.unique()]

    def even_times(self, count: int) -> list[float]:
        """``count`` times from the first to the last of the motion; fewer in an empty range."""
        start, stop = self.motion.time_range_s
        return self.rounded(torch.linspace(start, stop, count, dtype=torch.float64).tolist())

    def key_at(self, time_s: float) -> Key:
        """The key at one time.

        Raises:
            InputError: the state is not finite.
        """
        still, moved = self.gaussians, self.motion.state_at(self.gaussians, time_s)
        tiny = torch.finfo(still.scales.dtype).tiny
        back = quaternion.conjugate(quaternion.normalize(still.quats))
        key = (
            moved.means - still.means,
            quaternion.multiply(back, quaternion.normalize(moved.quats)),
            moved.scales.clamp_min(tiny).log() - still.scales.clamp_min(tiny).log(),
        )
        if not all(bool(torch.isfinite(part).all()) for part in key):
            raise InputError(f"bake: expected finite Gaussians at {time_s} s, got NaN or infinity")
        return key

    def keyed(self, keys: Mapping[float, Key]) -> KeyframeMotion:
        """Key frames of the moving Gaussians alone."""
        times = sorted(keys)
        offsets, rotations, stretches = zip(*(keys[time_s] for time_s in times), strict=True)
        return KeyframeMotion(
            key_times_s=offsets[0].new_tensor(times),
            moving_index=torch.arange(len(self.gaussians), device=self.moving_index.device),
            offsets=torch.stack(offsets),
            rotations=torch.stack(rotations),
            log_scale_offsets=torch.stack(stretches),
            interpolation=self.interpolation,
        )

    def placed(self, baked: KeyframeMotion) -> KeyframeMotion:
        """The same key frames, of the moving ones among all Gaussians."""
        return replace(baked, moving_index=self.moving_index)

    def probe(self, baked: KeyframeMotion, gap: tuple[float, float]) -> dict[float, BakeError]:
        """Errors at times inside a gap: evenly, with one in the middle, and at all kinks."""
        start, stop = self.motion.time_range_s
        part = (gap[1] - gap[0]) / (stop - start) if stop > start else 0.0
        count = max(_PROBES, int(part * _PROBES_OF_ALL)) | 1
        times = [gap[0] + (gap[1] - gap[0]) * (k + 1) / (count + 1) for k in range(count)]
        times += [time_s for time_s in self.kinks_s() if gap[0] < time_s < gap[1]]
        return {time_s: self._error_at(baked, time_s) for time_s in times}

    def _error_at(self, baked: KeyframeMotion, time_s: float) -> BakeError:
        exact = self.motion.state_at(self.gaussians, time_s)
        made = baked.state_at(self.gaussians, time_s)
        return compare(self.gaussians, exact, made, self.cameras)


def sampler(
    gaussians: Gaussians, motion: Motion, cameras: Camera, interpolation: Interpolation
) -> Sampler:
    """Of one camera or a batch."""
    index = motion.moving_index
    moves = torch.zeros(len(gaussians), dtype=torch.bool, device=gaussians.means.device)
    moves[index] = True
    return Sampler(
        gaussians=gaussians.select(moves),
        motion=motion.select(moves),
        cameras=cameras if cameras.batch_shape else _batched(cameras),
        moving_index=index,
        interpolation=interpolation,
    )


def _batched(camera: Camera) -> Camera:
    return replace(
        camera,
        focal_px=camera.focal_px[None],
        center_px=camera.center_px[None],
        world_from_camera=camera.world_from_camera[None],
    )
