"""Scenes with known motion, clips that show exactly them, and systems that answer with them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from diff4splat.data.clip import Clip, ClipMetadata, ObjectNote, Tracks, View
from diff4splat.evaluation.protocols.protocol import Protocol, Targets
from diff4splat.evaluation.protocols.protocol_json import load_protocol
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.systems.evaluated_system import Identity
from diff4splat.geometry.camera import Camera, pinhole, project
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.harmonics import dc_from_color
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

SIZE, FRAMES, LAST_S = (32, 40), 5, 1.0
BACK, FRONT = 4.0, 3.0
"""Depth of the wall and of the patch before it; the wall is the median."""


def tiny_protocol(count: int = 3) -> Protocol:
    """The shipped protocol at sizes for tests."""
    whole = load_protocol("held_out_v1").protocol
    return replace(
        whole,
        name="tiny",
        source=replace(whole.source, count=count),
        frames=FRAMES,
        views=2,
        size_px=SIZE,
        generation=Targets(pairs=((0, 2), (0, 4), (1, 0), (1, 4)), source_frames=(0,)),
        reconstruction=Targets(pairs=((1, 0), (1, 4)), source_frames=(0, 2)),
        track_frames=(0, 2, 4),
        loop=replace(whole.loop, frames=5, size_px=SIZE),
        pose=replace(whole.pose, frames=4, size_px=(96, 120)),
        text_cases=min(count, 2),
        planes=replace(whole.planes, candidates=9),
        bootstrap=replace(whole.bootstrap, resamples=200),
    )


def slab(depth: float, half: tuple[float, float], step: float, seed: int) -> Gaussians:
    """Opaque round Gaussians with random colours on a grid across z = depth."""
    xs, ys = (torch.arange(-side, side + step / 2, step) for side in half)
    grid = torch.stack(torch.meshgrid(xs, ys, indexing="ij"), -1).reshape(-1, 2)
    means = torch.cat([grid, torch.full_like(grid[:, :1], depth)], -1)
    generator = torch.Generator().manual_seed(seed)
    count = len(means)
    return Gaussians(
        means=means,
        quats=torch.tensor([[1.0, 0, 0, 0]]).expand(count, 4).clone(),
        scales=torch.full((count, 3), 0.6 * step),
        opacities=torch.full((count,), 0.999),
        sh=dc_from_color(torch.rand(count, 1, 3, generator=generator)),
    )


def wall_and_patch(
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0), step: float = 0.16
) -> Scene:
    """A wall that stands and a patch before it that moves by ``shift`` in LAST_S seconds."""
    wall = slab(BACK, (4.0, 3.2), step, 1)
    patch = slab(FRONT, (0.6, 0.5), step, 2)
    index = torch.arange(len(wall), len(wall) + len(patch))
    offsets = torch.stack([torch.zeros(3), torch.tensor(shift)])[:, None].expand(2, len(index), 3)
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0, LAST_S]),
        moving_index=index,
        offsets=offsets.clone(),
        rotations=torch.tensor([1.0, 0, 0, 0]).expand(2, len(index), 4).clone(),
        log_scale_offsets=torch.zeros(2, len(index), 3),
    )
    return as_scene(concatenate([wall, patch]), motion if any(shift) else StaticMotion())


def as_scene(gaussians: Gaussians, motion: KeyframeMotion | StaticMotion) -> Scene:
    camera = pinhole(40.0, SIZE)
    path = CameraPath(cameras=camera.with_pose(torch.eye(4)[None]), times_s=torch.zeros(1))
    return Scene(
        gaussians=gaussians, motion=motion, path=path, provenance=Provenance(generator="test")
    )


def view_cameras(view: int) -> Camera:
    """View 0 drifts to the right from the identity; view 1 stands beside it."""
    poses = torch.eye(4, dtype=torch.float64).repeat(FRAMES, 1, 1)
    poses[:, 0, 3] = 0.03 * torch.arange(FRAMES) + 0.25 * view
    poses[:, 1, 3] = -0.1 * view
    return pinhole(40.0, SIZE, torch.float64).with_pose(poses)


def filmed(scene: Scene, identifier: str = "filmed", still: bool = False) -> Clip:
    """A clip whose images, depth and tracks are what ``scene`` shows."""
    times_s = torch.linspace(0, LAST_S, FRAMES, dtype=torch.float64)
    states = [scene.state_at(float(time_s)).means.double() for time_s in times_s]
    index = torch.cat([torch.arange(0, len(states[0]), 17), scene.motion.moving_index]).unique()
    positions = torch.stack(states)[:, index]
    moving = torch.isin(index, scene.motion.moving_index)
    views = tuple(_view(scene, view, times_s, positions) for view in range(2))
    found = torch.full((len(index), 2), -1, dtype=torch.long)
    return Clip(
        note=ClipMetadata(
            identifier=identifier,
            source="filmed 1",
            license="CC0-1.0",
            caption="a patch before a wall",
            is_static=still,
            objects=(
                ObjectNote(instance=1, name="wall", color="grey", motion=""),
                ObjectNote(instance=2, name="patch", color="red", motion="slides"),
            ),
        ),
        times_s=times_s,
        views=views,
        tracks=Tracks(
            positions=positions.float(),
            instances=torch.where(moving, 2, 1).to(torch.uint8),
            found_at=found,
        ),
    )


def _view(scene: Scene, number: int, times_s: Tensor, positions: Tensor) -> View:
    cameras = view_cameras(number)
    shown = [
        render(scene, cameras[i], float(t), outputs=("rgb", "depth")) for i, t in enumerate(times_s)
    ]
    depth = torch.stack([one.depth for one in shown])
    rgb = torch.stack([(one.rgb.clamp(0, 1) * 255 + 0.5).to(torch.uint8) for one in shown])
    uv, visible = [], []
    height, width = SIZE
    for frame in range(FRAMES):
        pixels, z = project(cameras[frame], positions[frame])
        column, row = pixels.floor().long().unbind(-1)
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        seen = depth[frame, row.clamp(0, height - 1), column.clamp(0, width - 1)]
        uv.append(pixels.float())
        visible.append(inside & ((seen - z).abs() < 0.02))
    return View(
        rgb=rgb,
        depth=depth,
        cameras=cameras,
        instances=torch.where(depth < (BACK + FRONT) / 2, 2, 1).to(torch.uint8),
        track_uv=torch.stack(uv),
        track_visible=torch.stack(visible),
    )


@dataclass
class Fixed:
    """Answers every case with one scene, and captions with what ``told`` makes of them."""

    scene: Scene
    told: Callable[[str], Scene] | None = None
    calls: int = 0

    @property
    def identity(self) -> Identity:
        return Identity(
            name="fixed",
            weights_sha256="none",
            fingerprint="f" * 12,
            settings="",
            untrained=False,
        )

    def predict(self, case: EvalSample, seed: int) -> Scene:
        self.calls += 1
        return self.scene

    def generate(self, case: EvalSample, prompt: str | None, seed: int) -> Scene:
        self.calls += 1
        return self.told(prompt or "") if self.told else self.scene
