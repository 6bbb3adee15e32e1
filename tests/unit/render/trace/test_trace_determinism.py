"""Equal inputs give equal bits: whatever the threads, the run, the memory and the order of rays."""

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch
from oracles_trace import MOTION, PARAMETERS, answers, image, leaves, motion, scene
from torch import Tensor

from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.render.trace.traversal.packets import bundle_rays

ANSWERS = ("rgb", "distance", "median_distance", "alpha")
CLOUD = replace(
    scene(3000, seed=5, bands=4, dtype=torch.float32),
    scales=0.2 * scene(3000, seed=5, dtype=torch.float32).scales,
)
# More than two parts of packets.
RAYS = replace(image((50, 60), 40.0, torch.float32), time_s=torch.linspace(0, 1, 3000))
MOVING = motion(3000, dtype=torch.float32)


@pytest.fixture(autouse=True)
def _threads() -> Iterator[None]:
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def bits(threads: int = 1, moves: bool = False, **changes: object) -> dict[str, Tensor]:
    """Every answer and every gradient."""
    torch.set_num_threads(threads)
    own, moving = leaves(CLOUD), leaves(MOVING) if moves else None
    rays = {
        name: getattr(RAYS, name).clone().requires_grad_()
        for name in ("origins", "directions", "time_s")
    }
    made = answers(own, Rays(**rays), moving, near_distance=0.2, **changes)
    sum(getattr(made, name).square().mean() for name in ANSWERS).backward()
    found = {name: getattr(made, name).detach() for name in (*ANSWERS, "hits")}
    found |= {f"gradient of {name}": getattr(own, name).grad for name in PARAMETERS}
    found |= {
        f"gradient of {name}": leaf.grad for name, leaf in rays.items() if leaf.grad is not None
    }
    if moving is not None:
        found |= {f"gradient of {name}": getattr(moving, name).grad for name in MOTION}
    return found


def assert_equal_bits(got: dict[str, Tensor], want: dict[str, Tensor]) -> None:
    differ = [name for name in want if not torch.equal(got[name], want[name])]
    assert not differ
    assert all(bool(value.any()) for value in want.values())


@pytest.mark.parametrize("moves", [False, True], ids=["still", "moving"])
@pytest.mark.parametrize("threads", [2, 3])
def test_any_number_of_threads(threads: int, moves: bool) -> None:
    assert_equal_bits(bits(threads, moves), bits(1, moves))


def test_any_number_of_threads_in_little_memory() -> None:
    assert_equal_bits(bits(3, memory_bytes=1 << 20), bits(1, memory_bytes=1 << 20))


def test_run_after_run() -> None:
    first = bits(2)
    for _ in range(2):
        assert_equal_bits(bits(2), first)


def test_little_memory_cuts_packets_and_changes_rounding_only() -> None:
    # Twenty thousand Gaussians at one place: every ray hits all of them.
    one = scene(1, dtype=torch.float32).select(torch.zeros(20_000, dtype=torch.long))
    place = torch.tensor([0.0, 0.0, 3.0])
    wall = replace(
        one, means=place.repeat(20_000, 1), opacities=torch.full((20_000,), 0.005),
        scales=torch.ones(20_000, 3),
    )  # fmt: skip
    rays = image((8, 8), 60.0, torch.float32)
    # One mebibyte holds the hits of four of the sixty-four rays.
    little, plenty = (
        trace(wall, rays, outputs=("rgb", "hits"), settings=TraceSettings(memory_bytes=memory),
              backend="compiled")
        for memory in (1 << 20, 1 << 28)
    )  # fmt: skip
    assert int(plenty.hits.min()) > 1000
    assert torch.equal(little.hits, plenty.hits)
    torch.testing.assert_close(little.rgb, plenty.rgb, rtol=0, atol=1e-5)


def test_rays_in_any_order_see_the_same_up_to_rounding() -> None:
    order = torch.randperm(len(RAYS), generator=torch.Generator().manual_seed(0))
    want = answers(CLOUD, RAYS, near_distance=0.2)
    got = answers(CLOUD, RAYS.select(order), near_distance=0.2)
    torch.testing.assert_close(got.rgb, want.rgb[order], rtol=0, atol=1e-5)


def test_one_ray_sees_what_it_sees_among_others() -> None:
    want = answers(CLOUD, RAYS, near_distance=0.2)
    for i in range(0, 3000, 301):
        alone = answers(CLOUD, RAYS.select(slice(i, i + 1)), near_distance=0.2)
        torch.testing.assert_close(alone.rgb[0], want.rgb[i], rtol=0, atol=1e-5)
        assert int(alone.hits[0]) == int(want.hits[i])


def test_packets_look_the_same_way() -> None:
    generator = torch.Generator().manual_seed(1)
    rays = Rays(
        origins=torch.randn(500, 3, generator=generator),
        directions=torch.randn(500, 3, generator=generator),
    )
    made = bundle_rays(
        rays.origins.numpy(), rays.directions.numpy(), rays.origins.numpy()[:0, 0], 5.0, 2.0
    )
    assert sorted(made.order.tolist()) == list(range(500))
    assert made.starts[0] == 0
    assert made.starts[-1] == 500
    for first, last in zip(made.starts[:-1], made.starts[1:], strict=True):
        own = rays.directions[made.order[first:last]]
        assert 1 <= last - first <= 64
        assert float((own @ own[0]).min()) >= 0.9 - 1e-6
        starts = rays.origins[made.order[first:last]]
        assert float((starts - starts[0]).norm(dim=1).max()) <= 2 * 5.0 / 16 + 1e-6
