"""TensorBoard, where it is installed (extra ``train``); the JSON log has the same numbers."""

from collections.abc import Callable, Mapping
from pathlib import Path

from jaxtyping import Float
from torch import Tensor


class Board:
    """Scalars and pictures; does nothing without TensorBoard."""

    def __init__(self, folder: Path, note: Callable[[str], None]) -> None:
        self._writer = None
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError:
            note("tensorboard is not installed: the numbers are in log.jsonl alone")
        else:
            self._writer = SummaryWriter(str(folder))

    def scalars(self, step: int, values: Mapping[str, float | None]) -> None:
        """Curves; names with a slash are grouped."""
        if self._writer:
            for name, value in values.items():
                if value is not None:
                    self._writer.add_scalar(name, value, step)

    def picture(self, step: int, rgb: Float[Tensor, "h w 3"]) -> None:
        """The panel of an evaluation."""
        if self._writer:
            self._writer.add_image("panel", rgb.numpy(), step, dataformats="HWC")

    def close(self) -> None:
        """Write what is still in memory."""
        if self._writer:
            self._writer.close()
