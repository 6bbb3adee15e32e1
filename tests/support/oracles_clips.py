"""Clips whose every number is exact: what cameras see of the world of ``oracles_clip_world``."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from oracles_clip_world import (
    KINDS,
    Hits,
    Scene,
    carried,
    make_scene,
    pose_at,
    project_seen,
    see,
)

from diff4splat.data.clip import Clip, ClipMetadata, Flow, ObjectNote, Tracks, View
from diff4splat.geometry.camera import Camera


@dataclass(frozen=True, slots=True)
class _Points:
    """Points that stick to surfaces."""

    which: np.ndarray
    """Object indices."""
    local: np.ndarray
    found_at: np.ndarray
    """(view, frame)"""


def make_clip(
    frames: int = 5,
    size_px: tuple[int, int] = (24, 32),
    views: int = 2,
    static: bool = False,
    seed: int = 0,
    tracks: int = 16,
) -> Clip:
    """A clip called ``clip-<seed>``; ``tracks=0`` leaves tracks out, one frame has empty flow."""
    rng = np.random.default_rng(seed)
    scene = make_scene(frames, static, rng)
    cameras = [_make_camera(view, frames, size_px) for view in range(views)]
    hits = [[see(scene, camera, frame) for frame in range(frames)] for camera in cameras]
    made = [_make_view(scene, camera, seen) for camera, seen in zip(cameras, hits, strict=True)]
    points = _choose_points(hits, tracks, rng)
    world = np.stack([carried(scene, points.which, points.local, t) for t in range(frames)])
    if tracks:
        made = [_with_tracks(scene, view, world) for view in made]
    return Clip(
        note=_note(seed, static),
        times_s=torch.arange(frames, dtype=torch.float64) / 12,
        views=tuple(made),
        tracks=_make_tracks(points, world) if tracks else None,
    )


def _note(seed: int, static: bool) -> ClipMetadata:
    motions = ("", "" if static else "moves to the right", "")
    objects = tuple(
        ObjectNote(instance=index + 1, name=kind, color="grey", motion=motion)
        for index, (kind, motion) in enumerate(zip(KINDS, motions, strict=True))
    )
    return ClipMetadata(
        identifier=f"clip-{seed}",
        source="oracle 1",
        license="CC0-1.0",
        caption="a box and a ball before a wall",
        metric="exact",
        is_static=static,
        objects=objects,
    )


def _make_camera(view: int, frames: int, size_px: tuple[int, int]) -> Camera:
    """Not in the middle, not square and turning, so that any mix-up of axes shows."""
    width = size_px[1]
    poses = [
        pose_at(
            np.array([0.7 * view + 0.08 * frame, -0.15 * view, 0.05 * frame]),
            -0.12 * view + 0.01 * frame,
            -0.02 * view + 0.006 * frame,
        )
        for frame in range(frames)
    ]
    lens = torch.tensor([[0.9 * width, 0.94 * width]], dtype=torch.float64)
    center = torch.tensor([[0.52 * width, 0.47 * size_px[0]]], dtype=torch.float64)
    return Camera(
        focal_px=lens.expand(frames, 2).clone(),
        center_px=center.expand(frames, 2).clone(),
        world_from_camera=torch.from_numpy(np.stack(poses)),
        size_px=size_px,
    )


def _texture(scene: Scene, hits: Hits) -> np.ndarray:
    wave = np.sin(hits.local * np.array([5.0, 6.0, 7.0])).prod(-1, keepdims=True)
    color = scene.colors[hits.which] * (0.7 + 0.3 * wave)
    color[hits.which < 0] = (0.5, 0.7, 0.9)
    return np.round(color * 255).astype(np.uint8)


def _make_view(scene: Scene, camera: Camera, seen: list[Hits]) -> View:
    depth = np.stack([np.where(hits.which < 0, 0, hits.depth) for hits in seen])
    return View(
        rgb=torch.from_numpy(np.stack([_texture(scene, hits) for hits in seen])),
        depth=torch.from_numpy(depth.astype(np.float32)),
        cameras=camera,
        instances=torch.from_numpy(np.stack([hits.which + 1 for hits in seen]).astype(np.uint8)),
        flow=_make_flow(scene, camera, seen),
    )


def _make_flow(scene: Scene, camera: Camera, seen: list[Hits]) -> Flow:
    height, width = camera.size_px
    rows, columns = np.mgrid[:height, :width] + 0.5
    to_next = np.zeros((len(seen) - 1, height, width, 2), np.float32)
    known, visible = np.zeros((2, *to_next.shape[:-1]), bool)
    for frame, hits in enumerate(seen[:-1]):
        world = carried(scene, hits.which, hits.local, frame + 1)
        uv, sees = project_seen(scene, camera, frame + 1, world)
        known[frame] = hits.which >= 0
        visible[frame] = sees & known[frame]
        to_next[frame] = np.where(known[frame][..., None], uv - np.stack([columns, rows], -1), 0)
    return Flow(**_tensors(to_next=to_next, known=known, visible=visible))


def _tensors(**arrays: np.ndarray) -> dict[str, torch.Tensor]:
    return {name: torch.from_numpy(array) for name, array in arrays.items()}


def _choose_points(hits: list[list[Hits]], count: int, rng: np.random.Generator) -> _Points:
    """Random pixel centres, from each object in turn as long as any are left."""
    which = np.stack([[one.which for one in view] for view in hits])
    local = np.stack([[one.local for one in view] for view in hits])
    pixels = np.argwhere(which >= 0)
    order = np.arange(len(pixels))
    rng.shuffle(order)
    pixels = pixels[order]
    which, local = (values[tuple(pixels.T)] for values in (which, local))
    rank = np.zeros(len(pixels), int)
    for index in range(len(KINDS)):
        rank[which == index] = np.arange((which == index).sum())
    chosen = np.argsort(rank, kind="stable")[:count]
    return _Points(which[chosen], local[chosen].reshape(-1, 3), pixels[chosen, :2])


def _make_tracks(points: _Points, world: np.ndarray) -> Tracks:
    return Tracks(
        **_tensors(
            positions=world.astype(np.float32),
            instances=(points.which + 1).astype(np.uint8),
            found_at=points.found_at,
        )
    )


def _with_tracks(scene: Scene, view: View, world: np.ndarray) -> View:
    seen = [project_seen(scene, view.cameras, frame, world[frame]) for frame in range(len(world))]
    uv, visible = (np.stack(part) for part in zip(*seen, strict=True))
    return replace(
        view,
        track_uv=torch.from_numpy(uv.astype(np.float32)),
        track_visible=torch.from_numpy(visible),
    )
