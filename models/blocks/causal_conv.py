"""3D convolution over past frames only, with its cache as an explicit input and output.

Axes: ``b`` batch, ``c`` channels, ``t`` frames of a chunk, ``h w`` pixels. A kernel of three
frames covers frames t−2, t−1 and t, so a chunk needs the last two input frames of the previous
chunk. They are explicit tensors, never attributes of the layer: a chunk stays a pure function and
exports to ONNX.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

HISTORY_FRAMES = 2


class FrameMemory:
    """The two earlier frames of every causal convolution of a network, in the order of the calls.

    Without ``caches`` a video starts here: its first frame is repeated before it.
    """

    def __init__(self, caches: tuple[Tensor, ...] | None = None) -> None:
        self._old = caches
        self._new: list[Tensor] = []

    @property
    def caches(self) -> tuple[Tensor, ...]:
        """What the next chunk needs."""
        return tuple(self._new)

    def prepend(self, frames: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b c t2 h w"]:
        """``frames`` after the two cached frames; caches the last two for the next chunk."""
        if self._old is None:
            history = frames[:, :, :1].expand(-1, -1, HISTORY_FRAMES, -1, -1)
        else:
            history = self._old[len(self._new)]
        extended = torch.cat([history, frames], 2)
        self._new.append(extended[:, :, -HISTORY_FRAMES:])
        return extended


class CausalConv3d(nn.Module):
    """Kernel of 3 frames and 3×3 (or 1×1) pixels, optionally with a stride."""

    def __init__(
        self,
        channels: int,
        out_channels: int,
        space: int = 3,
        stride: tuple[int, int, int] = (1, 1, 1),
    ) -> None:
        super().__init__()
        kernel, padding = (3, space, space), (0, space // 2, space // 2)
        self.conv = nn.Conv3d(channels, out_channels, kernel, stride, padding)

    def forward(
        self, frames: Float[Tensor, "b c t h w"], memory: FrameMemory
    ) -> Float[Tensor, "b c2 t2 h2 w2"]:
        """Convolve after the cached frames are put in front."""
        # Channels last: oneDNN's 3D convolutions take half the time of the plain layout on CPUs.
        return self.conv(memory.prepend(frames).contiguous(memory_format=torch.channels_last_3d))
