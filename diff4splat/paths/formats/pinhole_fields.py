"""Pinhole intrinsics out of one ``transforms.json`` record: fl_x fl_y cx cy, or fields of view.

A missing focal length is that of the other axis, a missing principal point the middle of the
image; without any focal length the view's stands in. Lens distortion is refused.
"""

import math
from collections.abc import Mapping

from diff4splat.errors import FileFormatError
from diff4splat.geometry.camera import Camera
from diff4splat.paths.formats.json_fields import numbers, optional_number
from diff4splat.paths.messages import quoted

_PLAIN_MODELS = {"PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE"}
"""Without distortion coefficients all of these are pinhole cameras."""

_DISTORTION = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")

Record = Mapping[str, object]


def pinhole_px(record: Record, where: str, view: Camera) -> tuple[float, float, float, float]:
    """(f_x, f_y, c_x, c_y) in an image of the size of ``view``.

    Raises:
        FileFormatError: naming the key.
    """
    _require_pinhole(record, where)
    height, width = view.size_px
    across = _focal_px(record, ("fl_x", "camera_angle_x"), width, where)
    along = _focal_px(record, ("fl_y", "camera_angle_y"), height, where)
    if across is None:
        across = float(view.focal_px[0]) if along is None else along
        along = float(view.focal_px[1]) if along is None else along
    column, row = optional_number(record, "cx", where), optional_number(record, "cy", where)
    return (
        across,
        across if along is None else along,
        width / 2 if column is None else column,
        height / 2 if row is None else row,
    )


def _focal_px(record: Record, keys: tuple[str, str], side_px: int, where: str) -> float | None:
    focal_px = optional_number(record, keys[0], where)
    angle_rad = optional_number(record, keys[1], where)
    if focal_px is not None or angle_rad is None:
        return focal_px
    if not 0 < angle_rad < math.pi:
        raise FileFormatError(
            f"{where}: '{keys[1]}': expected a field of view between 0 and pi radians, "
            f"got {angle_rad:g}; repair the file"
        )
    return 0.5 * side_px / math.tan(angle_rad / 2)


def _require_pinhole(record: Record, where: str) -> None:
    model = record.get("camera_model", "PINHOLE")
    if not isinstance(model, str) or model.upper() not in _PLAIN_MODELS:
        raise FileFormatError(
            f"{where}: expected a pinhole camera_model, got {quoted(model)}; "
            "undistort the images first"
        )
    coefficients = [(key, optional_number(record, key, where) or 0.0) for key in _DISTORTION]
    packed = record.get("distortion_params")
    if isinstance(packed, list):
        values = numbers(record, "distortion_params", len(packed), where)
        coefficients += [("distortion_params", value) for value in values]
    for key, value in coefficients:
        if value != 0:
            raise FileFormatError(
                f"{where}: expected no lens distortion, got {key} = {value:g}; "
                "undistort the images first"
            )
