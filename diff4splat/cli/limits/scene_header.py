"""What a scene file holds, from its header and the cameras of its path: nothing else is read."""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

MAX_HEADER_BYTES, MAX_POSE_BYTES = 100_000_000, 10_000_000
POSES = "path_world_from_camera"


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneHeader:
    """Counts of a scene file; zeros where the file is none, which loading then explains."""

    gaussians: int = 0
    moving: int = 0
    """Gaussians that have motion."""
    bases: int = 1
    """Harmonics per colour: 1, 4, 9 or 16."""
    frames: int = 0
    views: int = 0
    """Different poses among the cameras of the path."""
    size_px: tuple[int, int] = (0, 0)
    """(height, width)"""
    motion: str = "static"
    time_nodes: int = 0
    """Times between which the motion is smooth: key frames, or nodes of the planes."""


def read_scene_header(file: Path) -> SceneHeader:
    """Shapes in the header of a safetensors file, of coded tensors too."""
    try:
        with file.open("rb") as opened:
            length = struct.unpack("<Q", opened.read(8))[0]
            header = json.loads(opened.read(min(length, MAX_HEADER_BYTES)))
            settings = json.loads(header.pop("__metadata__")["scene"])
            return _counts(header, settings, _view_count(opened, length, header[POSES]))
    except (OSError, ValueError, LookupError, TypeError, AttributeError, struct.error):
        return SceneHeader()


def _counts(header: Mapping[str, Any], settings: Mapping[str, Any], views: int) -> SceneHeader:
    coded = settings.get("encodings", {})
    shapes = {name: one["shape"] for name, one in (*header.items(), *coded.items())}
    kind = settings["motion"]["kind"]
    moving = shapes.get("moving_index", shapes["opacities"])[0]
    nodes = [shapes.get("key_times_s", [0])[0]]
    nodes += [shape[0] for name, shape in shapes.items() if name.endswith((".xt", ".yt", ".zt"))]
    height, width = settings["path"]["size_px"]
    return SceneHeader(
        gaussians=shapes["opacities"][0],
        moving=0 if kind == "static" else moving,
        bases=shapes["sh"][1],
        frames=shapes["path_times_s"][0],
        views=views,
        size_px=(height, width),
        motion=kind,
        time_nodes=max(nodes),
    )


def _view_count(opened: BinaryIO, header_bytes: int, poses: Mapping[str, Any]) -> int:
    """Different rows among the stored poses; all of them if there are too many to look at."""
    count, (begin, end) = poses["shape"][0], poses["data_offsets"]
    if not 0 < end - begin <= MAX_POSE_BYTES or (end - begin) % count:
        return count
    opened.seek(8 + header_bytes + begin)
    stored, row = opened.read(end - begin), (end - begin) // count
    return len({stored[k * row : (k + 1) * row] for k in range(count)})
