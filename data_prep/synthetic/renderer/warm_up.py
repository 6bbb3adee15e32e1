"""Warm-up of the kernels that draw worlds: a clip of one triangle under a sky."""

import numpy as np
import torch

from diff4splat.data.clip import ClipMetadata
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.world import Light, Mesh, Sky, Texture, World, WorldObject
from diff4splat.geometry.camera import Camera, pinhole


def warm_up() -> None:
    """Call every kernel that draws worlds once."""
    draw_clip(_tiny_world(), DrawSettings(samples_per_side=1, tracks=1, shadow_px=16))


def _tiny_world() -> World:
    """A static triangle in two frames, under a sky."""
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
