"""Which pixels the input shows, one by one in NumPy, and flat clips to ask it of."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from diff4splat.data.clip import Clip, ClipMetadata, Tracks, View
from diff4splat.evaluation.protocols.protocol import Targets
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.geometry.camera import Camera, pinhole


def seen_by_loops(case: EvalSample) -> np.ndarray:
    """(image, row, column), from the definition alone."""
    clip = case.clip
    masks = []
    for view, frame in case.targets.pairs:
        depth = clip.views[view].depth[frame].double().numpy()
        mask = np.zeros(depth.shape, bool)
        for row, column in np.ndindex(*depth.shape):
            z = depth[row, column]
            if not (math.isfinite(z) and z > 0):
                continue
            point = _placed(clip.views[view].cameras, frame, (row, column), z)
            looked = _frames_to_look_in(clip, case.input_frames, (view, frame, row, column))
            mask[row, column] = any(_shown(clip.views[0], given, point) for given in looked)
        masks.append(mask)
    return np.stack(masks)


def _matrices(cameras: Camera, frame: int) -> tuple[np.ndarray, np.ndarray]:
    lens = np.eye(3)
    lens[0, 0], lens[1, 1] = cameras.focal_px[frame].tolist()
    lens[:2, 2] = cameras.center_px[frame].numpy()
    return lens, cameras.world_from_camera[frame].double().numpy()


def _placed(cameras: Camera, frame: int, pixel: tuple[int, int], z: float) -> np.ndarray:
    lens, pose = _matrices(cameras, frame)
    local = z * np.linalg.solve(lens, [pixel[1] + 0.5, pixel[0] + 0.5, 1.0])
    return (pose @ [*local, 1.0])[:3]


def _shown(view: View, frame: int, point: np.ndarray) -> bool:
    lens, pose = _matrices(view.cameras, frame)
    local = np.linalg.solve(pose, [*point, 1.0])[:3]
    if local[2] <= 0:
        return False
    x, y, _ = lens @ (local / local[2])
    height, width = view.cameras.size_px
    if not (0 <= x < width and 0 <= y < height):
        return False
    there = float(view.depth[frame, int(y), int(x)])
    return math.isfinite(there) and there > 0 and abs(local[2] - there) <= 0.05 * there


def _frames_to_look_in(
    clip: Clip, given: Sequence[int], place: tuple[int, int, int, int]
) -> Sequence[int]:
    view, frame, row, column = place
    instances = clip.views[view].instances
    if instances is not None and _stands(clip, int(instances[frame, row, column])):
        return given
    earlier, later = [g for g in given if g <= frame], [g for g in given if g >= frame]
    return [*earlier[-1:], *later[:1]]


def _stands(clip: Clip, instance: int) -> bool:
    if clip.tracks is None or instance == 0:
        return False
    mine = clip.tracks.positions[:, clip.tracks.instances == instance].double().numpy()
    # The median depth of the first frame is 4.
    return mine.shape[1] > 0 and bool((np.linalg.norm(mine - mine[0], axis=-1) <= 0.004).all())


FLAT_FRAMES, FLAT_SIZE, FLAT_DEPTH = 5, (8, 10), 4.0


def flat_case(given: tuple[int, ...] = (0, 2, 4), pair: tuple[int, int] = (1, 1)) -> EvalSample:
    """Two equal cameras that stand before a wall; instance 1, with a tracked point that stays."""
    clip = Clip(
        note=ClipMetadata(identifier="flat", source="flat 1", license="CC0-1.0"),
        times_s=torch.arange(FLAT_FRAMES, dtype=torch.float64) / 12,
        views=(_flat_view(), _flat_view()),
        tracks=tracked(torch.zeros(FLAT_FRAMES, 1, 3), [1]),
    )
    return EvalSample(
        clip=clip,
        task="reconstruction",
        targets=Targets(pairs=(pair,), source_frames=()),
        input_frames=given,
        has_depth=True,
    )


def tracked(positions: Tensor, instances: list[int]) -> Tracks:
    """Points of instances."""
    return Tracks(
        positions=positions,
        instances=torch.tensor(instances, dtype=torch.uint8),
        found_at=torch.full((len(instances), 2), -1),
    )


def with_view(case: EvalSample, view: int, **changes: object) -> EvalSample:
    """The case with parts of one view replaced."""
    views = list(case.clip.views)
    views[view] = replace(views[view], **changes)
    return replace(case, clip=replace(case.clip, views=tuple(views)))


def _flat_view() -> View:
    poses = torch.eye(4, dtype=torch.float64).repeat(FLAT_FRAMES, 1, 1)
    return View(
        rgb=torch.zeros(FLAT_FRAMES, *FLAT_SIZE, 3, dtype=torch.uint8),
        depth=torch.full((FLAT_FRAMES, *FLAT_SIZE), FLAT_DEPTH),
        cameras=pinhole(9.0, FLAT_SIZE, torch.float64).with_pose(poses),
        instances=torch.ones(FLAT_FRAMES, *FLAT_SIZE, dtype=torch.uint8),
    )
