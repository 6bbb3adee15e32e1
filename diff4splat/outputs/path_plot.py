"""Draws a camera path on a figure: three views of the cameras, their speed and their turning.

Axes: ``t`` frames, ``s`` steps between them or shown cameras. World axes are OpenCV's: x right, y
down, z forward, so the page of the side and front views has y pointing down.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.io.figures.plots import new_figure, save_figure
from diff4splat.paths.camera_path import CameraPath, require_valid_path

MAX_DRAWN_CAMERAS = 7
"""Frustums drawn along the path."""
SMALLEST_EXTENT = 1e-6
"""Below this the cameras are in one place and frustums get unit length."""
VIEWS = (("top view", 0, 2), ("side view", 2, 1), ("front view (as the camera looks)", 0, 1))
"""(title, world axis to the right, world axis along the page)."""
AXIS_LABELS = ("x (right)", "y (down)", "z (forward)")
START, END, LINE, BETWEEN = "#009E73", "#D55E00", "#0072B2", "0.75"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sketch:
    """What the three views share, in world space."""

    centers: Float[Tensor, "t 3"]
    frustums: Float[Tensor, "s 4 3"]
    """Far corners of the shown cameras, in order around the image."""
    apexes: Float[Tensor, "s 3"]

    def limits(self, axis: int) -> tuple[float, float]:
        """A range around everything, equally long on all axes."""
        points = torch.cat([self.centers, self.frustums.reshape(-1, 3)])
        low, high = points.amin(0), points.amax(0)
        half = 0.55 * float((high - low).max())
        middle = float((low + high)[axis]) / 2
        return middle - half, middle + half


def save_path_preview(path: CameraPath, file: Path, title: str) -> None:
    """The path from above, from the side and from the front, with speed and turning.

    Raises:
        InputError: the path cannot be followed.
        MissingExtraError: matplotlib is not installed.
        OutputError: the file cannot be written.
    """
    require_valid_path(path, "camera path")
    figure = new_figure(7.6, 6.4)
    draw(figure, path, title)
    save_figure(figure, file)


def draw(figure: Any, path: CameraPath, title: str) -> None:
    """Fill ``figure`` with the three views and the two curves."""
    heading = f"{title}: {len(path)} frames, {_seconds(path):.3g} s"
    figure.suptitle(heading, fontsize=10, parse_math=False)
    grid = figure.add_gridspec(4, 2)
    boxes = (grid[:2, 0], grid[2:, 0], grid[2:, 1])
    sketch = _sketch(path)
    views = [figure.add_subplot(box) for box in boxes]
    for axes, view in zip(views, VIEWS, strict=True):
        _draw_view(axes, sketch, view)
    views[0].legend(fontsize=7, frameon=False)
    speed, turning = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    _draw_curve(speed, path, speeds(path), "speed\n[units/s]")
    _draw_curve(turning, path, turn_rates(path), "turning\n[°/s]")
    speed.tick_params(labelbottom=False)
    turning.set_xlabel("time [s]", fontsize=8)
    figure.align_ylabels([speed, turning])


def speeds(path: CameraPath) -> Float[Tensor, " s"]:
    """Scene units per second between frames."""
    position = path.cameras.position.double()
    return (position[1:] - position[:-1]).norm(dim=-1) / path.times_s.double().diff()


def turn_rates(path: CameraPath) -> Float[Tensor, " s"]:
    """Degrees per second between frames."""
    rotation = path.cameras.world_from_camera[:, :3, :3].double()
    quats = quaternion.from_matrix(rotation[:-1].mT @ rotation[1:])
    # atan2 and not acos: small turns survive.
    angle = 2 * torch.atan2(quats[:, 1:].norm(dim=-1), quats[:, 0].abs())
    return torch.rad2deg(angle) / path.times_s.double().diff()


def _seconds(path: CameraPath) -> float:
    return float(path.times_s[-1] - path.times_s[0])


def _sketch(path: CameraPath) -> _Sketch:
    centers = path.cameras.position.double()
    extent = float((centers.amax(0) - centers.amin(0)).max())
    depth = 0.2 * extent if extent > SMALLEST_EXTENT else 1.0
    shown = torch.linspace(0, len(path) - 1, min(MAX_DRAWN_CAMERAS, len(path))).round().long()
    height, width = path.cameras.size_px
    pixels = centers.new_tensor([[0, 0], [width, 0], [width, height], [0, height]])
    focal, middle = path.cameras.focal_px[shown].double(), path.cameras.center_px[shown].double()
    flat = (pixels - middle[:, None]) / focal[:, None]
    local = depth * torch.cat([flat, torch.ones_like(flat[..., :1])], -1)
    pose = path.cameras.world_from_camera[shown].double()
    corners = local @ pose[:, :3, :3].mT + pose[:, None, :3, 3]
    return _Sketch(centers=centers, frustums=corners, apexes=centers[shown])


def _draw_view(axes: Any, sketch: _Sketch, view: tuple[str, int, int]) -> None:
    title, across, along = view
    last = len(sketch.apexes) - 1
    # The two ends come last, so that they lie on top of what is between them.
    for number in (*range(1, last), last, 0):
        color = {0: START, last: END}.get(number, BETWEEN)
        for line in _outline(sketch.apexes[number], sketch.frustums[number]):
            axes.plot(line[:, across], line[:, along], color=color, linewidth=0.8)
    centers = sketch.centers
    axes.plot(centers[:, across], centers[:, along], ".-", color=LINE, markersize=3, linewidth=1.2)
    # A ring around a dot stays visible where the path ends where it began.
    first, final = centers[0], centers[-1]
    ring = {"markersize": 9, "markerfacecolor": "none", "markeredgewidth": 2}
    axes.plot(first[across], first[along], "o", color=START, label="start", **ring)
    axes.plot(final[across], final[along], "s", color=END, markersize=5, label="end")
    axes.set_title(title, fontsize=9)
    axes.set_xlabel(AXIS_LABELS[across], fontsize=8)
    axes.set_ylabel(AXIS_LABELS[along], fontsize=8)
    axes.set(xlim=sketch.limits(across), ylim=sketch.limits(along), aspect="equal")
    if along == 1:
        axes.invert_yaxis()
    _quiet(axes)


def _outline(apex: Tensor, corners: Tensor) -> tuple[Tensor, Tensor]:
    """The image's border and the four edges that lead to the camera."""
    border = torch.stack([*corners, corners[0]])
    edges = torch.stack([point for corner in corners for point in (apex, corner)])
    return border, edges


def _draw_curve(axes: Any, path: CameraPath, rates: Float[Tensor, " s"], label: str) -> None:
    between = 0.5 * (path.times_s[1:] + path.times_s[:-1])
    axes.plot(between, rates, ".-", color=LINE, markersize=3, linewidth=1)
    highest = max(rates.tolist(), default=0.0)
    axes.set_ylim(0, 1.1 * highest if highest > SMALLEST_EXTENT else 1.0)
    axes.set_ylabel(label, fontsize=8)
    _quiet(axes)


def _quiet(axes: Any) -> None:
    axes.tick_params(labelsize=7)
    axes.grid(True, color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
