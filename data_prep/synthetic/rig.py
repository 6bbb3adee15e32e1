"""Standing cameras around the stage, as in a capture studio: many views of one world at once.

The first camera looks along +z and is the one that the world is arranged for. The others stand on
an arc around the stage in two rows. The last two stand between others, so that what is learnt from
the rest can be judged from where none of them stood.
"""

import numpy as np

from diff4splat.data_prep.synthetic.cameras import Lens, Shot
from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.layout.kinds import SceneKind

HALF_ARC_DEG = 55.0
ROW_GAP_RAD = 0.22
"""How much steeper the upper row looks down."""
KEPT_BACK = ((-0.28, 0.5), (0.41, 0.35))
"""(share of the half arc, share of the way to the upper row) of the last two cameras."""


def rig_shots(kind: SceneKind, lens: Lens, stage_m: float, views: int, draws: Draws) -> list[Shot]:
    """``views`` standing cameras; four at the least, so that two are left to learn from."""
    half = np.tan(np.radians(lens.fov_deg) / 2)
    distance = float(stage_m * draws.between(0.72, 0.8) / half) + 0.25 * stage_m
    tilt = float(np.radians(draws.between(*kind.tilt_deg)))
    places = [(0.0, 0.0), *_arc(views - 1 - len(KEPT_BACK)), *KEPT_BACK]
    return [
        Shot(
            azimuth_rad=float(np.radians(HALF_ARC_DEG)) * side,
            tilt_rad=tilt + ROW_GAP_RAD * row,
            distance_m=distance,
            path="static",
        )
        for side, row in places
    ]


def _arc(count: int) -> list[tuple[float, float]]:
    """Places from end to end, in the lower and the upper row by turns."""
    sides = np.linspace(-1.0, 1.0, count)
    return [(float(side), float(number % 2)) for number, side in enumerate(sides)]
