"""Causal layers of Wan's autoencoder and their history, as an explicit input and output.

Axes: ``b`` batch, ``c`` channels, ``t`` frames of a chunk, ``h w`` pixels. Before a video lie black
features (zeros), not its first frame. Frame 0 passes the layers over time unchanged, so the first
chunk must hold it and every later chunk must not.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

HISTORY_FRAMES = 2
"""Before the first of the three frames that a kernel covers last."""


class History:
    """The last input frames of every layer over time, in the order of the calls."""

    def __init__(self, caches: tuple[Tensor, ...] | None = None) -> None:
        self._old = caches
        self._new: list[Tensor] = []

    @property
    def starts(self) -> bool:
        """Whether this chunk begins with frame 0."""
        return self._old is None

    @property
    def caches(self) -> tuple[Tensor, ...]:
        """What the next chunk needs."""
        return tuple(self._new)

    def before_video(self, frames: Float[Tensor, "b c t h w"], count: int) -> Tensor:
        """Black features before frame 0."""
        return frames.new_zeros(*frames.shape[:2], count, *frames.shape[3:])

    def prepend(
        self, frames: Float[Tensor, "b c t h w"], count: int
    ) -> Float[Tensor, "b c t2 h w"]:
        """``frames`` after the ``count`` frames before them."""
        if self._old is None:
            before = self.before_video(frames, count)
        else:
            before = self._old[len(self._new)]
        extended = torch.cat([before, frames], 2)
        # A copy: a view would keep the whole chunk in memory.
        self._new.append(extended[:, :, extended.shape[2] - count :].clone())
        return extended


class WanCausalConv3d(nn.Conv3d):
    """Kernel of three frames and 3×3 or 1×1 pixels."""

    def __init__(self, channels: int, out_channels: int, space: int = 3) -> None:
        padding = (0, space // 2, space // 2)
        super().__init__(channels, out_channels, (3, space, space), padding=padding)

    def forward(
        self, frames: Float[Tensor, "b c t h w"], history: History
    ) -> Float[Tensor, "b c2 t h w"]:
        """One output frame per input frame."""
        return super().forward(history.prepend(frames, HISTORY_FRAMES))


class WanRmsNorm(nn.Module):
    """x / |x| · √c · gain over channels, without an ε (Wan)."""

    def __init__(self, channels: int, axes: int) -> None:
        super().__init__()
        self.gamma = nn.Parameter(torch.ones(channels, *[1] * axes))

    def forward(self, features: Float[Tensor, "b c ..."]) -> Float[Tensor, "b c ..."]:
        """Lengths are summed in at least float32."""
        wide = features.to(torch.promote_types(features.dtype, torch.float32))
        unit = torch.nn.functional.normalize(wide, dim=1).to(features.dtype)
        return unit * len(self.gamma) ** 0.5 * self.gamma
