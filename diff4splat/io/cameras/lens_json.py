"""Lenses as plain JSON values, and back without losing a bit.

A lens is named by ``model`` and carries its coefficients; ``formula`` says in words what they mean
and is not read. Angles are radians.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch

from diff4splat.errors import FileFormatError, InputError, ShapeError
from diff4splat.geometry.lenses.blender_fisheye import BlenderFisheye
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.lenses.protocol import Lens
from diff4splat.io.strict_json import (
    JsonObject,
    exact,
    take_flag,
    take_number,
    take_numbers,
    take_text,
)
from diff4splat.paths.formats.json_fields import optional_number

_FORMULAS = {
    "pinhole": "point = (X/Z, Y/Z)",
    "opencv": (
        "point = (X/Z, Y/Z) distorted by OpenCV's rational model: radial k1..k6, tangential p1, "
        "p2, thin prism s1..s4"
    ),
    "fisheye": (
        "point = theta_d (X, Y)/sqrt(X^2 + Y^2), theta_d = theta (1 + k1 theta^2 + k2 theta^4 + "
        "k3 theta^6 + k4 theta^8), theta = atan2(sqrt(X^2 + Y^2), Z); nothing beyond max_angle_rad"
    ),
    "blender": (
        "theta = s (k0 + k1 r + k2 r^2 + k3 r^3 + k4 r^4), r in millimetres on the sensor; s = -1 "
        "with cycles_signs, as in Blender's Cycles, else +1; nothing beyond fov_rad / 2"
    ),
    "equirectangular": "point = (longitude, latitude) = (atan2(X, Z), atan2(Y, sqrt(X^2 + Z^2)))",
}


def lens_json(lens: Lens) -> dict[str, object]:
    """One lens as JSON values.

    Raises:
        InputError: it is of no kind that files know.
    """
    match lens:
        case Pinhole():
            record: dict[str, object] = {"model": "pinhole"}
        case OpenCVPinhole():
            record = {
                "model": "opencv",
                "radial": exact_list(lens.radial),
                "tangential": exact_list(lens.tangential),
                "thin_prism": exact_list(lens.thin_prism),
            }
        case OpenCVFisheye():
            angle = lens.max_angle_rad
            record = {
                "model": "fisheye",
                "coefficients": exact_list(lens.coefficients),
                "max_angle_rad": None if angle is None else exact(angle),
            }
        case BlenderFisheye():
            record = {
                "model": "blender",
                "coefficients": exact_list(lens.coefficients),
                "fov_rad": exact(lens.fov_rad),
                "cycles_signs": lens.cycles_signs,
            }
        case Equirectangular():
            record = {"model": "equirectangular"}
        case _:
            raise InputError(f"lens: expected one of {', '.join(_READERS)}, got {type(lens)}")
    return record | {"formula": _FORMULAS[record["model"]]}


def read_lens(record: JsonObject, where: str) -> Lens:
    """The lens that ``lens_json`` wrote, float64.

    Raises:
        FileFormatError: a value is missing, of another kind, or impossible; names it.
    """
    with as_file_error(where):
        return _READERS[take_text(record, "model", where, tuple(_READERS))](record, where)


def exact_list(values: torch.Tensor) -> list[float]:
    """Finite numbers of any tensor of one axis, in double precision."""
    return [exact(value) for value in values.detach().double()]


@contextmanager
def as_file_error(where: str) -> Iterator[None]:
    """What a constructor refuses is a fault of the file."""
    try:
        yield
    except (InputError, ShapeError) as error:
        raise FileFormatError(f"{where}: {error}") from error


def _opencv(record: JsonObject, where: str) -> Lens:
    return OpenCVPinhole(
        radial=take_numbers(record, "radial", 6, where),
        tangential=take_numbers(record, "tangential", 2, where),
        thin_prism=take_numbers(record, "thin_prism", 4, where),
    )


def _fisheye(record: JsonObject, where: str) -> Lens:
    return OpenCVFisheye(
        coefficients=take_numbers(record, "coefficients", 4, where),
        max_angle_rad=optional_number(record, "max_angle_rad", where),
    )


def _blender(record: JsonObject, where: str) -> Lens:
    return BlenderFisheye(
        coefficients=take_numbers(record, "coefficients", 5, where),
        fov_rad=take_number(record, "fov_rad", where),
        cycles_signs=take_flag(record, "cycles_signs", where),
    )


_READERS: dict[str, Callable[[JsonObject, str], Lens]] = {
    "pinhole": lambda record, where: Pinhole(),
    "opencv": _opencv,
    "fisheye": _fisheye,
    "blender": _blender,
    "equirectangular": lambda record, where: Equirectangular(),
}
