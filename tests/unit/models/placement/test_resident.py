"""Streamed blocks stay on a device with room for them, and compute the same."""

import pytest
import torch
from oracles_models import randomised

from diff4splat.models.blocks.streamed_block import StreamedBlock, stream_blocks
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.placement import resident
from diff4splat.models.placement.resident import keep_blocks, keep_within
from diff4splat.models.video_dit.dit import VideoDiT


def streamed() -> tuple[VideoDiT, list[StreamedBlock]]:
    torch.manual_seed(0)
    network = randomised(VideoDiT(tiny_size())).requires_grad_(False)
    network.blocks.to(torch.bfloat16)
    stream_blocks(network)
    return network, list(network.blocks)


def inputs() -> tuple[torch.Tensor, torch.Tensor]:
    return torch.randn(1, 4, 2, 4, 4, generator=torch.Generator().manual_seed(1)), torch.ones(1, 2)


def test_as_many_blocks_are_kept_as_there_is_room_for() -> None:
    network, (first, second) = streamed()
    copy, size = first.largest_copy_bytes, first.stored_bytes
    assert copy == 2 * size, "stored in half the width of the computation"
    assert keep_within([network], copy + size - 1) == 0 and first.kept is None
    assert keep_within([network], copy + size) == 1 and second.kept is None
    assert keep_within([network], copy + size) == 2, "those that are kept take nothing more"


@torch.no_grad()
def test_kept_blocks_compute_the_same_bits() -> None:
    network, blocks = streamed()
    before = network(*inputs())
    assert keep_within([network], 1 << 30) == 2
    assert torch.equal(network(*inputs()), before)
    assert all(value.dtype == torch.bfloat16 for value in blocks[0].kept.values())
    keys = [key for key in network.state_dict() if "kept" in key]
    assert not keys


def test_another_device_forgets_what_was_kept() -> None:
    network, (first, _) = streamed()
    keep_within([network], 1 << 30)
    first.to(torch.float64)
    assert first.kept is not None, "the same device"
    first.to("meta")
    assert first.kept is None


@pytest.mark.parametrize(("kind", "kept"), [("cpu", 0), ("cuda", 2)])
def test_only_a_gpu_keeps_blocks(kind: str, kept: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resident.torch.cuda, "mem_get_info", lambda _: (1 << 30, 1 << 30))
    network, _ = streamed()
    assert keep_blocks([network], torch.device(kind)) == kept
