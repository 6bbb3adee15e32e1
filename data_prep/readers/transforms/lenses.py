"""Lenses of ``transforms*.json``: distorted pinholes, fisheyes and equirectangular images.

``camera_model`` is that of nerfstudio; instant-ngp's ``is_fisheye`` means the same fisheye. Of a
sphere ``fl_x`` is half the width and ``fl_y`` the height: longitude is π (x − c_x) / fl_x, latitude
π (y − c_y) / fl_y (https://docs.nerf.studio/quickstart/data_conventions.html).
"""

import math
from dataclasses import replace

from diff4splat.data_prep.readers.common.fisheye_lenses import require_fisheye
from diff4splat.data_prep.readers.common.intrinsics import Intrinsics
from diff4splat.errors import FileFormatError
from diff4splat.geometry.camera import pinhole
from diff4splat.paths.formats.json_fields import FrameRecord, image_size, optional_number
from diff4splat.paths.formats.pinhole_fields import Record, pinhole_px

_LENGTHS, _ANGLES = ("fl_x", "fl_y"), ("camera_angle_x", "camera_angle_y")
_STRAIGHTENED = ("k1", "k2", "k3", "p1", "p2")
"""Distortion that can be removed; other coefficients are refused by name."""
_POLYNOMIAL = ("k1", "k2", "k3", "k4")
_ROUNDING_PX = 0.5
"""How far numbers of a sphere may be from those of its image."""


def record_intrinsics(frame: FrameRecord, image_px: tuple[int, int]) -> Intrinsics:
    """The lens of a frame; ``image_px`` stands in where the file says no size.

    Raises:
        FileFormatError: no focal length, a camera model that can neither be straightened nor seen
            through, or numbers that make no sense for it.
    """
    size_px = image_size(frame.fields, ("h", "w"), frame.where) or image_px
    model = frame.fields.get("camera_model")
    name = model.upper() if isinstance(model, str) else ""
    if name == "EQUIRECTANGULAR":
        return _equirectangular(frame, size_px)
    if name == "OPENCV_FISHEYE" or frame.fields.get("is_fisheye") is True:
        return _fisheye(frame, size_px)
    return _distorted(frame, size_px)


def _distorted(frame: FrameRecord, size_px: tuple[int, int]) -> Intrinsics:
    record, where = frame.fields, frame.where
    _require_focal(frame, (*_LENGTHS, *_ANGLES))
    k1, k2, k3, p1, p2 = (optional_number(record, key, where) or 0.0 for key in _STRAIGHTENED)
    straight = _undistorted(record, where, size_px, _STRAIGHTENED)
    return replace(straight, radial=(k1, k2, k3), tangential=(p1, p2))


def _fisheye(frame: FrameRecord, size_px: tuple[int, int]) -> Intrinsics:
    record, where = frame.fields, frame.where
    # A field of view is a focal length by the formula of a pinhole alone.
    _require_focal(frame, _LENGTHS)
    k1, k2, k3, k4 = (optional_number(record, key, where) or 0.0 for key in _POLYNOMIAL)
    straight = _undistorted(record, where, size_px, (*_POLYNOMIAL, *_ANGLES, "camera_model"))
    return require_fisheye(replace(straight, model="fisheye", fisheye=(k1, k2, k3, k4)), where)


def _equirectangular(frame: FrameRecord, size_px: tuple[int, int]) -> Intrinsics:
    height, width = size_px
    whole = {"fl_x": width / 2, "fl_y": height, "cx": width / 2, "cy": height / 2}
    for key, value in whole.items():
        got = optional_number(frame.fields, key, frame.where)
        if got is not None and abs(got - value) > _ROUNDING_PX:
            raise FileFormatError(
                f"{frame.where}: '{key}': expected {value:g}, since an image of {width} x "
                f"{height} is the whole sphere, got {got:g}; give the whole image and remove the "
                "number"
            )
    plain = {"camera_model", *_LENGTHS, *_ANGLES, "cx", "cy"}
    middle = _undistorted(frame.fields, frame.where, size_px, tuple(plain))
    per_radian = (width / (2 * math.pi), height / math.pi)
    return replace(middle, focal_px=per_radian, model="equirectangular")


def _require_focal(frame: FrameRecord, keys: tuple[str, ...]) -> None:
    if all(frame.fields.get(key) is None for key in keys):
        raise FileFormatError(
            f"{frame.where}: expected a focal length ({', '.join(keys)}), got none; add one"
        )


def _undistorted(
    record: Record, where: str, size_px: tuple[int, int], known: tuple[str, ...]
) -> Intrinsics:
    """Without what is ``known`` to be more than a pinhole; whatever else is more is refused."""
    rest = {key: value for key, value in record.items() if key not in known}
    fl_x, fl_y, column, row = pinhole_px(rest, where, pinhole(1.0, size_px))
    return Intrinsics(focal_px=(fl_x, fl_y), center_px=(column, row), size_px=size_px)
