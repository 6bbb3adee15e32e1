"""Equal inputs give equal bits: whatever the threads, the run, and the memory."""

from collections.abc import Iterator

import pytest
import torch
from oracles_raster import LENS, PARAMETERS, cloud, leaves, lens_leaves, wide_camera
from torch import Tensor

from diff4splat.render.api import render
from diff4splat.render.raster import forward
from diff4splat.render.raster.jit import GROUP
from diff4splat.render.settings import RenderSettings

OUTPUTS = ("rgb", "depth", "alpha", "median_depth", "features")
CAMERA = wide_camera((120, 190))
# More than two parts of Gaussians, a hundred parts of tiles.
CLOUD = cloud(9000, bands=4, spread_px=3.0)


@pytest.fixture(autouse=True)
def _threads() -> Iterator[None]:
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def bits(threads: int = 1, **changes: object) -> dict[str, Tensor]:
    """Every image and every gradient."""
    torch.set_num_threads(threads)
    own, lens = leaves(CLOUD), lens_leaves(CAMERA, torch.float32)
    features = torch.linspace(-1, 1, 2 * len(CLOUD)).view(-1, 2).requires_grad_()
    settings = RenderSettings(features=features, **changes)
    made = render(own, lens, outputs=OUTPUTS, settings=settings, backend="raster")
    sum(getattr(made, name).square().mean() for name in OUTPUTS).backward()
    images = {name: getattr(made, name).detach() for name in OUTPUTS}
    grads = {f"gradient of {name}": getattr(own, name).grad for name in PARAMETERS}
    grads |= {f"gradient of {name}": getattr(lens, name).grad for name in LENS}
    return images | grads | {"gradient of features": features.grad}


def assert_equal_bits(got: dict[str, Tensor], want: dict[str, Tensor]) -> None:
    differ = [name for name in want if not torch.equal(got[name], want[name])]
    assert not differ


def assert_same_up_to_the_order_of_regions(got: dict[str, Tensor], want: dict[str, Tensor]) -> None:
    """Images bit by bit; sums over regions are rounded region by region."""
    assert_equal_bits({name: got[name] for name in OUTPUTS}, {name: want[name] for name in OUTPUTS})
    for name, exact in want.items():
        scale = max(float(exact.abs().max()), 1e-30)
        torch.testing.assert_close(got[name] / scale, exact / scale, rtol=0, atol=3e-6)


@pytest.mark.parametrize("threads", [2, 3, 5])
def test_any_number_of_threads(threads: int) -> None:
    assert_equal_bits(bits(threads, tile_px=8), bits(1, tile_px=8))


def test_run_after_run() -> None:
    first = bits(2)
    for _ in range(3):
        assert_equal_bits(bits(2), first)


@pytest.fixture
def regions(monkeypatch: pytest.MonkeyPatch) -> list[tuple]:
    """The regions of tiles that are done, in their order."""
    GROUP.ensure_compiled()
    done, fill = [], forward.fill_region

    def watched(*arguments):
        made = fill(*arguments)
        done.append(made.region)
        return made

    monkeypatch.setattr(forward, "fill_region", watched)
    return done


def test_little_memory(regions: list[tuple]) -> None:
    whole = bits(2, tile_px=8)
    assert len(regions) == 1
    regions.clear()
    little = bits(2, tile_px=8, memory_bytes=1 << 20)
    assert len(regions) >= 4
    assert_same_up_to_the_order_of_regions(little, whole)


def test_regions_of_single_tiles(regions: list[tuple], monkeypatch: pytest.MonkeyPatch) -> None:
    whole = bits()
    regions.clear()
    monkeypatch.setattr(forward, "_split", single_tiles)
    assert_same_up_to_the_order_of_regions(bits(), whole)
    assert len(regions) >= 4 * 6


def single_tiles(region: tuple, per_tile: object, limit: int) -> Iterator[tuple]:
    del per_tile, limit
    top, bottom, left, right = region
    for row in range(top, bottom):
        for column in range(left, right):
            yield row, row + 1, column, column + 1
