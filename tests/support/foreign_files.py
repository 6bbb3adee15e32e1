"""Files as other programs write them, byte by byte."""

import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch

from diff4splat.io.ply.ply_columns import column_names, to_table
from diff4splat.scene.gaussians import Gaussians

PLAIN = ("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity")
SHAPE = ("scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3")


def columns_of(gaussians: Gaussians) -> dict[str, np.ndarray]:
    """The columns of an INRIA PLY by name."""
    table = to_table(gaussians)
    names = column_names(gaussians.sh.shape[1])
    return {name: table[:, i].astype("<f4") for i, name in enumerate(names)}


def ply(
    columns: Mapping[str, np.ndarray], after: Mapping[str, np.ndarray] | None = None, order="<"
) -> bytes:
    """Binary rows of element vertex; then elements of a single property with their own name."""
    types = {"f": "float", "u1": "uchar", "u4": "uint", "i4": "int"}
    kinds = {n: types["f" if v.dtype.kind == "f" else v.dtype.str[1:]] for n, v in columns.items()}
    count = len(next(iter(columns.values())))
    form = "little" if order == "<" else "big"
    lines = ["ply", f"format binary_{form}_endian 1.0", f"element vertex {count}"]
    lines += [f"property {kind} {name}" for name, kind in kinds.items()]
    body = np.empty(count, [(name, order + v.dtype.str[1:]) for name, v in columns.items()])
    for name, value in columns.items():
        body[name] = value
    tail = b""
    for name, value in (after or {}).items():
        kind = types["f" if value.dtype.kind == "f" else value.dtype.str[1:]]
        lines += [f"element {name} {len(value)}", f"property {kind} {name}"]
        tail += value.astype(order + value.dtype.str[1:]).tobytes()
    return "\n".join([*lines, "end_header\n"]).encode() + body.tobytes() + tail


def sharp_ply(gaussians: Gaussians, color_space: int = 0) -> bytes:
    """As SHARP writes it: no normals, a camera and a colour space after the Gaussians."""
    columns = columns_of(gaussians)
    after = {
        "extrinsic": np.eye(4, dtype="f4").ravel(),
        "intrinsic": np.array([50, 0, 32, 0, 50, 24, 0, 0, 1], "f4"),
        "image_size": np.array([64, 48], "u4"),
        "frame": np.array([1, len(gaussians)], "i4"),
        "disparity": np.array([0.1, 0.9], "f4"),
        "color_space": np.array([color_space], "u1"),
        "version": np.array([1, 5, 0], "u1"),
    }
    return ply({name: columns[name] for name in (*PLAIN, *SHAPE)}, after)


def anysplat_ply(gaussians: Gaussians) -> bytes:
    """As AnySplat writes it: harmonics up to degree 4 and plain colours as bytes."""
    columns = columns_of(gaussians)
    count = len(gaussians)
    rest = {f"f_rest_{i}": np.full(count, i / 100, "f4") for i in range(72)}
    plain = {name: np.full(count, 7, "u1") for name in ("red", "green", "blue")}
    kept = ("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2")
    head = {name: columns[name] for name in kept}
    shape = {name: columns[name] for name in ("opacity", *SHAPE)}
    return ply({**head, **rest, **shape, **plain})


def spacetime_ply(count: int = 6, network: bool = False) -> bytes:
    """As Spacetime Gaussians writes it."""
    rng = np.random.default_rng(0)
    names = ("x", "y", "z", "trbf_center", "trbf_scale", "nx", "ny", "nz")
    names += (*tuple(f"motion_{i}" for i in range(9)), "f_dc_0", "f_dc_1", "f_dc_2", "opacity")
    names += SHAPE + tuple(f"omega_{i}" for i in range(4))
    names += ("f_t_0", "f_t_1", "f_t_2") if network else ()
    columns = {name: rng.normal(0, 0.3, count).astype("f4") for name in names}
    columns["trbf_center"] = np.linspace(0.1, 0.9, count).astype("f4")
    columns["trbf_scale"] = np.full(count, -1.0, "f4")
    columns["z"] += 3
    return ply(columns)


def compressed_ply(count: int = 5, harmonics: int = 9) -> bytes:
    """As SuperSplat writes it, of one chunk."""
    bounds = [f"{end}_{axis}" for end in ("min", "max") for axis in ("x", "y", "z")]
    bounds += [f"{end}_scale_{axis}" for end in ("min", "max") for axis in ("x", "y", "z")]
    bounds += [f"{end}_{color}" for end in ("min", "max") for color in ("r", "g", "b")]
    lines = ["ply", "format binary_little_endian 1.0", "element chunk 1"]
    lines += [f"property float {name}" for name in bounds] + [f"element vertex {count}"]
    lines += [f"property uint packed_{n}" for n in ("position", "rotation", "scale", "color")]
    lines += [f"element sh {count}"] + [f"property uchar f_rest_{i}" for i in range(harmonics)]
    values = [-1, -2, -3, 1, 2, 3, -6, -6, -6, -2, -2, -2, 0, 0, 0, 1, 1, 1]
    middle = 512 << 20 | 512 << 10 | 512
    row = struct.pack("<IIII", 0xFFFFFFFF, middle, 0, 0xFF8000FF)
    body = struct.pack("<18f", *values) + row * count + bytes([255, 128, 0] * 3) * count
    return "\n".join([*lines, "end_header\n"]).encode() + body


def point_maps(frames: int = 3, size: tuple[int, int] = (6, 8)) -> dict[str, np.ndarray]:
    """A wavy wall, further away in every frame, with a hole."""
    y, x = np.mgrid[: size[0], : size[1]] / 8.0
    points = np.stack([np.stack([x, y, 2 + 0.1 * x + t], -1) for t in range(frames)])
    points[:, 0, 0] = np.nan
    colors = np.full((frames, *size, 3), 200, np.uint8)
    return {"points": points.astype("f4"), "colors": colors}


def moving_cloud(count: int = 30, steps: int = 4) -> list[Gaussians]:
    """States of a cloud of which a third moves and turns."""
    torch.manual_seed(0)
    means = torch.randn(count, 3) + torch.tensor([0.0, 0, 4])
    quats = torch.nn.functional.normalize(torch.randn(count, 4), dim=-1)
    scales, opacities = torch.rand(count, 3) * 0.1 + 0.05, torch.rand(count) * 0.8 + 0.1
    sh = torch.randn(count, 1, 3) * 0.5
    states = []
    for step in range(steps):
        moved, turned = means.clone(), quats.clone()
        moved[: count // 3] += torch.tensor([0.05, 0.02, 0.0]) * step
        turned[: count // 3] = torch.nn.functional.normalize(
            quats[: count // 3] + 0.05 * step, dim=-1
        )
        states.append(
            Gaussians(means=moved, quats=turned, scales=scales, opacities=opacities, sh=sh)
        )
    return states


def write_sequence(states: list[Gaussians], folder: Path) -> Path:
    """Numbered PLY files of states, without times."""
    folder.mkdir()
    for number, state in enumerate(states):
        (folder / f"splat_{number + 8}.ply").write_bytes(ply(columns_of(state)))
    return folder
