"""Objects of any size, turned anyhow, on a surface or above it.

A large one before a far backdrop is the composition of a portrait. In high arrangements all objects
are far above the surface: seen from above, near objects have a far backdrop without any transition.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.layout.floor_plan import PlacedObject
from diff4splat.data_prep.synthetic.motions.context import rest_positions
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.registry import PERSON
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import about_y
from diff4splat.data_prep.synthetic.splits import Split

SIZES_M, PORTRAIT_SIZES_M = (0.18, 1.1), (0.8, 1.5)
LEAST, MOST, MOST_IN_PORTRAIT = 3, 10, 3
UPRIGHT_SHARE, STANDING_SHARE = 0.5, 0.7
UPRIGHT_KIND_SHARE = 0.8
"""People, animals and furniture rarely lie."""
SPREAD_M, LIFT_M = 1.3, 0.9
HIGH_LIFT_M = (0.3, 3.0)
"""Of objects of high arrangements, evenly by the logarithm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arranged:
    """A placed object and the sphere that holds it."""

    placed: PlacedObject
    center_m: Float64[np.ndarray, "3"]
    radius_m: float


def arrange(split: Split, rng: Rng, *, is_portrait: bool, is_high: bool) -> list[Arranged]:
    """Objects around the origin, the largest near the middle."""
    sizes = PORTRAIT_SIZES_M if is_portrait else SIZES_M
    limits = (1, MOST_IN_PORTRAIT) if is_portrait else (LEAST, MOST)
    count = rng.integer(*limits)
    lift = _high_lift if is_high else _low_lift
    return [_object(split, sizes, rng.child("object", n), lift) for n in range(count)]


def _low_lift(rng: Rng) -> float:
    return 0.0 if rng.bernoulli(STANDING_SHARE) else rng.uniform(0.0, LIFT_M)


def _high_lift(rng: Rng) -> float:
    return rng.log_uniform(*HIGH_LIFT_M)


def _object(
    split: Split,
    sizes_m: tuple[float, float],
    rng: Rng,
    lift_m: Callable[[Rng], float],
) -> Arranged:
    family, shape = split.draw_shape(rng)
    extent = float(np.max(shape.bounds[1] - shape.bounds[0])) / shape.height
    size = rng.log_uniform(*sizes_m)
    shape = shape.of_height(size / extent)
    turn = about_y(rng.uniform(0.0, 2 * np.pi))
    is_upright_kind = family == PERSON or shape.parts[0].image is not None
    if not rng.bernoulli(UPRIGHT_KIND_SHARE if is_upright_kind else UPRIGHT_SHARE):
        turn = _any_turn(rng)
    parts = [part @ turn.T for part in rest_positions(shape)]
    points = np.concatenate([part.reshape(-1, 3) for part in parts])
    low, high = points.min(0), points.max(0)
    spread = SPREAD_M * rng.uniform_array(-1.0, 1.0, 2)
    shift = np.array([spread[0], -lift_m(rng) - high[1], spread[1]])
    placed = PlacedObject(
        family=family, shape=shape, parts=tuple(part + shift for part in parts), size_m=shape.height
    )
    radius = 0.5 * float(np.linalg.norm(high - low))
    return Arranged(placed=placed, center_m=0.5 * (low + high) + shift, radius_m=radius)


def _any_turn(rng: Rng) -> Float64[np.ndarray, "3 3"]:
    """A rotation, evenly from all (from a random unit quaternion)."""
    w, x, y, z = _unit(rng.normal(4))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _unit(vector: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)
