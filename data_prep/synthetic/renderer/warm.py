"""Compilation ahead of use: visible, once per machine.

Kernels compile when they are first called and are then loaded from disk. A tiny world, drawn with
everything that can be asked for, calls each of them once. Whoever starts processes that draw
compiles first, or each of them would for itself.
"""

import time
from collections.abc import Callable

import numpy as np
import torch

from diff4splat import jit
from diff4splat.data.clip import ClipMetadata
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.compiled import KERNELS
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.world import Light, Mesh, Sky, Texture, World, WorldObject
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.progress.phases import Phases


def prepare_drawing(phases: Phases) -> None:
    """Before worlds are drawn: compile what draws them, unless that is done."""
    if not is_ready():
        compile_drawing(phases)


def compile_drawing(phases: Phases) -> tuple[str, ...]:
    """Load or compile every kernel as a phase; returns the names of the compiled ones."""
    compiled = []
    with phases.phase("compile", kernel_count()) as advance:

        def one_more(name: str) -> None:
            compiled.append(name)
            advance()

        warm(one_more)
    return tuple(compiled)


def is_ready() -> bool:
    """Whether every kernel was compiled before, in this process or on this machine."""
    return all(map(jit.is_ready, KERNELS))


def kernel_count() -> int:
    """How many kernels `warm` goes through."""
    return len(KERNELS)


def warm(advance: Callable[[str], None] = lambda name: None) -> float:
    """Load or compile every kernel; ``advance`` hears the names of compiled ones.

    Returns the seconds.
    """
    began = time.perf_counter()
    with jit.announced(KERNELS, advance):
        draw_clip(_tiny_world(), DrawSettings(samples_per_side=1, tracks=1, shadow_px=16))
    return time.perf_counter() - began


def _tiny_world() -> World:
    """A triangle that stands still for two frames, under a sky."""
    return World(
        note=ClipMetadata(identifier="warm", source="warm", license="CC0-1.0", metric="exact"),
        times_s=np.array([0.0, 1.0]),
        objects=(_triangle(),),
        light=Light(
            color=np.ones(3),
            toward=np.array([0.0, -1.0, 0.0]),
            sky=np.ones(3),
            ground=np.ones(3),
        ),
        sky=Sky(zenith=np.ones(3), horizon=np.ones(3), clouds=0.5, haze_per_m=0.0, seed=0),
        views=(_camera(),),
    )


def _camera() -> Camera:
    camera = pinhole(8.0, (8, 8), torch.float64)
    return camera.with_pose(torch.eye(4, dtype=torch.float64).repeat(2, 1, 1))


def _triangle() -> WorldObject:
    corners = np.array([[-1.0, -1.0, 4.0], [1.0, -1.0, 4.0], [0.0, 1.0, 4.0]])
    return WorldObject(
        instance=1,
        mesh=Mesh(
            triangles=np.array([[0, 1, 2]], np.int32),
            rest=corners,
            uv=np.zeros((3, 2)),
            smooth=False,
        ),
        texture=Texture(family="plain", colors=np.full((2, 3), 0.5), scale=1.0, seed=0),
        positions=corners[None],
    )
