"""Points that a fit starts from: given ones, those of depth maps, or a cloud around the centre.

Axes: ``p`` points, ``h w`` pixels. Whatever the source, a far shell is added where the capture has
no background of its own, since skies and far walls have to be made of something.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture, PointCloud
from diff4splat.fitting.lens_points import fallen, lifted
from diff4splat.fitting.scene_bounds import Region

SHELL_SHARE = 0.15
SHELL_DISTANCES = (6.0, 12.0)
"""Of the far shell, in distances from the cameras to the centre."""
CLOUD_RADIUS = 1.3
"""Of the cloud around the centre, in the same unit."""


def starting_points(
    capture: Capture, region: Region, count: int, use_depth: bool, seed: int
) -> PointCloud:
    """About ``count`` coloured points."""
    generator = torch.Generator().manual_seed(seed)
    shell = 0 if capture.background is not None else int(SHELL_SHARE * count)
    found = capture.points
    if found is None and use_depth:
        found = _from_depth(capture, count - shell, generator)
    if found is None:
        found = _cloud(capture, region, count - shell, generator)
    found = _thinned(found, count - shell, generator)
    if not shell:
        return found
    low, high = SHELL_DISTANCES
    radius = region.distance * (low + (high - low) * torch.rand(shell, 1, generator=generator))
    far = _colored(capture, region.center + radius * _directions(shell, generator))
    return _joined(found, far)


def spacing(positions: Float[Tensor, "p 3"], neighbours: int = 3) -> Float[Tensor, " p"]:
    """Mean distance to the nearest other points."""
    if len(positions) < 2:
        return torch.ones(len(positions))
    near = min(neighbours, len(positions) - 1)
    found = [
        torch.cdist(part, positions).topk(near + 1, largest=False).values[:, 1:].mean(1)
        for part in positions.split(1024)
    ]
    return torch.cat(found)


def _from_depth(capture: Capture, count: int, generator: torch.Generator) -> PointCloud | None:
    """Pixels of the training frames nearest to the middle of the time, spread over cameras."""
    learnt = capture.learnt
    middle_s = sum(capture.time_range_s) / 2
    gap_s = (capture.times_s[learnt] - middle_s).abs()
    nearest = learnt[gap_s <= gap_s.min() * (1 + 1e-6) + 1e-12].tolist()
    positions, colors = [], []
    for index in nearest:
        frame = capture.frames.read(index)
        if frame.depth is None:
            return None
        points, known = lifted(capture.physical_camera(index), frame.depth)
        seen = known if frame.counts is None else known & frame.counts
        drawn = torch.randperm(int(seen.sum()), generator=generator)
        drawn = drawn[: math.ceil(count / len(nearest))]
        positions.append(points[seen][drawn])
        colors.append(frame.rgb[seen][drawn])
    if sum(map(len, positions)) == 0:
        return None
    return PointCloud(positions=torch.cat(positions), rgb=torch.cat(colors))


def _cloud(capture: Capture, region: Region, count: int, generator: torch.Generator) -> PointCloud:
    """Uniform in a ball around the centre."""
    radius = region.distance * CLOUD_RADIUS
    radius = radius * torch.rand(count, 1, generator=generator) ** (1 / 3)
    return _colored(capture, region.center + radius * _directions(count, generator))


def _directions(count: int, generator: torch.Generator) -> Float[Tensor, "p 3"]:
    return torch.nn.functional.normalize(torch.randn(count, 3, generator=generator), dim=-1)


def _colored(capture: Capture, positions: Float[Tensor, "p 3"], views: int = 16) -> PointCloud:
    """Mean colour over some training frames that see each point; grey where none does."""
    learnt = capture.learnt
    at = torch.linspace(0, len(learnt) - 1, min(views, len(learnt))).round().long()
    total, seen = torch.full_like(positions, 0.5), torch.ones(len(positions), 1)
    for index in learnt[at].tolist():
        pixels, inside = fallen(capture.physical_camera(index), positions)
        column, row = torch.where(inside[:, None], pixels, 0.0).floor().long().unbind(-1)
        rgb = capture.frames.read(index).rgb
        total[inside] += rgb[row[inside], column[inside]]
        seen[inside] += 1
    return PointCloud(positions=positions, rgb=total / seen)


def _thinned(points: PointCloud, count: int, generator: torch.Generator) -> PointCloud:
    if len(points.positions) <= count:
        return points
    kept = torch.randperm(len(points.positions), generator=generator)[:count]
    return PointCloud(positions=points.positions[kept], rgb=points.rgb[kept])


def _joined(first: PointCloud, second: PointCloud) -> PointCloud:
    return PointCloud(
        positions=torch.cat([first.positions, second.positions]),
        rgb=torch.cat([first.rgb, second.rgb]),
    )
