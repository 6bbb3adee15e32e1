"""Bytes per Gaussian and per pair of tile and Gaussian: kept, and at the peak of a process."""

import dataclasses
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from oracles_raster import cloud, leaves, render_raster, wide_camera
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from diff4splat.render.api import render
from diff4splat.render.raster import function
from diff4splat.render.raster.backward import Drawn
from diff4splat.render.raster.jit import GROUP
from diff4splat.render.raster.padded_image import PaddedImage
from diff4splat.render.settings import RenderSettings

SUPPORT = Path(__file__).parents[3] / "support"
CAMERA = wide_camera((64, 64))
COUNT = 3000


def arrays_in(thing: object) -> list[np.ndarray]:
    """Every array that ``thing`` holds."""
    if isinstance(thing, np.ndarray):
        return [thing]
    if isinstance(thing, PaddedImage):
        return arrays_in(list(vars(thing).values()))
    if dataclasses.is_dataclass(thing):
        return arrays_in([getattr(thing, field.name) for field in dataclasses.fields(thing)])
    if isinstance(thing, list | tuple):
        return [array for part in thing for array in arrays_in(part)]
    return []


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> list[Drawn]:
    """What images keep for the way back."""
    GROUP.ensure_compiled()
    made = []

    def make(**parts: object) -> Drawn:
        made.append(Drawn(**parts))
        return made[-1]

    monkeypatch.setattr(function, "Drawn", make)
    return made


def test_what_is_kept_for_the_way_back(kept: list[Drawn]) -> None:
    render_raster(leaves(cloud(COUNT, spread_px=1.0)), CAMERA, "rgb")
    (drawn,) = kept
    pairs = len(drawn.filled.lists.members)
    pixels = 5 * 64 * 64 * 4
    total = sum(array.nbytes for array in arrays_in(drawn))
    # A footprint of eight doubles; depth, order, colours and the first slot; little more.
    assert 64 * COUNT < total - pixels - 8 * pairs <= 112 * COUNT


def test_several_regions_keep_no_lists(kept: list[Drawn]) -> None:
    many = leaves(cloud(COUNT, spread_px=20.0))
    render_raster(many, CAMERA, "rgb", tile_px=8, memory_bytes=1 << 20)
    (drawn,) = kept
    assert len(drawn.binned.regions) > 2
    assert drawn.filled is None


class LargestTensor(TorchDispatchMode):
    """Watches every operation for the largest tensor it makes."""

    largest_bytes = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        made = func(*args, **(kwargs or {}))
        for tensor in tree_leaves(made):
            if isinstance(tensor, torch.Tensor):
                self.largest_bytes = max(self.largest_bytes, tensor.nbytes)
        return made


@pytest.mark.parametrize("channels", [0, 1, 40])
def test_pairs_of_many_channels_fit_in_the_memory_too(channels: int) -> None:
    own = leaves(cloud(1000, spread_px=20.0))
    features = torch.rand(1000, channels)
    settings = RenderSettings(features=features, memory_bytes=1 << 20, tile_px=8)
    with LargestTensor() as watch:
        made = render(own, CAMERA, outputs=("rgb", "features"), settings=settings, backend="raster")
        (made.rgb.sum() + made.features.sum()).backward()
    assert watch.largest_bytes <= settings.memory_bytes


MEASURE = """
import gc, json
from oracles_raster import PARAMETERS, cloud, leaves, render_raster, wide_camera
from diff4splat.render.raster import forward

def status(name):
    with open("/proc/self/status") as lines:
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(name))

def growth(call):
    gc.collect()
    with open("/proc/self/clear_refs", "w") as peak:
        peak.write("5")
    before = status("VmRSS")
    made = call()
    return status("VmHWM") - before, made

pairs, fill = [0], forward.fill_region
def watched(*arguments):
    made = fill(*arguments)
    pairs[0] += len(made.lists.members)
    return made

camera, count = wide_camera((256, 256)), 1_000_000
render_raster(leaves(cloud(10)), camera, "rgb").rgb.sum().backward()
crowd = leaves(cloud(count, spread_px=0.5))
forward.fill_region = watched
forward_bytes, made = growth(lambda: render_raster(crowd, camera, "rgb").rgb.sum())
backward_bytes, _ = growth(made.backward)
kept = sum(getattr(crowd, name).grad.nbytes for name in PARAMETERS)
print(json.dumps([count, pairs[0], forward_bytes, backward_bytes - kept]))
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="needs Linux's /proc")
def test_a_million_gaussians_take_little_beyond_themselves(
    record_property: Callable[[str, object], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Freed memory goes back at once, so that the growth of the process is that of the renderer.
    monkeypatch.setenv("MALLOC_MMAP_THRESHOLD_", "65536")
    header = f"import sys; sys.path.insert(0, {str(SUPPORT)!r})\n"
    done = subprocess.run(
        [sys.executable, "-c", header + MEASURE],
        capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    count, pairs, forward_bytes, backward_bytes = json.loads(done.stdout)
    planes = 6 * 4 * 256 * 256
    allowed = 200 * count + 64 * pairs + 10 * planes
    figure = f"{count} Gaussians, {pairs} pairs: {forward_bytes} + {backward_bytes} bytes"
    record_property("memory", figure)
    assert forward_bytes <= allowed, figure
    assert forward_bytes + backward_bytes <= allowed, figure
