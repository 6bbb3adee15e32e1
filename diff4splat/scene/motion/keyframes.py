"""Motion sampled at key times: offsets, rotations and log-scale offsets of the moving Gaussians.

Axes: ``t`` key times, ``m`` moving Gaussians (a subset of all ``n``), 3 or 4 components.
Between keys positions follow a line or a cubic Hermite curve, rotations slerp, log-scales a line;
outside the keys the nearest key holds. Deformation (Diff4Splat, arXiv 2511.00503, §3.2):

    mean_t = mean_0 + offset_t
    quat_t = quat_0 ⊗ rotation_t
    scale_t = scale_0 · exp(log_scale_offset_t)
"""

from dataclasses import dataclass, fields, replace
from typing import Literal

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry import quaternion
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.times import require_time_s


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyframeMotion:
    """Key-framed deformation of the Gaussians at ``moving_index``; all others are static."""

    key_times_s: Float[Tensor, " t"]
    moving_index: Int[Tensor, " m"]
    offsets: Float[Tensor, "t m 3"]
    rotations: Float[Tensor, "t m 4"]
    log_scale_offsets: Float[Tensor, "t m 3"]
    interpolation: Literal["linear", "cubic"] = "linear"

    def __post_init__(self) -> None:
        lead = (*self.key_times_s.shape, *self.moving_index.shape)
        want = {"offsets": (*lead, 3), "rotations": (*lead, 4), "log_scale_offsets": (*lead, 3)}
        for name, shape in want.items():
            got = tuple(getattr(self, name).shape)
            if got != shape:
                raise ShapeError(f"KeyframeMotion.{name}: expected {shape}, got {got}")
        if len(self.key_times_s) == 0 or bool((self.key_times_s.diff() <= 0).any()):
            raise ShapeError(
                "KeyframeMotion.key_times_s: expected at least one time, strictly increasing"
            )
        if bool((self.moving_index.diff() <= 0).any()):
            raise ShapeError(
                "KeyframeMotion.moving_index: expected indices that strictly increase, got repeats "
                "or another order"
            )

    @property
    def time_range_s(self) -> tuple[float, float]:
        """First and last key time."""
        return float(self.key_times_s[0]), float(self.key_times_s[-1])

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        """The Gaussians at ``time_s``; static ones are passed through untouched."""
        require_time_s(time_s)
        if len(self.moving_index) == 0:
            return gaussians
        lower, weight = self._bracket(time_s)
        index = self.moving_index
        offset = self._offset(lower, weight)
        rotation = self._blend(self.rotations, lower, weight, slerp=True)
        # A zero quaternion means no rotation, and must still be turned by the motion.
        canonical = quaternion.normalize(gaussians.quats[index])
        stretch = self._blend(self.log_scale_offsets, lower, weight).exp()
        return replace(
            gaussians,
            means=gaussians.means.index_add(0, index, offset),
            quats=gaussians.quats.index_copy(0, index, quaternion.multiply(canonical, rotation)),
            scales=gaussians.scales.index_copy(0, index, gaussians.scales[index] * stretch),
        )

    def select(self, keep: Bool[Tensor, " n"]) -> "KeyframeMotion":
        """Keep the moving Gaussians where ``keep`` is true, with indices into the smaller set."""
        survives = keep[self.moving_index]
        new_index = keep.long().cumsum(0)[self.moving_index[survives]] - 1
        return replace(
            self,
            moving_index=new_index,
            offsets=self.offsets[:, survives],
            rotations=self.rotations[:, survives],
            log_scale_offsets=self.log_scale_offsets[:, survives],
        )

    def to(self, target: torch.device | torch.dtype) -> "KeyframeMotion":
        """Move every tensor; a dtype casts the floating-point ones."""
        tensors = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "interpolation"}
        cast = isinstance(target, torch.dtype)
        return replace(
            self,
            **{
                k: v if cast and not v.is_floating_point() else v.to(target)
                for k, v in tensors.items()
            },
        )

    def _bracket(self, time_s: float) -> tuple[int, Tensor]:
        """Index of the key at or before ``time_s`` and the weight of the next one, in [0, 1]."""
        times = self.key_times_s
        if len(times) == 1:
            return 0, times.new_zeros(())
        lower = int(torch.searchsorted(times, times.new_tensor(time_s), right=True)) - 1
        lower = min(max(lower, 0), len(times) - 2)
        return lower, ((time_s - times[lower]) / (times[lower + 1] - times[lower])).clamp(0, 1)

    def _blend(self, keys: Tensor, lower: int, weight: Tensor, slerp: bool = False) -> Tensor:
        upper = min(lower + 1, len(keys) - 1)
        if slerp:
            return quaternion.slerp(keys[lower], keys[upper], weight.expand(keys.shape[1]))
        return torch.lerp(keys[lower], keys[upper], weight)

    def _offset(self, lower: int, weight: Tensor) -> Float[Tensor, "m 3"]:
        if self.interpolation == "linear" or len(self.key_times_s) < 3:
            return self._blend(self.offsets, lower, weight)
        gap = self.key_times_s[lower + 1] - self.key_times_s[lower]
        start, stop = self.offsets[lower], self.offsets[lower + 1]
        w, w2, w3 = weight, weight**2, weight**3
        return (
            (2 * w3 - 3 * w2 + 1) * start
            + (3 * w2 - 2 * w3) * stop
            + (w3 - 2 * w2 + w) * gap * self._tangent(lower)
            + (w3 - w2) * gap * self._tangent(lower + 1)
        )

    def _tangent(self, key: int) -> Float[Tensor, "m 3"]:
        """Velocity at a key: the central difference, one-sided at the ends."""
        first, last = max(key - 1, 0), min(key + 1, len(self.key_times_s) - 1)
        return (self.offsets[last] - self.offsets[first]) / (
            self.key_times_s[last] - self.key_times_s[first]
        )
