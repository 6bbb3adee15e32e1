"""The displacement field of cells, and offsets of pixels."""

import torch

from diff4splat.models.motion_unet.motion_field import UNIT, masked_offsets, upsample_to_pixels


def test_a_field_is_smooth_at_pixels() -> None:
    field = torch.arange(4.0).expand(3, 2, 4, 4)
    rows = upsample_to_pixels(field)
    assert rows.shape == (2, 3, 16, 16)
    # Bilinear with half-pixel centres: a ramp stays one up to half a cell from the border.
    want = (torch.arange(2, 14) + 0.5) / 4 - 0.5
    torch.testing.assert_close(rows[0, 0, 5, 2:14], want)


def test_only_pixels_of_the_mask_move_and_offsets_grow_with_depth() -> None:
    field = torch.zeros(3, 2, 4, 4)
    field[1, 1] = 2.0
    mask = torch.zeros(16, 16, dtype=torch.bool)
    mask[3:6, 2:9] = True
    depth = torch.rand(16, 16) + 1
    offsets = masked_offsets(upsample_to_pixels(field), mask, depth)
    assert offsets.shape == (2, 16, 16, 3)
    torch.testing.assert_close(offsets[1, ..., 1], 2 * UNIT * depth * mask)
    assert not offsets[0].any() and not offsets[1, ..., 0].any()


def test_there_is_a_gradient_to_field_and_mask() -> None:
    field = torch.randn(3, 2, 4, 4, dtype=torch.float64, requires_grad=True)
    mask = torch.rand(16, 16, dtype=torch.float64, requires_grad=True)

    def offsets(field: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        return masked_offsets(upsample_to_pixels(field), mask, torch.ones(16, 16).double())

    assert torch.autograd.gradcheck(offsets, (field, mask), fast_mode=True)
