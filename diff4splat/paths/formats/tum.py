"""TUM trajectories: ``timestamp tx ty tz qx qy qz qw`` per line.

Axes: ``t`` poses. Seconds, world_from_camera, OpenCV axes; lines that begin with ``#`` are
comments. There are no intrinsics: the reader takes them from a default camera, the writer leaves
them away (https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats).
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.geometry import quaternion, rigid
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.formats.checks import checked_path
from diff4splat.paths.formats.source import PathSource
from diff4splat.paths.formats.text_table import TextTable, read_table

COLUMNS = 8
_LAYOUT = "timestamp tx ty tz qx qy qz qw"
_ROUNDING = 1e-3


def parse(text: str, source: PathSource) -> CameraPath:
    """Poses as in the file, float64, with the intrinsics of ``source.view``.

    Raises:
        FileFormatError: naming the line.
    """
    table = read_table(text, COLUMNS, source.name, _LAYOUT)
    quats = _unit_quats(table, source.name)
    poses = rigid.from_parts(quaternion.to_matrix(quats), table.rows[:, 1:4])
    cameras = source.view.to(torch.float64).with_pose(poses)
    return checked_path(cameras, table.rows[:, 0], table.labels, source.name)


def dump(path: CameraPath) -> str:
    """The text of a file; intrinsics are not part of this format."""
    cameras = path.cameras.to(torch.float64)
    quats = quaternion.from_matrix(cameras.world_from_camera[:, :3, :3])
    rows = (
        torch.cat([path.times_s.double()[:, None], cameras.position, quats.roll(-1, -1)], -1) + 0.0
    )
    lines = [" ".join(f"{value:.17g}" for value in row) for row in rows.tolist()]
    return "\n".join([f"# {_LAYOUT}", *lines, ""])


def _unit_quats(table: TextTable, name: str) -> Float[Tensor, "t 4"]:
    quats = table.rows[:, 4:].roll(1, -1)
    length = quats.norm(dim=-1)
    bad = ~((length - 1).abs() <= _ROUNDING)
    if bool(bad.any()):
        index = int(bad.int().argmax())
        raise FileFormatError(
            f"{name}: {table.labels[index]}: expected a unit quaternion qx qy qz qw, got length "
            f"{float(length[index]):g}; check the order of the columns"
        )
    return quats
