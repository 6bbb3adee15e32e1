"""A smooth surface goes on through a hole and stays within the known values."""

import torch
from image_layers import box_mask

from diff4splat.generation.layered_image.disoccluded.even_extension import extended_evenly

SIDE = 48


def test_a_plane_goes_on_through_a_hole() -> None:
    rows = torch.arange(SIDE, dtype=torch.float64)
    plane = (0.1 + 0.01 * rows)[:, None] + 0.002 * rows
    found = extended_evenly(torch.where(box_mask(), 9.0, plane), ~box_mask())
    assert torch.equal(found[~box_mask()], plane[~box_mask()])
    assert float((found - plane)[box_mask()].abs().max()) < 0.015


def test_extension_stays_within_the_known_values() -> None:
    generator = torch.Generator().manual_seed(0)
    for height, width in ((1, 1), (1, 9), (7, 1), (5, 13), (33, 20)):
        values = torch.rand(height, width, generator=generator)
        known = torch.rand(height, width, generator=generator) > 0.8
        known[0, 0] = True
        found = extended_evenly(torch.where(known, values, torch.nan), known)
        least, most = values[known].min(), values[known].max()
        assert bool(((found >= least - 1e-6) & (found <= most + 1e-6)).all())
