"""Scenes large enough for coded tensors, and a reader of their files that knows only the page.

The committed file is made again, after a deliberate change of the format, by:
    PYTHONPATH=tests/support python -c "import coded_scenes; coded_scenes.write_golden()"
"""

import json
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import oracles_hexplane
import oracles_io
import torch

from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

GOLDEN = Path(__file__).parents[1] / "golden" / "scene_v2.safetensors"
COUNT, MOVING, KEYS = 400, 150, 3
DTYPES = {"F32": "<f4", "F64": "<f8", "I64": "<i8", "U8": "u1"}


def scene(motion: str = "keyframes", dtype: torch.dtype = torch.float32, k: int = 4) -> Scene:
    """400 Gaussians in front of the cameras of ``oracles_io``, 150 of them moving."""
    made = torch.Generator().manual_seed(5)

    def noise(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=made, dtype=torch.float64).to(dtype)

    gaussians = Gaussians(
        means=noise(COUNT, 3) + torch.tensor([0, 0, 6], dtype=dtype),
        quats=noise(COUNT, 4),
        scales=(noise(COUNT, 3) - 3).exp(),
        opacities=noise(COUNT).sigmoid(),
        sh=0.3 * noise(COUNT, k, 3),
    )
    plain = oracles_io.scene(moving=False, dtype=dtype)
    return replace(plain, gaussians=gaussians, motion=_motion(motion, noise, k))


def _motion(kind: str, noise, k: int) -> Motion:
    index = torch.arange(MOVING) * 2 + 1
    if kind == "keyframes":
        return KeyframeMotion(
            key_times_s=torch.tensor([0.0, 0.5, 2.0]).to(noise(1)),
            moving_index=index,
            offsets=0.5 * noise(KEYS, MOVING, 3),
            rotations=noise(KEYS, MOVING, 4),
            log_scale_offsets=0.2 * noise(KEYS, MOVING, 3),
            interpolation="cubic",
        )
    if kind == "spacetime":
        return SpacetimeMotion(
            moving_index=index,
            velocities=noise(MOVING, 3),
            time_centers_s=noise(MOVING),
            time_deviations_s=noise(MOVING).exp(),
            time_range_s=(0.0, 2.0),
            color_waves=0.1 * noise(MOVING, 2, k, 3),
            period_s=2.0,
        )
    if kind == "hexplane":
        motion = oracles_hexplane.file_scene(noise(1).dtype).motion
        return replace(motion, moving_index=index)
    return StaticMotion(time_range_s=(0.0, 2.0))


def write_golden() -> None:
    """Make the committed scene file again."""
    save_scene(scene(k=1), GOLDEN, "standard")


def read_plainly(file: Path) -> tuple[dict[str, np.ndarray], dict]:
    """Tensors and JSON of a scene file of version 1 or 2, with nothing but NumPy."""
    data = file.read_bytes()
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    texts, body = header.pop("__metadata__"), data[8 + length :]
    assert texts["format"] == "diff4splat-scene" and int(texts["version"]) <= 2
    document, tensors = json.loads(texts["scene"]), {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        values = np.frombuffer(body[begin:end], DTYPES[entry["dtype"]])
        tensors[name] = values.reshape(entry["shape"])
    for name, entry in document.get("encodings", {}).items():
        low, step, planes = (tensors.pop(f"{name}.{part}") for part in ("low", "step", "planes"))
        tensors[name] = decoded(entry, low, step, planes.tobytes())
    return tensors, document


def decoded(entry: dict, low: np.ndarray, step: np.ndarray, planes: bytes) -> np.ndarray:
    """One coded tensor, as the page says."""
    columns, rows = entry["columns"], int(np.prod(entry["shape"])) // entry["columns"]
    parts = np.frombuffer(zlib.decompress(planes), np.uint8)
    parts = parts.reshape(entry["planes"], columns, rows).cumsum(-1, dtype=np.uint8)
    q = sum((part.astype(np.float64) * 256**p for p, part in enumerate(parts)), np.zeros(1))
    block = np.arange(rows) // entry["block_rows"]
    values = low[block] + step[block] * np.broadcast_to(q, (columns, rows)).T
    values = {"value": lambda v: v, "log": np.exp, "probability": lambda v: v.clip(0, 1),
              "smallest_three": quaternions}[entry["transform"]](values)  # fmt: skip
    return values.reshape(entry["shape"]).astype(DTYPES[entry["dtype"]])


def quaternions(values: np.ndarray) -> np.ndarray:
    """(index, three others) to (w, x, y, z)."""
    out = np.empty_like(values)
    for row, (index, *others) in zip(out, values, strict=True):
        largest = round(index)
        row[[place for place in range(4) if place != largest]] = others
        row[largest] = max(1 - np.square(others).sum(), 0) ** 0.5
    return out
