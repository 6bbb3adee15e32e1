"""Procedural worlds as the truth of written data sets, filmed with each format's own cameras."""

from dataclasses import replace

import numpy as np
import torch
from toy_scene import WORLD, Eye, Truth

from diff4splat.data.clip import Clip
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.world import World
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.geometry.camera import Camera

Lens = tuple[float, float, float, float]


def procedural_truth(
    index: int, size_px: tuple[int, int], lens: Lens, baseline_m: float, static: bool
) -> Truth:
    """World number ``index``, seen by one eye, or by two where there is a base line."""
    recipe = WorldRecipe(seed=3, frames=9, views=1, size_px=(64, 64), still_share=float(static))
    world = make_world(recipe, index)
    poses = world.views[0].world_from_camera
    shifts = (0.0, baseline_m) if baseline_m else (0.0,)
    views = tuple(_camera(poses, shift, lens, size_px) for shift in shifts)
    filmed = replace(world, views=views)
    settings = DrawSettings(tracks=400, threads=1)
    clip = draw_clip(filmed, settings)
    backwards = draw_clip(_reversed(filmed), replace(settings, tracks=0))
    eyes = tuple(_eye(clip, backwards, view, lens) for view in range(len(views)))
    positions = clip.tracks.positions.double().numpy() @ WORLD[:3, :3].T + WORLD[:3, 3]
    view = clip.views[0]
    return Truth(eyes, positions, view.track_uv.double().numpy(), view.track_visible.numpy())


def _camera(poses: torch.Tensor, shift: float, lens: Lens, size_px: tuple[int, int]) -> Camera:
    moved = poses.clone()
    moved[:, :3, 3] += shift * moved[:, :3, 0]
    numbers = torch.tensor(lens, dtype=torch.float64).expand(len(poses), 4)
    return Camera(
        focal_px=numbers[:, :2],
        center_px=numbers[:, 2:],
        world_from_camera=moved,
        size_px=size_px,
    )


def _reversed(world: World) -> World:
    """Last frame first: its flow to the next frame is flow to the previous one."""
    return replace(
        world,
        objects=tuple(
            replace(one, positions=np.ascontiguousarray(one.positions[::-1]))
            for one in world.objects
        ),
        views=tuple(view.with_pose(view.world_from_camera.flip(0)) for view in world.views),
    )


def _eye(clip: Clip, backwards: Clip, number: int, lens: Lens) -> Eye:
    view = clip.views[number]
    depth = view.depth.double().numpy()
    depth = np.where(depth > 0, depth, np.inf)
    # The palettes of the writers have three colours for objects.
    which = np.where(np.isfinite(depth), (view.instances.numpy().astype(int) - 1) % 3, -1)
    return Eye(
        poses=WORLD @ view.cameras.world_from_camera.numpy(),
        lens=np.array(lens),
        rgb=view.rgb.numpy(),
        depth=depth,
        which=which,
        forward=_flow(clip, number, which[:-1]),
        backward=_flow(backwards, number, which[:0:-1])[::-1],
        forward_seen=view.flow.visible.numpy() & (which[:-1] >= 0),
    )


def _flow(clip: Clip, number: int, which: np.ndarray) -> np.ndarray:
    flow = clip.views[number].flow.to_next.double().numpy()
    return np.where(which[..., None] < 0, np.nan, flow)
