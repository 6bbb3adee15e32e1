"""From a world to a clip.

Axes: ``t`` frames, ``n`` tracked points. The clip's world is the first camera of the first view;
all changes of frame are float64 sums written out, since libraries of linear algebra differ in the
last bit.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float64

from diff4splat.data.clip import Clip, Flow, Tracks, View
from diff4splat.data_prep.synthetic.renderer.cameras import RenderCamera, render_camera, to_camera
from diff4splat.data_prep.synthetic.renderer.ground_truth.maps import (
    GroundTruth,
    render_ground_truth,
)
from diff4splat.data_prep.synthetic.renderer.ground_truth.tracks import (
    TrackPoints,
    choose_track_points,
    observe_points,
    track_positions,
)
from diff4splat.data_prep.synthetic.renderer.image_renderer import Renderer, visible_world_points
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import (
    TriangleBuffer,
    build_triangle_buffer,
)
from diff4splat.data_prep.synthetic.world import World
from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rigid import require_rigid

Result = TypeVar("Result")


def draw_clip(world: World, settings: DrawSettings | None = None) -> Clip:
    """Images and truth of a world in all its views and frames.

    The same world gives the same bits on every machine and with any number of threads. Flow of the
    sky is that of infinitely far points. Points that are ever behind a camera have finite but
    meaningless ``uv`` there. There are fewer tracks than asked for where fewer pixels see anything.

    Raises:
        ConfigError: instances, textures or the numbers of frames do not fit.
        InputError: a mesh or a pose is not finite, or a mesh's arrays do not fit together.
    """
    settings = settings or DrawSettings()
    buffer, lenses = build_triangle_buffer(world), _lenses(world)
    frames = range(len(world.times_s))
    with ThreadPoolExecutor(settings.threads) as pool:
        truths = [
            _each(
                pool,
                settings,
                lambda frame, row=row: _measure(buffer, frame, row, settings),
                frames,
            )
            for row in lenses
        ]
        painter = Renderer(world, buffer, visible_world_points(truths, lenses), settings)
        painter.auto_expose(len(frames) // 2, lenses[0][len(frames) // 2])
        painted = _each(
            pool,
            settings,
            lambda frame: painter.render(frame, [row[frame] for row in lenses]),
            frames,
        )
        views = [
            as_view(camera, [images[at] for images in painted], truths[at], lenses[0][0])
            for at, camera in enumerate(world.views)
        ]
        tracks = None
        if settings.tracks:
            points = choose_track_points(buffer, truths, lenses, settings.tracks)
            views, tracks = _tracked(pool, settings, buffer, points, views, lenses)
    return Clip(
        note=world.note,
        times_s=torch.from_numpy(world.times_s.copy()),
        views=tuple(views),
        tracks=tracks,
    )


def _each(
    pool: ThreadPoolExecutor,
    settings: DrawSettings,
    work: Callable[[int], Result],
    frames: range,
) -> list[Result]:
    """One result per frame, in order; without other threads where one is asked for."""
    return list(map(work, frames) if settings.threads == 1 else pool.map(work, frames))


def _lenses(world: World) -> list[list[RenderCamera]]:
    """Cameras by view and frame."""
    if not world.views:
        raise ConfigError("views: expected at least one camera, got none")
    frames, sizes = len(world.times_s), {camera.size_px for camera in world.views}
    lengths = [camera.batch_shape for camera in world.views]
    if lengths != [(frames,)] * len(lengths) or frames == 0:
        raise ConfigError(f"views: expected cameras for {frames} > 0 frames, got {lengths}")
    if len(sizes) > 1:
        raise ConfigError(f"views: expected one image size, got {sorted(sizes)}")
    for at, camera in enumerate(world.views):
        require_rigid(camera.world_from_camera, f"view {at}")
    return [[render_camera(camera, frame) for frame in range(frames)] for camera in world.views]


def _measure(
    buffer: TriangleBuffer, frame: int, row: list[RenderCamera], settings: DrawSettings
) -> GroundTruth:
    following = row[frame + 1] if settings.flow and frame + 1 < len(row) else None
    return render_ground_truth(buffer, frame, row[frame], following)


def as_view(
    camera: Camera, images: list[np.ndarray], truths: list[GroundTruth], first: RenderCamera
) -> View:
    """One camera's images and truth, in the axes of the first camera."""
    flow = None
    if truths[0].to_next is not None:
        flow = Flow(
            to_next=_stacked([truth.to_next for truth in truths[:-1]]),
            known=_stacked([truth.known for truth in truths[:-1]]),
            visible=_stacked([truth.visible for truth in truths[:-1]]),
        )
    return View(
        rgb=_stacked(images),
        depth=_stacked([truth.depth for truth in truths]),
        cameras=_in_clip(camera, first),
        instances=_stacked([truth.instances for truth in truths]),
        flow=flow,
    )


def _stacked(arrays: list[np.ndarray]) -> torch.Tensor:
    return torch.from_numpy(np.stack(arrays))


def _in_clip(camera: Camera, first: RenderCamera) -> Camera:
    """The same cameras in the axes of the first one."""
    poses = camera.world_from_camera.double().numpy()
    moved = np.zeros_like(poses)
    moved[:, 3, 3] = 1.0
    turn = first.rotation
    for frame in range(len(poses)):
        if np.array_equal(poses[frame, :3, :3], turn):
            # Exactly none, where a product of the two would be off in the last bit.
            moved[frame, :3, :3] = np.eye(3)
        else:
            columns = poses[frame, :3, :3]
            for i in range(3):
                moved[frame, i, :3] = (
                    turn[0, i] * columns[0] + turn[1, i] * columns[1] + turn[2, i] * columns[2]
                )
    moved[:, :3, 3] = _from_first(np.ascontiguousarray(poses[:, :3, 3]), first)
    return replace(
        camera,
        focal_px=camera.focal_px.double(),
        center_px=camera.center_px.double(),
        world_from_camera=torch.from_numpy(moved),
    )


def _from_first(
    points: Float64[np.ndarray, "n 3"], first: RenderCamera
) -> Float64[np.ndarray, "n 3"]:
    local = np.empty_like(points)
    to_camera(points, first, local)
    return local


def _tracked(
    pool: ThreadPoolExecutor,
    settings: DrawSettings,
    buffer: TriangleBuffer,
    points: TrackPoints,
    views: list[View],
    lenses: list[list[RenderCamera]],
) -> tuple[list[View], Tracks]:
    """The views with their coordinates of the points, and the points in space."""
    positions, frames = track_positions(buffer, points), range(len(buffer.positions))
    done = []
    for at, view in enumerate(views):
        looks = _each(
            pool,
            settings,
            lambda frame, at=at: observe_points(
                buffer, points, positions[frame], lenses[at][frame], (at, frame)
            ),
            frames,
        )
        uv = _stacked([seen.astype(np.float32) for seen, _ in looks])
        done.append(
            replace(view, track_uv=uv, track_visible=_stacked([shown for _, shown in looks]))
        )
    moved = np.stack([_from_first(np.ascontiguousarray(here), lenses[0][0]) for here in positions])
    return done, Tracks(
        positions=torch.from_numpy(moved.astype(np.float32)),
        instances=torch.from_numpy(buffer.instances[buffer.owners[points.triangles]]),
        found_at=torch.from_numpy(points.sampled_at),
    )
