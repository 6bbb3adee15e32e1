"""RealEstate10K and CameraCtrl text files.

Axes: ``t`` poses. One optional heading (the video's address), then 19 numbers per line: timestamp
in microseconds; f_x f_y c_x c_y, those of x divided by the image width and those of y by its
height; two distortion coefficients (zero); the upper 3×4 of camera_from_world, row by row, OpenCV
axes (https://google.github.io/realestate10k). The image size is not in the file.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.formats.checks import checked_path, exact_poses
from diff4splat.paths.formats.source import PathSource
from diff4splat.paths.formats.text_table import TextTable, read_table

COLUMNS = 19
_LAYOUT = "time, 4 intrinsics, 2 zeros, 12 of the pose"
_LARGEST_NORMALIZED = 50.0
"""A focal length of 50 image widths sees one degree; anything above is a value in pixels."""


def parse(text: str, source: PathSource) -> CameraPath:
    """Poses as in the file, float64; the image size is that of ``source.view``.

    Raises:
        FileFormatError: naming the line.
    """
    table = read_table(text, COLUMNS, source.name, _LAYOUT)
    _require_plain_lens(table, source.name)
    height, width = source.view.size_px
    scale = table.rows.new_tensor([width, height])
    upper = table.rows[:, 7:].unflatten(-1, (3, 4))
    camera_from_world = rigid.from_parts(upper[..., :3], upper[..., 3])
    # The inverse of a rounded rotation is not its transpose: make it exact before inverting.
    camera_from_world = exact_poses(camera_from_world, table.labels, source.name)
    cameras = Camera(
        focal_px=table.rows[:, 1:3] * scale,
        center_px=table.rows[:, 3:5] * scale,
        world_from_camera=rigid.invert(camera_from_world),
        size_px=source.view.size_px,
    )
    return checked_path(cameras, table.rows[:, 0] / 1e6, table.labels, source.name)


def dump(path: CameraPath) -> str:
    """The text of a file; times are rounded to microseconds.

    Raises:
        InputError: two frames lie within one microsecond.
    """
    microseconds = (path.times_s.double() * 1e6).round()
    if bool((microseconds.diff() <= 0).any()):
        raise InputError(
            "camera path: expected frames at least 1 microsecond apart; use transforms.json"
        )
    numbers = _numbers(path.cameras.to(torch.float64)).tolist()
    lines = [
        f"{int(time)} {' '.join(f'{value:.17g}' for value in row)}"
        for time, row in zip(microseconds.tolist(), numbers, strict=True)
    ]
    return "\n".join(["# camera path in RealEstate10K layout", *lines, ""])


def _numbers(cameras: Camera) -> Float[Tensor, "t 18"]:
    height, width = cameras.size_px
    scale = cameras.focal_px.new_tensor([width, height])
    distortion = torch.zeros_like(cameras.focal_px)
    pose = cameras.camera_from_world[:, :3].flatten(-2)
    # Adding zero turns -0.0 into 0.0.
    return (
        torch.cat([cameras.focal_px / scale, cameras.center_px / scale, distortion, pose], -1) + 0.0
    )


def _require_plain_lens(table: TextTable, name: str) -> None:
    for label, row in zip(table.labels, table.rows[:, 1:7].tolist(), strict=True):
        if row[4] != 0 or row[5] != 0:
            raise FileFormatError(
                f"{name}: {label}: expected no lens distortion (columns 6 and 7 zero), got "
                f"{row[4]:g} and {row[5]:g}; undistort the images first"
            )
        if max(row[:2]) > _LARGEST_NORMALIZED:
            raise FileFormatError(
                f"{name}: {label}: expected intrinsics divided by the image size, got a focal "
                f"length of {max(row[:2]):g} image widths; divide f_x, c_x by the width and f_y, "
                "c_y by the height"
            )
