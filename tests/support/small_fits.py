"""Captures small enough to fit in seconds: a coloured ball that moves among a few that stand.

Images come from the float64 reference renderer, so that truth does not depend on the fast one.
"""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.data.capture.capture import Capture, Flow, Frame, PointCloud
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera, join_cameras, pinhole
from diff4splat.io.photos.images import write_png
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color

SIDE_PX = 24


@dataclass(kw_only=True)
class Images:
    """Frames in memory."""

    shown: list[Frame]

    def __len__(self) -> int:
        return len(self.shown)

    def read(self, index: int) -> Frame:
        return self.shown[index]


def balls(time_s: float, shift: float = 0.5) -> Gaussians:
    """Five balls; the first goes from left to right within one second."""
    generator = torch.Generator().manual_seed(4)
    means = torch.rand(5, 3, generator=generator) - 0.5
    means[0] = torch.tensor([shift * (2 * time_s - 1), 0.0, -0.3])
    colors = torch.rand(5, 3, generator=generator)
    colors[0] = torch.tensor([1.0, 0.2, 0.1])
    return Gaussians(
        means=means.double(),
        quats=torch.tensor([[1.0, 0, 0, 0]]).repeat(5, 1).double(),
        scales=torch.full((5, 3), 0.16).double(),
        opacities=torch.full((5,), 0.95).double(),
        sh=dc_from_color(colors)[:, None].double(),
    )


def ring(count: int, side_px: int = SIDE_PX) -> list[Camera]:
    """Cameras on an arc, looking at the origin."""
    lens = pinhole(1.1 * side_px, (side_px, side_px), torch.float64)
    found = []
    for number in range(count):
        angle = math.radians(-40 + 80 * number / max(count - 1, 1))
        eye = torch.tensor([2.4 * math.sin(angle), -0.4, -2.4 * math.cos(angle)]).double()
        down = torch.tensor([0.0, 1.0, 0.0]).double()
        found.append(lens.with_pose(rigid.look_at(eye, torch.zeros(3).double(), down)))
    return found


def ball_capture(
    views: int = 5, times: int = 4, held: tuple[int, ...] = (2,), with_depth: bool = True
) -> Capture:
    """Every camera at every time; cameras in ``held`` are held out."""
    cameras, shown, times_s, index = [], [], [], []
    for number, camera in enumerate(ring(views)):
        for step in range(times):
            time_s = step / max(times - 1, 1)
            made = render(balls(time_s), camera, outputs=("rgb", "depth"), backend="reference")
            depth = made.depth.float() if with_depth else None
            shown.append(Frame(rgb=made.rgb.float().clamp(0, 1), depth=depth))
            cameras.append(camera)
            times_s.append(time_s)
            index.append(number)
    camera_index = torch.tensor(index)
    return Capture(
        name="balls",
        source="test",
        cameras=join_cameras([_batched(camera) for camera in cameras]),
        times_s=torch.tensor(times_s).double(),
        camera_index=camera_index,
        held_out=torch.isin(camera_index, torch.tensor(held, dtype=torch.long)),
        frames=Images(shown=shown),
        points=cloud(),
        background=(0.0, 0.0, 0.0),
    )


def cloud(count: int = 60) -> PointCloud:
    """Grey points around the origin."""
    generator = torch.Generator().manual_seed(1)
    positions = 1.2 * (torch.rand(count, 3, generator=generator) - 0.5)
    return PointCloud(positions=positions, rgb=torch.full((count, 3), 0.5))


def with_flow(frame: Frame, to_frame: int, offset_px: Tensor) -> Frame:
    """The frame with one flow for all pixels."""
    height, width, _ = frame.rgb.shape
    known = torch.ones(height, width, dtype=torch.bool)
    flow = Flow(to_frame=to_frame, offset_px=offset_px.expand(height, width, 2), known=known)
    return replace(frame, flow=flow)


def _batched(camera: Camera) -> Camera:
    return Camera(
        focal_px=camera.focal_px[None],
        center_px=camera.center_px[None],
        world_from_camera=camera.world_from_camera[None],
        size_px=camera.size_px,
    )


def write_ball_folder(folder: Path, capture: Capture) -> None:
    """The capture as nerfstudio's transforms.json with PNG files, held-out ones listed."""
    frames, held = [], []
    flip = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0]).double())
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(len(capture)):
        name = f"images/{index:03d}.png"
        write_png(capture.frames.read(index).rgb, folder / name)
        pose = capture.cameras[index].world_from_camera @ flip
        frames.append(
            {
                "file_path": name,
                "time": float(capture.times_s[index]),
                "transform_matrix": pose.tolist(),
            }
        )
        if bool(capture.held_out[index]):
            held.append(name)
    focal, center = capture.cameras.focal_px[0], capture.cameras.center_px[0]
    height, width = capture.cameras.size_px
    root = {
        "fl_x": float(focal[0]),
        "fl_y": float(focal[1]),
        "cx": float(center[0]),
        "cy": float(center[1]),
        "w": width,
        "h": height,
        "frames": frames,
        "train_filenames": [f["file_path"] for f in frames if f["file_path"] not in held],
        "test_filenames": held,
    }
    (folder / "transforms.json").write_text(json.dumps(root))
