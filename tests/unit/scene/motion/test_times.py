"""Every motion takes finite seconds and refuses anything else, by one check."""

import inspect
import math

import numpy as np
import pytest
import torch
from oracles_hexplane import random_cloud, random_motion

from diff4splat.errors import InputError
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.motion.times import require_time_s

CLOUD = random_cloud(3)
INDEX = torch.tensor([0, 2])
MOTIONS = {
    "static": StaticMotion(),
    "keyframes": KeyframeMotion(
        key_times_s=torch.tensor([0.0, 1.0]).double(),
        moving_index=INDEX,
        offsets=torch.ones(2, 2, 3).double(),
        rotations=torch.ones(2, 2, 4).double(),
        log_scale_offsets=torch.zeros(2, 2, 3).double(),
    ),
    "spacetime": SpacetimeMotion(
        moving_index=INDEX,
        velocities=torch.ones(2, 3).double(),
        time_centers_s=torch.zeros(2).double(),
        time_deviations_s=torch.ones(2).double(),
        time_range_s=(0.0, 1.0),
    ),
    "hexplane": random_motion(INDEX.tolist()),
}
REFUSED = [math.inf, -math.inf, math.nan, True, 10**39, 10**5000, 1e300, "1", None, 1j, np.inf]


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
@pytest.mark.parametrize("time_s", REFUSED, ids=range(len(REFUSED)))
def test_no_motion_takes_what_is_no_time(motion: Motion, time_s: object) -> None:
    with pytest.raises(InputError, match="time_s: expected a finite number of seconds, got"):
        # Annotations are checked in tests, not for users.
        inspect.unwrap(type(motion).state_at)(motion, CLOUD, time_s)


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
@pytest.mark.parametrize("time_s", [0.0, -1e30, 1e30])
def test_finite_times_far_outside_are_held(motion: Motion, time_s: float) -> None:
    state = inspect.unwrap(type(motion).state_at)(motion, CLOUD, time_s)
    assert bool(state.means.isfinite().all())
    assert bool(state.opacities.isfinite().all())


@pytest.mark.parametrize("time_s", [0, -3, 0.5, np.float32(0.5), np.int64(2), torch.tensor(0.5)])
def test_any_finite_number_is_a_time(time_s: object) -> None:
    require_time_s(time_s)
