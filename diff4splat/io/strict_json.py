"""Values out of a JSON object by key; a missing or wrong one is refused by file and name.

``where`` is the file, and what of it, for messages. Finite numbers of double precision survive
being written and read bit for bit.
"""

import math
from collections.abc import Collection, Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError, InputError
from diff4splat.geometry.rigid import require_rigid
from diff4splat.paths.formats.json_fields import kind_of, numbers, optional_number
from diff4splat.paths.messages import quoted

JsonObject = Mapping[str, object]
_FARTHEST = 1 << 48


def take_object(source: JsonObject, key: str, where: str) -> dict[str, object]:
    """The object under ``key``."""
    return as_object(source.get(key), f"{where}: '{key}'")


def as_object(value: object, where: str) -> dict[str, object]:
    """``value`` itself when it is an object.

    Raises:
        FileFormatError: it is something else.
    """
    if not isinstance(value, dict):
        raise FileFormatError(f"{where}: expected an object, got {kind_of(value)}; repair the file")
    return value


def take_list(source: JsonObject, key: str, where: str) -> list[object]:
    """The list under ``key``, with something in it."""
    values = source.get(key)
    if not isinstance(values, list) or not values:
        raise FileFormatError(
            f"{where}: '{key}': expected a list with entries, got {kind_of(values)}; repair it"
        )
    return values


def take_text(source: JsonObject, key: str, where: str, among: Collection[str] = ()) -> str:
    """The text under ``key``, one of ``among`` where they are given."""
    value = source.get(key)
    if not isinstance(value, str) or (among and value not in among):
        wanted = f"one of {', '.join(among)}" if among else "text"
        raise FileFormatError(
            f"{where}: '{key}': expected {wanted}, got {kind_of(value)}; repair the file"
        )
    return value


def optional_text(source: JsonObject, key: str, where: str) -> str | None:
    """The text under ``key``; None where there is none."""
    return None if source.get(key) is None else take_text(source, key, where)


def take_flag(source: JsonObject, key: str, where: str) -> bool:
    """True or false."""
    value = source.get(key)
    if not isinstance(value, bool):
        raise FileFormatError(
            f"{where}: '{key}': expected true or false, got {kind_of(value)}; repair the file"
        )
    return value


def take_number(source: JsonObject, key: str, where: str) -> float:
    """The finite number under ``key``."""
    value = optional_number(source, key, where)
    if value is None:
        raise FileFormatError(f"{where}: '{key}': expected a number, got nothing; repair the file")
    return value


def take_int(source: JsonObject, key: str, where: str, least: int = 0) -> int:
    """The whole number of at least ``least`` under ``key``."""
    value = source.get(key)
    fine = isinstance(value, int) and not isinstance(value, bool) and least <= value <= _FARTHEST
    if not fine:
        raise FileFormatError(
            f"{where}: '{key}': expected a whole number of at least {least}, got "
            f"{quoted(value)[:60]}; repair the file"
        )
    return value


def optional_int(source: JsonObject, key: str, where: str, least: int = 0) -> int | None:
    """The whole number under ``key``; None where there is none."""
    return None if source.get(key) is None else take_int(source, key, where, least)


def take_numbers(source: JsonObject, key: str, count: int, where: str) -> Float[Tensor, " n"]:
    """Exactly ``count`` finite numbers under ``key``, float64."""
    return torch.tensor(numbers(source, key, count, where), dtype=torch.float64)


def take_pose(source: JsonObject, key: str, where: str) -> Float[Tensor, "4 4"]:
    """The rigid 4 × 4 matrix under ``key``, a list of rows, as it stands there."""
    rows = source.get(key)
    if not isinstance(rows, list) or len(rows) != 4:
        raise FileFormatError(f"{where}: '{key}': expected 4 rows, got {kind_of(rows)}; repair it")
    pose = torch.stack([take_numbers({key: row}, key, 4, where) for row in rows])
    try:
        require_rigid(pose, f"{where}: '{key}'")
    except InputError as error:
        raise FileFormatError(str(error)) from error
    if pose[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise FileFormatError(
            f"{where}: '{key}': expected a last row of 0 0 0 1, got {pose[3].tolist()}; perhaps "
            "the matrix is transposed"
        )
    return pose


def exact(number: float | Tensor) -> float:
    """A number on its way into a file.

    Raises:
        InputError: it is not finite, which JSON cannot hold.
    """
    value = float(number.detach() if isinstance(number, Tensor) else number)
    if not math.isfinite(value):
        raise InputError(f"expected finite numbers to write, got {value}")
    return value
