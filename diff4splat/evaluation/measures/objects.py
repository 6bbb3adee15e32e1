"""Integrity of objects: whether what was asked to move moves, alone and in one piece.

Axes: ``h w`` pixels of the first image. Objects and which of them are asked come from the true
masks and notes of the clip. What moves in a scene are the pixels whose surface moves by more than
``still_px`` from the first to the last time.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.clip import ObjectNote
from diff4splat.data.clip_objects import present_objects
from diff4splat.evaluation.measures.images import Entries
from diff4splat.evaluation.measures.object_parts import eroded, is_torn
from diff4splat.evaluation.measures.regions import MIN_PIXELS
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Score, Skip
from diff4splat.evaluation.systems.predictions import scene_flow
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.geometry.rays import pixel_centers
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.scene import Scene

KEYS = ("object_iou", "object_torn")
MIN_AREA_FRACTION = 0.002
"""Smallest image area of an evaluated object, as a fraction of the image."""
MOVED_SHARE = 0.1
"""Share of an object's pixels that move, from which it can be torn."""


def object_masks(sample: EvalSample) -> list[tuple[ObjectNote, Bool[Tensor, "h w"]]]:
    """Named objects of the first image that are large enough, with the pixels of all parts."""
    instances = sample.input_view.instances
    if instances is None:
        return []
    return present_objects(sample.clip.note, instances[0], MIN_AREA_FRACTION)


def image_displacement(scene: Scene, sample: EvalSample) -> Float[Tensor, "h w 2"]:
    """Where each pixel of the first image goes in the first camera, in pixels; 0 without surface.

    What ends behind the camera goes as far as the image is wide.
    """
    camera, last_s = sample.input_view.cameras[0].to(torch.float32), sample.time_s(-1)
    settings = RenderSettings(dilation_px2=scene.dilation_px2)
    depth = render(scene.state_at(0.0), camera, outputs=("depth",), settings=settings).depth
    points = unproject(camera, depth)
    moved = points + scene_flow(scene, camera, 0.0, (last_s,))[0]
    pixels, z = project(camera, moved.flatten(0, 1))
    centers = pixel_centers(camera.size_px, pixels).flatten(0, 1)
    gone = pixels.new_full((1, 2), float(camera.size_px[1]))
    displacement = torch.where((z > 0)[:, None], pixels - centers, gone)
    return displacement.unflatten(0, depth.shape).where((depth > 0)[..., None], 0.0)


def object_entries(row: str, sample: EvalSample, scene: Scene, still_px: float) -> Entries:
    """Overlap and tearing of the objects that move in a clip."""
    asked = [mask for note, mask in object_masks(sample) if note.motion]
    if not asked:
        why = "no named object moves in the first image"
        return [Skip(row=row, key=key, why=why) for key in KEYS]
    return asked_entries(row, image_displacement(scene, sample), asked, still_px)


def asked_entries(
    row: str,
    displacement_px: Float[Tensor, "h w 2"],
    asked: list[Bool[Tensor, "h w"]],
    still_px: float,
) -> Entries:
    """Overlap of what moves with all ``asked`` masks, and the share of them that is torn."""
    moves = displacement_px.norm(dim=-1) > still_px
    overlap = mask_iou(moves, torch.stack(asked).any(0))
    torn = torn_flags(displacement_px, asked, still_px)
    entries: Entries = [Score(row=row, key=KEYS[0], value=round(overlap, 6))]
    if not torn:
        return [*entries, Skip(row=row, key=KEYS[1], why="no object that was asked for moves")]
    return [*entries, Score(row=row, key=KEYS[1], value=round(sum(torn) / len(torn), 6))]


def torn_flags(
    displacement_px: Float[Tensor, "h w 2"], masks: list[Bool[Tensor, "h w"]], still_px: float
) -> list[bool]:
    """Whether each object that moves is torn; those that stay or are too small are left out."""
    moves = displacement_px.norm(dim=-1) > still_px
    inner = [mask for mask in map(eroded, masks) if int(mask.sum()) >= MIN_PIXELS]
    moved = [mask for mask in inner if float(moves[mask].double().mean()) >= MOVED_SHARE]
    return [is_torn(displacement_px, mask) for mask in moved]


def mask_iou(one: Bool[Tensor, "h w"], other: Bool[Tensor, "h w"]) -> float:
    """Intersection over union; 1 if both are empty."""
    union = int((one | other).sum())
    return int((one & other).sum()) / union if union else 1.0


def moves_most(
    displacement_px: Float[Tensor, "h w 2"],
    masks: list[Bool[Tensor, "h w"]],
    named: int,
    still_px: float,
) -> bool:
    """Whether the object at index ``named`` moves, and farther on average than all others."""
    length = displacement_px.norm(dim=-1)
    means = [float(length[mask].mean()) for mask in masks]
    others = [mean for index, mean in enumerate(means) if index != named]
    return means[named] > still_px and means[named] > max(others, default=0.0)
