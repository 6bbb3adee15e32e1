"""Our tracer against Mitsuba 3 where both follow the same rules; skipped without Mitsuba.

``pip install mitsuba==3.7.1``, with a libLLVM that it finds (14 or 15).
"""

import importlib.util
from collections.abc import Callable

import numpy as np
import oracles_mitsuba as mitsuba
import pytest
import torch

from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians

pytestmark = [
    pytest.mark.skipif(
        importlib.util.find_spec("mitsuba") is None,
        reason=f"needs Mitsuba; pip install mitsuba=={mitsuba.VERSION}",
    ),
    # It may warn about anything.
    pytest.mark.filterwarnings("ignore"),
]
MOST_DIFFERENCE = 1e-5
RAYS = 2000
BANDS = (1, 4, 9, 16)
Record = Callable[[str, object], None]


def ours(gaussians: Gaussians, rays: Rays, backend: str) -> np.ndarray:
    if backend == "reference":
        gaussians = gaussians.to(torch.float64)
        rays = Rays(origins=rays.origins.double(), directions=rays.directions.double())
    return trace(gaussians, rays, settings=mitsuba.RULES, backend=backend).rgb.double().numpy()


def assert_agreement(gaussians: Gaussians, rays: Rays, least_share: float, record: Record) -> None:
    """Rays are chosen before anything is drawn."""
    hitting, ordered, chosen = mitsuba.comparable(gaussians, rays)
    share = chosen.sum() / hitting.sum()
    record("share_of_rays_in_one_order", float(ordered.sum() / hitting.sum()))
    record("share_of_rays_compared", float(share))
    assert share >= least_share
    want = mitsuba.traced(gaussians, rays).double().numpy()
    for backend in ("compiled", "reference"):
        difference = np.abs(ours(gaussians, rays, backend) - want).max(1)
        record(f"largest_difference_{backend}", float(difference[chosen].max()))
        assert difference[chosen].max() <= MOST_DIFFERENCE, backend


@pytest.mark.parametrize("bands", BANDS)
def test_in_layers_where_every_order_is_the_same(bands: int, record_property: Record) -> None:
    gaussians, rays = mitsuba.shells(0, bands), mitsuba.forward_rays(1, RAYS, spread=0.0)
    assert_agreement(gaussians, rays, 0.95, record_property)


@pytest.mark.parametrize("bands", BANDS)
def test_in_a_crowd_where_entries_come_as_peaks_do(bands: int, record_property: Record) -> None:
    gaussians, rays = mitsuba.crowd(2, bands), mitsuba.forward_rays(3, RAYS, spread=0.5)
    assert_agreement(gaussians, rays, 0.85, record_property)


def test_layers_are_the_same_in_any_order_by_construction() -> None:
    gaussians, rays = mitsuba.shells(0, 1), mitsuba.forward_rays(1, RAYS, spread=0.0)
    met = mitsuba.meetings(gaussians, rays)
    hit = met.inside()
    assert int(hit.sum(1).max()) >= 4
    for i in np.flatnonzero(hit.any(1)):
        members = np.flatnonzero(hit[i])
        assert (np.argsort(met.tau[i, members]) == np.argsort(met.entry[i, members])).all()
