"""Checkpoints of 4DGaussians (Wu et al., CVPR 2024): Gaussians in a PLY, and the field beside them.

    point_cloud/iteration_N/point_cloud.ply          canonical Gaussians
    point_cloud/iteration_N/deformation.pth          planes and network, as a state_dict
    point_cloud/iteration_N/deformation_table.pth    one truth value per Gaussian, or no file
    cfg_args                                         settings as text, or no file

Planes have the shape ``1 c rj ri`` over a box stored as (high, low). Times from 0 to 1 use the
upper half of the time nodes. ``HexPlanes`` stores both unchanged. All Gaussians move: the program's
renderer ignores the table. No code in the files is run.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from diff4splat.errors import FileFormatError, InputError, ShapeError
from diff4splat.io.checkpoints.fourdgs_settings import heads_in_use
from diff4splat.io.checkpoints.torch_file import load_torch_file
from diff4splat.io.ply.ply_body import read_columns
from diff4splat.io.ply.ply_columns import from_columns
from diff4splat.io.ply.ply_header import read_header
from diff4splat.io.require_file import read_bytes
from diff4splat.io.scene_files.tensor_checks import take_floats
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane.decoder import HEAD_NAMES, Layer, MotionDecoder
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.hexplane.planes import PLANE_NAMES, HexPlanes

_HEADS = {
    "position": "pos_deform",
    "rotation": "rotations_deform",
    "scale": "scales_deform",
    "opacity": "opacity_deform",
    "color": "shs_deform",
}
_ITERATION = re.compile(r"iteration_([0-9]{1,12})")
_NET = "deformation_net."
_PLANE = re.compile(r"grid\.grids\.(\d{1,2})\.([0-5])")
_TRUNK = re.compile(r"feature_out\.(\d{1,2})\.(?:weight|bias)")
_HEAD = re.compile(rf"(?:{'|'.join(_HEADS.values())})\.[13]\.(?:weight|bias)")
_UNUSED = re.compile(r"timenet\.\d\.(?:weight|bias)|\w+_poc")
"""Entries that the program stores and never reads."""


def read_fourdgs_checkpoint(
    folder: Path | str, duration_s: float = 1.0, heads: tuple[str, ...] | None = None
) -> tuple[Gaussians, HexPlaneMotion]:
    """Float32 Gaussians and their motion from a folder ``iteration_N``, or the last one below it.

    ``duration_s`` is how long the program's time from 0 to 1 takes. ``heads`` says which parts of
    the network were in use; None takes what ``cfg_args`` says, or else position, rotation, scale.
    Quaternions keep their stored lengths, because the residuals are added to them.

    Raises:
        InputError: ``duration_s`` is not a finite number above 0, or a head is unknown.
        FileFormatError: a file is missing, damaged, of other Gaussians, or needs more than numbers.
    """
    if not 0 < duration_s < float("inf"):
        raise InputError(f"duration_s: expected a finite number above 0, got {duration_s}")
    folder = _iteration(Path(folder))
    heads = heads_in_use(folder) if heads is None else heads
    if not set(heads) <= set(HEAD_NAMES):
        raise InputError(f"heads: expected some of {', '.join(HEAD_NAMES)}, got {heads}")
    gaussians = _read_gaussians(folder / "point_cloud.ply")
    _require_table(folder / "deformation_table.pth", len(gaussians))
    file = folder / "deformation.pth"
    try:
        motion = _motion(_net(_load(file, dict)), duration_s, heads, len(gaussians))
        _require_harmonics(motion, gaussians)
    except (FileFormatError, ShapeError) as error:
        raise FileFormatError(f"{file}: {error}") from error
    return gaussians, motion


def _iteration(folder: Path) -> Path:
    """The folder with the files."""
    if (folder / "point_cloud.ply").exists():
        return folder
    found = [*folder.glob("iteration_*"), *folder.glob("point_cloud/iteration_*")]
    numbered = [(int(match[1]), at) for at in found if (match := _ITERATION.fullmatch(at.name))]
    if not numbered:
        raise FileFormatError(
            f"{folder}: expected point_cloud.ply or folders iteration_N, got neither; give the "
            "output folder of 4DGaussians"
        )
    return max(numbered)[1]


def _read_gaussians(file: Path) -> Gaussians:
    """Read a PLY file; quaternions keep their stored lengths."""
    data = read_bytes(file, "a PLY file")
    try:
        columns = read_columns(data, read_header(data), "vertex")
        gaussians = from_columns(columns)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
    stored = [torch.from_numpy(columns[f"rot_{k}"].astype("f4")) for k in range(4)]
    return replace(gaussians, quats=torch.stack(stored, 1))


def _load(file: Path, kind: type) -> Any:
    found = load_torch_file(file, "a file of 4DGaussians")
    if not isinstance(found, kind):
        raise FileFormatError(f"{file}: expected {kind.__name__}, got {type(found).__name__}")
    return found


def _require_table(file: Path, count: int) -> None:
    """Check the unused table: a wrong size shows that files of several models were mixed."""
    if not file.exists():
        return
    table = _load(file, Tensor)
    if table.dtype != torch.bool or tuple(table.shape) != (count,):
        raise FileFormatError(
            f"{file}: expected {count} truth values, one per Gaussian of the PLY, got "
            f"{tuple(table.shape)} of {str(table.dtype)[6:]}; copy the whole folder again"
        )


def _net(state: Mapping[object, object]) -> dict[str, Tensor]:
    """Tensors of the field by name; rejects unknown entries."""
    known, unknown = {}, []
    for name, value in state.items():
        part = str(name).removeprefix(_NET)
        used = part == "grid.aabb" or any(p.fullmatch(part) for p in (_PLANE, _TRUNK, _HEAD))
        if used and isinstance(value, Tensor):
            known[part] = value.detach()
        elif not (isinstance(name, str) and _UNUSED.fullmatch(name)):
            unknown.append(str(name)[:60])
    if unknown:
        listed = ", ".join(sorted(unknown)[:3])
        raise FileFormatError(f"expected planes, trunk and heads only, got also {listed}")
    return known


def _motion(
    net: Mapping[str, Tensor], duration_s: float, heads: tuple[str, ...], count: int
) -> HexPlaneMotion:
    planes = HexPlanes(
        levels=_levels(net),
        bounds=take_floats(net, "grid.aabb", (2, 3)).float(),
        time_range_s=(0.0, duration_s),
        time_mapping="half",
    )
    ordered = [name for name in HEAD_NAMES if name in heads]
    pairs = {name: tuple(_layer(net, f"{_HEADS[name]}.{k}") for k in (1, 3)) for name in ordered}
    return HexPlaneMotion(
        planes=planes,
        decoder=MotionDecoder(trunk=_trunk(net), heads=pairs),
        moving_index=torch.arange(count),
        rotation="additive",
    )


def _levels(net: Mapping[str, Tensor]) -> tuple[tuple[Tensor, ...], ...]:
    found = [int(match[1]) for name in net if (match := _PLANE.fullmatch(name))]
    levels = []
    for level in range(max(found, default=0) + 1):
        names = [f"grid.grids.{level}.{k}" for k in range(len(PLANE_NAMES))]
        stored = [take_floats(net, name, (1, None, None, None)) for name in names]
        levels.append(tuple(plane[0].permute(1, 2, 0).float().contiguous() for plane in stored))
    return tuple(levels)


def _trunk(net: Mapping[str, Tensor]) -> tuple[Layer, ...]:
    """Linear layers of the trunk: every second entry of the sequence."""
    found = [int(match[1]) for name in net if (match := _TRUNK.fullmatch(name))]
    return tuple(_layer(net, f"feature_out.{k}") for k in range(0, max(found, default=0) + 1, 2))


def _layer(net: Mapping[str, Tensor], name: str) -> Layer:
    weight = take_floats(net, f"{name}.weight", (None, None)).float()
    bias = take_floats(net, f"{name}.bias", (len(weight),)).float()
    return Layer(weight=weight, bias=bias)


def _require_harmonics(motion: HexPlaneMotion, gaussians: Gaussians) -> None:
    head = motion.decoder.heads.get("color")
    want = 3 * gaussians.sh.shape[1]
    if head is not None and len(head[1].bias) != want:
        raise FileFormatError(
            f"shs_deform: expected {want} outputs for the harmonics of the PLY, got "
            f"{len(head[1].bias)}; leave the head 'color' out"
        )
