"""Checkpoint folders of 4DGaussians, byte by byte, and states by the program's own recipe."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import grid_sample

HEADS = {
    "pos_deform": 3,
    "scales_deform": 3,
    "rotations_deform": 4,
    "opacity_deform": 1,
    "shs_deform": 48,
}
NET = "deformation_net."
PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))


def random_state(
    nodes: tuple[int, int, int, int] = (6, 5, 4, 7),
    channels: int = 8,
    width: int = 12,
    depth: int = 2,
    multipliers: tuple[int, ...] = (1, 2),
) -> dict[str, Tensor]:
    """All tensors that the program stores, under its names."""
    state = {f"{NET}grid.aabb": torch.tensor([[1.5, 2.0, 3.0], [-1.0, -2.0, 0.5]])}
    for level, multiplier in enumerate(multipliers):
        fine = [multiplier * n for n in nodes[:3]] + [nodes[3]]
        for k, (i, j) in enumerate(PAIRS):
            plane = torch.rand(1, channels, fine[j], fine[i]) + 0.5
            state[f"{NET}grid.grids.{level}.{k}"] = plane
    inputs = channels * len(multipliers)
    for layer in range(depth):
        _add_layer(state, f"{NET}feature_out.{2 * layer}", inputs if layer == 0 else width, width)
    for head, outputs in HEADS.items():
        _add_layer(state, f"{NET}{head}.1", width, width)
        _add_layer(state, f"{NET}{head}.3", width, outputs)
    _add_layer(state, "timenet.0", 9, 64)
    _add_layer(state, "timenet.2", 64, 32)
    for name in ("time_poc", "pos_poc", "rotation_scaling_poc", "opacity_poc"):
        state[name] = 2.0 ** torch.arange(4)
    return state


def _add_layer(state: dict[str, Tensor], name: str, inputs: int, outputs: int) -> None:
    state[f"{name}.weight"] = torch.randn(outputs, inputs) / inputs**0.5
    state[f"{name}.bias"] = 0.3 * torch.randn(outputs)


def random_cloud(count: int) -> dict[str, np.ndarray]:
    """Unactivated values; quaternions of any length."""
    rng = np.random.default_rng(0)
    return {
        "xyz": rng.uniform((-1.2, -2.2, 0.2), (1.7, 2.2, 3.3), (count, 3)).astype("f4"),
        "rot": rng.normal(size=(count, 4)).astype("f4"),
        "scale": rng.normal(size=(count, 3)).astype("f4") - 2,
        "opacity": rng.normal(size=(count, 1)).astype("f4"),
        "sh": rng.normal(size=(count, 16, 3)).astype("f4"),
    }


def write_ply(file: Path, cloud: Mapping[str, np.ndarray]) -> None:
    names = [*("x", "y", "z", "nx", "ny", "nz"), *(f"f_dc_{k}" for k in range(3))]
    names += [f"f_rest_{k}" for k in range(3 * cloud["sh"].shape[1] - 3)]
    names += ["opacity", *(f"scale_{k}" for k in range(3)), *(f"rot_{k}" for k in range(4))]
    count = len(cloud["xyz"])
    rest = cloud["sh"][:, 1:].transpose(0, 2, 1).reshape(count, -1)
    table = np.concatenate(
        [
            *(cloud["xyz"], 0 * cloud["xyz"], cloud["sh"][:, 0], rest),
            *(cloud["opacity"], cloud["scale"], cloud["rot"]),
        ],
        1,
    )
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    head += [*(f"property float {name}" for name in names), "end_header\n"]
    file.write_bytes("\n".join(head).encode() + table.astype("<f4").tobytes())


def write_folder(
    folder: Path, state: object, cloud: Mapping[str, np.ndarray], settings: str | None = None
) -> Path:
    """The output folder of a run, with one iteration in it; returns that iteration's folder."""
    iteration = folder / "point_cloud" / "iteration_14000"
    iteration.mkdir(parents=True)
    write_ply(iteration / "point_cloud.ply", cloud)
    torch.save(state, iteration / "deformation.pth")
    count = len(cloud["xyz"])
    torch.save(torch.ones(count) > 0, iteration / "deformation_table.pth")
    torch.save(torch.zeros(count, 3), iteration / "deformation_accum.pth")
    if settings is not None:
        (folder / "cfg_args").write_text(settings)
    return iteration


def moved(state: Mapping[str, Tensor], cloud: Mapping[str, np.ndarray], part: float) -> dict:
    """Activated values at the time ``part`` in [0, 1], with all five heads, in float64."""
    net = {name.removeprefix(NET): tensor.double() for name, tensor in state.items()}
    raw = {name: torch.from_numpy(values).double() for name, values in cloud.items()}
    high, low = net["grid.aabb"]
    place = torch.cat([(raw["xyz"] - high) * 2 / (low - high) - 1, raw["xyz"][:, :1] * 0 + part], 1)
    parts, level = [], 0
    while f"grid.grids.{level}.0" in net:
        product = 1.0
        for k, (i, j) in enumerate(PAIRS):
            where = place[None, None][..., [i, j]]
            read = grid_sample(
                net[f"grid.grids.{level}.{k}"], where, padding_mode="border", align_corners=True
            )
            product = product * read[0, :, 0].T
        parts.append(product)
        level += 1
    hidden = torch.cat(parts, 1)
    layer = 0
    while f"feature_out.{layer}.weight" in net:
        hidden = _linear(net, f"feature_out.{layer}", hidden.relu() if layer else hidden)
        layer += 2
    delta = {
        head: _linear(net, f"{head}.3", _linear(net, f"{head}.1", hidden.relu()).relu())
        for head in HEADS
    }
    rotation = raw["rot"] + delta["rotations_deform"]
    return {
        "means": raw["xyz"] + delta["pos_deform"],
        "scales": (raw["scale"] + delta["scales_deform"]).exp(),
        "quats": rotation / rotation.norm(dim=1, keepdim=True),
        "opacities": (raw["opacity"] + delta["opacity_deform"]).sigmoid()[:, 0],
        "sh": raw["sh"] + delta["shs_deform"].reshape(-1, 16, 3),
    }


def _linear(net: Mapping[str, Tensor], name: str, values: Tensor) -> Tensor:
    return values @ net[f"{name}.weight"].T + net[f"{name}.bias"]
