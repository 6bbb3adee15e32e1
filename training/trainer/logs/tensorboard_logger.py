"""TensorBoard, where it is installed (extra ``train``); the JSON log has the same numbers.

Curves are a convenience: when they cannot be written one note says so, and training goes on.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jaxtyping import Float
from torch import Tensor


class TensorboardLogger:
    """Scalars and images; does nothing without TensorBoard."""

    def __init__(self, folder: Path, note: Callable[[str], None]) -> None:
        self._writer, self._note = None, note
        try:
            from torch.utils.tensorboard import SummaryWriter

            self._writer = SummaryWriter(str(folder))
        except ImportError:
            note("tensorboard is not installed: the numbers are in log.jsonl alone")
        except (OSError, RuntimeError) as error:  # the latter where no thread can be started
            self._give_up(error)

    def scalars(self, step: int, values: Mapping[str, float | None]) -> None:
        """Curves; names with a slash are grouped."""
        for name, value in values.items():
            if value is not None:
                self._tell("add_scalar", name, value, step)

    def image(self, step: int, rgb: Float[Tensor, "h w 3"]) -> None:
        """The panel of an evaluation."""
        self._tell("add_image", "panel", rgb.numpy(), step, dataformats="HWC")

    def close(self) -> None:
        """Write what is still in memory."""
        self._tell("close")

    def _tell(self, method: str, *values: Any, **options: str) -> None:
        if self._writer is not None:
            try:
                getattr(self._writer, method)(*values, **options)
            except (OSError, RuntimeError) as error:
                self._give_up(error)

    def _give_up(self, error: OSError | RuntimeError) -> None:
        self._writer = None
        reason = getattr(error, "strerror", None) or str(error)
        self._note(f"tensorboard: no more curves ({reason}); the numbers are in log.jsonl")
