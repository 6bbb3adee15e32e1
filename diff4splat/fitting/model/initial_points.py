"""Initial points: given with the capture, from depth maps, or random around the scene centre.

Axes: ``p`` points, ``h w`` pixels. A distant shell of points is added unless the capture has a
background colour, so that skies and distant walls can be represented.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, PointCloud
from diff4splat.fitting.frames.unprojection import project, unproject
from diff4splat.fitting.model.scene_bounds import SceneBounds

SHELL_SHARE = 0.15
SHELL_DISTANCES = (6.0, 12.0)
"""Radii of the shell, in mean distances of the cameras from the scene centre."""
CLOUD_RADIUS = 1.3
"""Radius of the random points, in the same unit."""


def initial_points(
    capture: Capture, bounds: SceneBounds, count: int, use_depth: bool, seed: int
) -> PointCloud:
    """About ``count`` coloured points."""
    generator = torch.Generator().manual_seed(seed)
    shell = 0 if capture.background is not None else int(SHELL_SHARE * count)
    points = capture.points
    if points is None and use_depth:
        points = _from_depth(capture, count - shell, generator)
    if points is None:
        points = _cloud(capture, bounds, count - shell, generator)
    points = _subsample(points, count - shell, generator)
    if not shell:
        return points
    low, high = SHELL_DISTANCES
    radius = bounds.distance * (low + (high - low) * torch.rand(shell, 1, generator=generator))
    far = _colored(capture, bounds.center + radius * _directions(shell, generator))
    return _concatenate(points, far)


def mean_neighbour_distance(
    positions: Float[Tensor, "p 3"], neighbours: int = 3
) -> Float[Tensor, " p"]:
    """Mean distance of each point to its nearest neighbours."""
    if len(positions) < 2:
        return torch.ones(len(positions))
    near = min(neighbours, len(positions) - 1)
    distances = [
        torch.cdist(part, positions).topk(near + 1, largest=False).values[:, 1:].mean(1)
        for part in positions.split(1024)
    ]
    return torch.cat(distances)


def _from_depth(capture: Capture, count: int, generator: torch.Generator) -> PointCloud | None:
    """Random pixels of the training frames nearest to the middle of the time range."""
    training = capture.learnt
    middle_s = sum(capture.time_range_s) / 2
    gap_s = (capture.times_s[training] - middle_s).abs()
    nearest = training[gap_s <= gap_s.min() * (1 + 1e-6) + 1e-12].tolist()
    positions, colors = [], []
    for index in nearest:
        frame = capture.frames.read(index)
        if frame.depth is None:
            return None
        points, valid = unproject(capture.physical_camera(index), frame.depth)
        selected = valid if frame.counts is None else valid & frame.counts
        order = torch.randperm(int(selected.sum()), generator=generator)
        order = order[: math.ceil(count / len(nearest))]
        positions.append(points[selected][order])
        colors.append(frame.rgb[selected][order])
    if sum(map(len, positions)) == 0:
        return None
    return PointCloud(positions=torch.cat(positions), rgb=torch.cat(colors))


def _cloud(
    capture: Capture, bounds: SceneBounds, count: int, generator: torch.Generator
) -> PointCloud:
    """Uniform in a ball around the scene centre."""
    radius = bounds.distance * CLOUD_RADIUS
    radius = radius * torch.rand(count, 1, generator=generator) ** (1 / 3)
    return _colored(capture, bounds.center + radius * _directions(count, generator))


def _directions(count: int, generator: torch.Generator) -> Float[Tensor, "p 3"]:
    return torch.nn.functional.normalize(torch.randn(count, 3, generator=generator), dim=-1)


def _colored(capture: Capture, positions: Float[Tensor, "p 3"], views: int = 16) -> PointCloud:
    """Colour each point by the mean over training frames that contain it, starting from grey."""
    training = capture.learnt
    at = torch.linspace(0, len(training) - 1, min(views, len(training))).round().long()
    total, views_seen = torch.full_like(positions, 0.5), torch.ones(len(positions), 1)
    for index in training[at].tolist():
        pixels, inside = project(capture.physical_camera(index), positions)
        column, row = torch.where(inside[:, None], pixels, 0.0).floor().long().unbind(-1)
        rgb = capture.frames.read(index).rgb
        total[inside] += rgb[row[inside], column[inside]]
        views_seen[inside] += 1
    return PointCloud(positions=positions, rgb=total / views_seen)


def _subsample(points: PointCloud, count: int, generator: torch.Generator) -> PointCloud:
    if len(points.positions) <= count:
        return points
    subset = torch.randperm(len(points.positions), generator=generator)[:count]
    return PointCloud(positions=points.positions[subset], rgb=points.rgb[subset])


def _concatenate(first: PointCloud, second: PointCloud) -> PointCloud:
    return PointCloud(
        positions=torch.cat([first.positions, second.positions]),
        rgb=torch.cat([first.rgb, second.rgb]),
    )
