"""What a scene file holds, from its header alone: nothing is loaded."""

import json
import struct
from dataclasses import dataclass
from pathlib import Path

MAX_HEADER_BYTES = 100_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneHeader:
    """Counts of a scene file; zeros where the file is none, which loading then explains."""

    gaussians: int = 0
    moving: int = 0
    """Gaussians that have motion."""
    bases: int = 1
    """Harmonics per colour: 1, 4, 9 or 16."""
    frames: int = 0
    size_px: tuple[int, int] = (0, 0)
    """(height, width)"""
    motion: str = "static"


def read_scene_header(file: Path) -> SceneHeader:
    """Shapes in the header of a safetensors file."""
    try:
        with file.open("rb") as opened:
            length = struct.unpack("<Q", opened.read(8))[0]
            header = json.loads(opened.read(min(length, MAX_HEADER_BYTES)))
        shapes = {name: one["shape"] for name, one in header.items() if name != "__metadata__"}
        settings = json.loads(header["__metadata__"]["scene"])
        moving = [shape[0] for name, shape in shapes.items() if name.endswith("moving_index")]
        kind = settings["motion"]["kind"]
        return SceneHeader(
            gaussians=shapes["opacities"][0],
            moving=0 if kind == "static" else max(moving, default=shapes["opacities"][0]),
            bases=shapes["sh"][1],
            frames=shapes["path_times_s"][0],
            size_px=tuple(settings["path"]["size_px"]),
            motion=kind,
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError, struct.error):
        return SceneHeader()
