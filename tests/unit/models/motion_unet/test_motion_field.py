"""Motion beside latents: cells, channels and offsets of pixels."""

import torch

from diff4splat.models.motion_unet.motion_field import (
    UNIT,
    append_zero_motion,
    decode_offsets,
    masked_offsets,
    pack_motion,
    unpack_motion,
    upsample_to_pixels,
)


def test_cells_become_channels_and_come_back() -> None:
    cells = torch.randn(2, 3, 3, 8, 6)
    packed = pack_motion(cells, 8)
    assert packed.shape == (2, 12, 3, 4, 3)
    torch.testing.assert_close(unpack_motion(packed), cells)
    torch.testing.assert_close(unpack_motion(pack_motion(cells, 4)), cells)


def test_a_still_motion_adds_zeros() -> None:
    latent = torch.randn(1, 4, 2, 3, 3)
    found = append_zero_motion(latent, 12)
    torch.testing.assert_close(found[:, :4], latent)
    assert found.shape[1] == 16 and not bool(found[:, 4:].any())
    assert append_zero_motion(latent, 0) is latent


def test_offsets_grow_with_depth() -> None:
    cells = torch.zeros(1, 3, 2, 4, 4)
    cells[:, 0, 1] = 2.0
    depth = torch.rand(16, 16) + 1
    found = decode_offsets(pack_motion(cells, 8), torch.full((16, 16, 3), 0.5), depth)
    assert found.shape == (2, 16, 16, 3)
    assert not bool(found[0].any())
    torch.testing.assert_close(found[1, ..., 0], 2 * UNIT * depth)
    assert not bool(found[1, ..., 1:].any())


def test_motion_ends_where_the_colour_does() -> None:
    rgb = torch.zeros(16, 16, 3)
    rgb[:, :8, 0] = 1.0
    cells = torch.zeros(1, 3, 2, 4, 4)
    cells[:, 1, :, :, :2] = 1.0
    found = decode_offsets(pack_motion(cells, 8), rgb, torch.ones(16, 16))[1, ..., 1] / UNIT
    assert bool((found[:, :8] > 0.99).all()) and bool((found[:, 8:] < 0.01).all())


def test_there_is_a_gradient_to_the_motion() -> None:
    motion = torch.zeros(1, 12, 2, 2, 2, requires_grad=True)
    decode_offsets(motion, torch.rand(16, 16, 3), torch.ones(16, 16)).sum().backward()
    torch.testing.assert_close(motion.grad.sum(), torch.tensor(2 * 256 * 3 * UNIT))


def test_only_what_moves_goes_as_the_field_says() -> None:
    field = torch.zeros(3, 2, 4, 4)
    field[1, 1] = 2.0
    moves = torch.zeros(16, 16, dtype=torch.bool)
    moves[3:6, 2:9] = True
    depth = torch.rand(16, 16) + 1
    found = masked_offsets(upsample_to_pixels(field), moves, depth)
    assert found.shape == (2, 16, 16, 3)
    torch.testing.assert_close(found[1, ..., 1], 2 * UNIT * depth * moves)
    assert not found[0].any() and not found[1, ..., 0].any()
