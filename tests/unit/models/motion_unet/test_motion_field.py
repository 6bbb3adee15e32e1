"""Motion of cells as displacement of pixels."""

import torch

from diff4splat.models.motion_unet.motion_field import UNIT, masked_offsets, upsample_to_pixels


def test_only_pixels_of_the_mask_are_displaced() -> None:
    field = torch.zeros(3, 2, 4, 4)
    field[1, 1] = 2.0
    mask = torch.zeros(16, 16, dtype=torch.bool)
    mask[3:6, 2:9] = True
    depth = torch.rand(16, 16) + 1
    found = masked_offsets(upsample_to_pixels(field), mask, depth)
    assert found.shape == (2, 16, 16, 3)
    torch.testing.assert_close(found[1, ..., 1], 2 * UNIT * depth * mask)
    assert not found[0].any() and not found[1, ..., 0].any()
