"""Compilation is announced, happens once, and leaves files behind."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from oracles_raster import cloud, leaves, lens_leaves, render_raster, wide_camera

from diff4splat.render.raster.jit import GROUP
from diff4splat.render.settings import OUTPUTS

SUPPORT = Path(__file__).parents[3] / "support"


def compiled() -> dict[str, int]:
    return {kernel.py_func.__name__: len(kernel.signatures) for kernel in GROUP.kernels}


def test_warming_up_compiles_everything_that_images_need() -> None:
    GROUP.precompile()
    before = compiled()
    assert GROUP.is_ready()
    assert GROUP.kernel_count() == len(before)
    assert set(before.values()) == {1}
    camera = lens_leaves(wide_camera((30, 40)), torch.float32)
    for bands in (1, 16):
        for changes in ({}, {"antialias": True, "tile_px": 8, "dilation_px2": 0.0}):
            own = leaves(cloud(40, bands=bands))
            features = torch.rand(40, 5, requires_grad=True)
            made = render_raster(
                own, camera, *OUTPUTS, features=features, flow_camera=camera, **changes
            )
            sum(getattr(made, name).sum() for name in OUTPUTS).backward()
    nobody = cloud(1).select(torch.zeros(0, dtype=torch.long))
    render_raster(leaves(nobody), camera, "rgb").rgb.sum().backward()
    assert compiled() == before


def test_what_is_compiled_has_nothing_to_report() -> None:
    GROUP.precompile()
    heard = []
    assert GROUP.precompile(heard.append) >= 0
    assert heard == []


IMAGE = """
from oracles_raster import cloud, render_raster, wide_camera
from diff4splat.render.raster.jit import GROUP
print(GROUP.is_ready())
render_raster(cloud(3), wide_camera((8, 8)), "rgb")
print(GROUP.is_ready())
render_raster(cloud(3), wide_camera((8, 8)), "rgb")
"""


def draw(folder: Path) -> tuple[list[str], str]:
    """What a fresh interpreter says whose kernels lie in ``folder``."""
    header = f"import sys; sys.path.insert(0, {str(SUPPORT)!r})\n"
    done = subprocess.run(
        [sys.executable, "-c", header + IMAGE],
        capture_output=True, text=True, timeout=500, check=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
    )  # fmt: skip
    return done.stdout.split(), done.stderr


@pytest.mark.slow
def test_the_first_image_on_a_machine_says_what_takes_so_long(tmp_path: Path) -> None:
    said, heard = draw(tmp_path)
    assert said == ["False", "True"]
    first, last = heard.strip().splitlines()
    assert first.startswith("diff4splat: compiling the CPU renderer, once for this machine: ")
    assert set(first.partition("machine: ")[2].split()) == set(compiled())
    assert last.startswith("diff4splat: ready after ")
    assert draw(tmp_path) == (["True", "True"], "")
