"""HexPlane features and motion by other means: dense weights, one Gaussian at a time, float64.

A plane's value at a place is the sum over all its nodes of two hat functions times the node; the
gradients are those of that sum.

The committed scene file is made again, after a deliberate change of the format, by:
    PYTHONPATH=tests/support python -c "import oracles_hexplane; oracles_hexplane.write_golden()"
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import oracles_io
import torch
from torch import Tensor

from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane.decoder import (
    HEAD_NAMES,
    DecoderSize,
    Layer,
    MotionDecoder,
    make_decoder,
)
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.hexplane.planes import HexPlanes, HexPlaneSize, make_planes
from diff4splat.scene.scene import Scene

GOLDEN = Path(__file__).parents[1] / "golden" / "scene_v1_hexplane.safetensors"
F64 = torch.float64
BOX = torch.tensor([[-1.0, -2.0, 0.5], [1.5, 2.0, 3.0]])


def random_planes(
    size: HexPlaneSize | None = None,
    dtype: torch.dtype = F64,
    box: Tensor = BOX,
    time_mapping: str = "full",
) -> HexPlanes:
    """Planes away from their start: those with time change in time."""
    size = size or HexPlaneSize(space=(5, 4, 3), time=6, channels=16)
    planes = make_planes(size, box, (1.0, 3.0), time_mapping=time_mapping).to(dtype)
    levels = [[p + 0.3 * torch.randn_like(p) for p in level] for level in planes.levels]
    return with_levels(planes, levels)


def with_levels(planes: HexPlanes, levels: Sequence[Sequence[Tensor]]) -> HexPlanes:
    return HexPlanes(
        levels=tuple(tuple(level) for level in levels),
        bounds=planes.bounds,
        time_range_s=planes.time_range_s,
        time_mapping=planes.time_mapping,
    )


def random_points(count: int, dtype: torch.dtype = F64, box: Tensor = BOX) -> Tensor:
    """Most inside the box, some outside."""
    box = box.to(dtype)
    return box[0] + (torch.rand(count, 3, dtype=dtype) * 1.4 - 0.2) * (box[1] - box[0])


def random_cloud(count: int, coefficients: int = 4, dtype: torch.dtype = F64) -> Gaussians:
    return Gaussians(
        means=random_points(count, dtype),
        quats=torch.randn(count, 4, dtype=dtype),
        scales=torch.rand(count, 3, dtype=dtype) + 0.1,
        opacities=torch.rand(count, dtype=dtype),
        sh=torch.randn(count, coefficients, 3, dtype=dtype),
    )


def random_motion(
    index: Sequence[int],
    heads: tuple[str, ...] = HEAD_NAMES,
    dtype: torch.dtype = F64,
    depth: int = 2,
    rotation: str = "product",
) -> HexPlaneMotion:
    """A motion with heads that are not zero, for harmonics of degree 1."""
    planes = random_planes(dtype=dtype)
    size = DecoderSize(width=8, depth=depth, heads=heads, coefficients=4)
    decoder = make_decoder(planes.feature_count, size, zero_heads=False).to(dtype)
    return HexPlaneMotion(
        planes=planes,
        decoder=decoder,
        moving_index=torch.tensor(index, dtype=torch.long),
        rotation=rotation,
    )


def features(planes: HexPlanes, points: Tensor, time_s: float) -> Tensor:
    """``n f`` by dense weights."""
    start, stop = planes.time_range_s
    part = min(max((time_s - start) / (stop - start), 0.0), 1.0)
    if planes.time_mapping == "half":  # 4DGaussians hands t in [0, 1] to a sampler of [-1, 1]
        part = (part + 1) / 2
    part = torch.full_like(points[:, :1], part)
    parts = torch.cat(
        [(points - planes.bounds[0]) / (planes.bounds[1] - planes.bounds[0]), part], 1
    )
    made = []
    for level in planes.levels:
        product = torch.ones(len(points), planes.channels, dtype=points.dtype)
        pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
        for (column, row), plane in zip(pairs, level, strict=True):
            across = _hats(parts[:, column], plane.shape[1])
            along = _hats(parts[:, row], plane.shape[0])
            product = product * torch.einsum("nr,nc,rck->nk", along, across, plane)
        made.append(product)
    return torch.cat(made, 1)


def _hats(parts: Tensor, nodes: int) -> Tensor:
    """Weight of every node for every point."""
    place = parts.clamp(0, 1)[:, None] * (nodes - 1)
    return (1 - (place - torch.arange(nodes, dtype=parts.dtype)).abs()).clamp_min(0)


def state(motion: HexPlaneMotion, gaussians: Gaussians, time_s: float) -> dict[str, np.ndarray]:
    """The Gaussians at a time, one after the other, by logarithms and logits."""
    made = {f.name: getattr(gaussians, f.name).detach().numpy().copy() for f in fields(gaussians)}
    index = motion.moving_index.tolist()
    told = features(motion.planes, gaussians.means[motion.moving_index], time_s).detach().numpy()
    weights = {name: tensor.detach().numpy() for name, tensor in motion.tensors().items()}
    for row, k in zip(told, index, strict=True):
        hidden = _linear(weights, "trunk.0", row)
        for layer in range(1, len(motion.decoder.trunk)):
            hidden = _linear(weights, f"trunk.{layer}", np.maximum(hidden, 0))
        delta = {name: _head(weights, name, hidden) for name in motion.decoder.heads}
        _change(made, k, delta, motion.rotation)
    return made


def _linear(weights: dict[str, np.ndarray], name: str, values: np.ndarray) -> np.ndarray:
    return weights[f"{name}.weight"] @ values + weights[f"{name}.bias"]


def _head(weights: dict[str, np.ndarray], name: str, hidden: np.ndarray) -> np.ndarray:
    middle = _linear(weights, f"{name}.0", np.maximum(hidden, 0))
    return _linear(weights, f"{name}.1", np.maximum(middle, 0))


def _change(made: dict[str, np.ndarray], k: int, delta: dict[str, np.ndarray], turn: str) -> None:
    rules: dict[str, tuple[str, Callable[[np.ndarray, np.ndarray], np.ndarray]]] = {
        "position": ("means", lambda old, d: old + d),
        "scale": ("scales", lambda old, d: np.exp(np.log(old) + d)),
        "opacity": ("opacities", lambda old, d: _sigmoid(_logit(old) + d[0])),
        "color": ("sh", lambda old, d: old + d.reshape(old.shape)),
        "rotation": ("quats", turned if turn == "product" else _added),
    }
    for name, d in delta.items():
        part, rule = rules[name]
        made[part][k] = rule(made[part][k], d)


def turned(quat: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """Quat ⊗ normalise(1 + Δ), as matrices that multiply from the left."""
    a, b, c, d = quat / np.linalg.norm(quat)
    left = np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])
    right = delta + np.array([1.0, 0, 0, 0])
    return left @ (right / np.linalg.norm(right))


def _added(quat: np.ndarray, delta: np.ndarray) -> np.ndarray:
    return (quat + delta) / np.linalg.norm(quat + delta)


def _logit(value: float) -> float:
    return math.log(value) - math.log1p(-value)


def _sigmoid(value: float) -> float:
    return 1 / (1 + math.exp(-value))


def file_scene(dtype: torch.dtype = torch.float32) -> Scene:
    """Four Gaussians of which two move; every number a multiple of 1/64."""
    nodes, channels, width = (2, 3, 2, 2), 2, 2
    planes = []
    for multiplier in (1, 2):
        fine = [multiplier * count for count in nodes[:3]] + [nodes[3]]
        pairs = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
        planes.append(tuple(oracles_io.ramp(fine[j], fine[i], channels) + 0.5 for i, j in pairs))
    trunk = (Layer(weight=oracles_io.ramp(width, 4), bias=oracles_io.ramp(width)),)
    heads = {}
    for name, outputs in (("position", 3), ("rotation", 4), ("color", 12)):
        hidden = Layer(weight=oracles_io.ramp(width, width) + 0.25, bias=oracles_io.ramp(width))
        last = Layer(weight=oracles_io.ramp(outputs, width) - 0.25, bias=oracles_io.ramp(outputs))
        heads[name] = (hidden, last)
    motion = HexPlaneMotion(
        planes=HexPlanes(
            levels=tuple(planes),
            bounds=torch.tensor([[-1.0, -1, -1], [1, 1, 1]]),
            time_range_s=(0.0, 2.0),
        ),
        decoder=MotionDecoder(trunk=trunk, heads=heads),
        moving_index=torch.tensor([1, 3]),
    )
    return replace(oracles_io.scene(), motion=motion).to(dtype)


def write_golden() -> None:
    save_scene(file_scene(), GOLDEN)
