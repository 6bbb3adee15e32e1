"""How a capture is read: ``fit`` and ``reconstruct``."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from diff4splat.cli.options.constraints import Number

if TYPE_CHECKING:
    from diff4splat.cli.fit import Fit
    from diff4splat.cli.scenes.reconstruct import Reconstruct
    from diff4splat.data.capture.capture import Capture


@dataclass(frozen=True, kw_only=True)
class CaptureOptions:
    """How the capture is read."""

    format: str = "auto"
    """dnerf, neu3d, hypernerf, colmap, transforms, clips or cameras; auto detects it."""
    hold_out: Annotated[tuple[int, ...] | None, Number(least=0)] = None
    """Cameras to hold out, from 0. Default: the rule of the format."""
    downscale: Annotated[int, Number(least=1)] = 1
    """Downscale images by this factor."""
    frame_step: Annotated[int, Number(least=1)] = 1
    """Use every n-th time only."""
    fps: Annotated[float | None, Number(above=0)] = None
    """Frames per second, for formats that only count frames."""
    clip: str | None = None
    """Which clip of a folder of shards, or which effect of data sets of cameras."""

    def read(self, data: Path) -> "Capture":
        """The capture in a folder or file."""
        from diff4splat.data_prep.readers.options import ReadOptions
        from diff4splat.data_prep.readers.registry import read_capture

        return read_capture(data, ReadOptions(**asdict(self)))


def inputs_for_card(command: "Fit | Reconstruct") -> dict[str, object]:
    """All options of a command as given, those of its capture among them, for ``card.json``."""
    given = {name: value for name, value in asdict(command).items() if name != "options"}
    given |= asdict(command.options)
    return {name: str(value) if isinstance(value, Path) else value for name, value in given.items()}
