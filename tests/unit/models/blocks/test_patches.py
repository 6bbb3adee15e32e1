import oracles_models as oracle
import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.models.blocks.patches import fill_first_pack, pack_frames, patchify, unpatchify


@pytest.mark.parametrize("frames", [1, 5, 49])
def test_pack_frames_matches_a_loop(frames: int) -> None:
    video = torch.randn(2, 6, frames, 2, 3)
    torch.testing.assert_close(pack_frames(video), oracle.packed_frames(video), atol=0, rtol=0)


@pytest.mark.parametrize("frames", [2, 4, 8, 0])
def test_other_frame_counts_are_refused(frames: int) -> None:
    with pytest.raises(ShapeError, match=rf"expected 1 \+ 4 k, got {frames}"):
        fill_first_pack(torch.zeros(1, 1, frames, 2, 2))


@pytest.mark.parametrize("patch", [(1, 2, 2), (4, 2, 2), (2, 1, 3)])
def test_patchify_matches_a_loop(patch: tuple[int, int, int]) -> None:
    maps = torch.randn(2, 3, 4, 4, 6)
    torch.testing.assert_close(patchify(maps, patch), oracle.patches(maps, patch), atol=0, rtol=0)


@pytest.mark.parametrize("patch", [(1, 2, 2), (2, 1, 3)])
def test_unpatchify_undoes_patchify_up_to_the_order_in_a_block(patch: tuple[int, int, int]) -> None:
    maps = torch.randn(2, 5, 4, 2, 6)
    channels_last = patchify(maps, patch).unflatten(-1, (5, -1)).transpose(-1, -2).flatten(-2)
    torch.testing.assert_close(unpatchify(channels_last, patch), maps, atol=0, rtol=0)


def test_sides_must_be_multiples_of_the_patch() -> None:
    with pytest.raises(ShapeError, match=r"expected a multiple of \(1, 2, 2\)"):
        patchify(torch.zeros(1, 1, 1, 4, 5), (1, 2, 2))
