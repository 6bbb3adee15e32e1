"""What is coded in place of a number, so that an even error means the same everywhere.

Axes: ``r`` rows.

| name | coded | columns |
|---|---|---|
| ``value`` | the number | any |
| ``probability`` | the number; reading limits it to [0, 1] | any |
| ``log`` | its natural logarithm | any |
| ``smallest_three`` | of a quaternion: which component is largest, and the other three | 4 |
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

Table = Float[np.ndarray, "r c"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Transform:
    """Both directions, in float64."""

    encode: Callable[[Table], Table]
    decode: Callable[[Table], Table]
    """Raises ValueError for numbers that ``encode`` never gives."""


def _same(values: Table) -> Table:
    return values


def _log(values: Table) -> Table:
    """Minus infinity for 0, which no code holds."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(values)


def _exp(values: Table) -> Table:
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        return np.exp(values)


def _limited(values: Table) -> Table:
    return np.clip(values, 0, 1)


def _smallest_three(quats: Float[np.ndarray, "r 4"]) -> Float[np.ndarray, "r 4"]:
    """The sign makes the largest component positive; a zero quaternion is no rotation."""
    scaled = quats / np.maximum(np.abs(quats).max(-1, keepdims=True), 1e-300)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    unit = np.where(length > 0, scaled / np.where(length > 0, length, 1), [1.0, 0, 0, 0])
    largest = np.abs(unit).argmax(-1)[:, None]
    signed = unit * np.sign(np.take_along_axis(unit, largest, -1))
    others = np.take_along_axis(signed, _other_places(largest), -1)
    return np.concatenate([largest, others], -1)


def _from_smallest_three(table: Float[np.ndarray, "r 4"]) -> Float[np.ndarray, "r 4"]:
    largest = np.rint(table[:, :1])
    if not ((largest >= 0) & (largest <= 3)).all():
        raise ValueError("expected largest components from 0 to 3, got another one")
    places, others = largest.astype(np.int64), table[:, 1:]
    if not (np.abs(others) <= 1).all():
        raise ValueError("expected components of at most 1, got a larger one")
    quats = np.empty_like(table)
    np.put_along_axis(quats, _other_places(places), others, -1)
    rest = np.sqrt(np.maximum(1 - np.square(others).sum(-1, keepdims=True), 0))
    np.put_along_axis(quats, places, rest, -1)
    return quats


def _other_places(largest: np.ndarray) -> np.ndarray:
    """The three places that are not the largest component's, in order."""
    places = np.arange(3)[None]
    return places + (places >= largest)


TRANSFORMS: Mapping[str, Transform] = MappingProxyType(
    {
        "value": Transform(encode=_same, decode=_same),
        "probability": Transform(encode=_same, decode=_limited),
        "log": Transform(encode=_log, decode=_exp),
        "smallest_three": Transform(encode=_smallest_three, decode=_from_smallest_three),
    }
)
