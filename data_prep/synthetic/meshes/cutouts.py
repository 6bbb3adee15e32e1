"""Cutouts of meshes: each alone, from several sides, with transparency around it.

mesh ─ turned, lit ─ drawn at twice the size ─ reduced, its instance as opacity ─ PNG
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from diff4splat.captions.vocabulary import UNNAMED
from diff4splat.data.clip import ClipMetadata
from diff4splat.data_prep.synthetic.assembly import object_of
from diff4splat.data_prep.synthetic.cameras import LensSpec, ViewSpec, camera_batch
from diff4splat.data_prep.synthetic.lights import sample_any_lighting
from diff4splat.data_prep.synthetic.materials import image_texture
from diff4splat.data_prep.synthetic.meshes.library import open_library
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape
from diff4splat.data_prep.synthetic.world import World
from diff4splat.errors import InputError
from diff4splat.io.atomic import atomic_folder
from diff4splat.progress.phases import Phases

TILT_DEG, FOV_DEG = (-5.0, 40.0), (20.0, 55.0)
MARGIN = 1.08
LEAST_OPAQUE_PX = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshCutoutJob:
    """Which meshes are drawn, and how often."""

    meshes: Path
    folder: Path
    views: int = 8
    size_px: int = 192
    seed: int = 0


def draw_cutouts(job: MeshCutoutJob, phases: Phases) -> int:
    """Write ``<mesh>-<view>.png`` and ``names.json``; returns the number of images.

    Raises:
        FileFormatError: no mesh library.
        InputError: no mesh has a name that captions know.
        OutputError: the folder cannot be written.
    """
    library = open_library(job.meshes)
    named = [(n, library.noun(n)) for n in range(len(library.notes))]
    named = [(number, noun) for number, noun in named if noun != UNNAMED]
    if not named:
        raise InputError(
            f"{job.meshes}: expected a mesh with a noun of captions, got none; add its noun to "
            "captions/cutout_nouns.py"
        )
    names: dict[str, str] = {}
    with (
        phases.phase("draw cutouts", len(named)) as advance,
        atomic_folder(job.folder) as folder,
    ):
        for number, noun in named:
            shape = library.shape(number)
            for view in range(job.views):
                rgba = cutout(shape, job.size_px, Rng("cutout", job.seed, number, view))
                if int((rgba[..., 3] > 127).sum()) >= LEAST_OPAQUE_PX:
                    names[_written(rgba, folder, f"{number:04d}-{view:02d}")] = noun
            advance()
        (folder / "names.json").write_text(json.dumps(names, indent=0), encoding="utf-8")
    return len(names)


def _written(rgba: UInt8[np.ndarray, "h w 4"], folder: Path, name: str) -> str:
    cv2.imwrite(str(folder / f"{name}.png"), cv2.cvtColor(rgba, cv2.COLOR_RGBA2BGRA))
    return name


def cutout(shape: Shape, size_px: int, rng: Rng) -> UInt8[np.ndarray, "h w 4"]:
    """The object from one side, cropped to it; its longer side has ``size_px`` at most."""
    clip = draw_clip(_world(shape, 2 * size_px, rng), DrawSettings(tracks=0, flow=False))
    view = clip.views[0]
    assert view.instances is not None
    opaque = (view.instances[0].numpy() > 0).astype(np.float32)
    rgb = view.rgb[0].numpy().astype(np.float32)
    premultiplied = np.concatenate([rgb * opaque[..., None], 255 * opaque[..., None]], -1)
    small = cv2.resize(premultiplied, (size_px, size_px), interpolation=cv2.INTER_AREA)
    alpha = small[..., 3:]
    small[..., :3] = small[..., :3] * (255 / np.maximum(alpha, 1.0))
    return _cropped((small.clip(0, 255) + 0.5).astype(np.uint8))


def _cropped(rgba: UInt8[np.ndarray, "s s 4"]) -> UInt8[np.ndarray, "h w 4"]:
    rows, columns = np.nonzero(rgba[..., 3])
    if not len(rows):
        return rgba[:1, :1]
    return rgba[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]


def _world(shape: Shape, side_px: int, rng: Rng) -> World:
    """The object under a sky, with a camera that it fills."""
    lens = LensSpec(size_px=(side_px, side_px), fov_deg=rng.uniform(*FOV_DEG), frames=1, fps=1.0)
    low, high = shape.bounds
    radius = 0.5 * float(np.linalg.norm(high - low))
    center = 0.5 * (low + high)
    view = ViewSpec(
        azimuth_rad=rng.uniform(-np.pi, np.pi),
        tilt_rad=math.radians(rng.uniform(*TILT_DEG)),
        distance_m=MARGIN * radius / math.sin(math.radians(lens.fov_deg) / 2),
        path="static",
        focus_m=(float(center[0]), float(center[1]), float(center[2])),
    )
    light, sky = sample_any_lighting(rng)
    objects = tuple(
        object_of(number, part, part.surface.vertices[None], image_texture(part.image, 1.0))
        for number, part in enumerate(shape.parts, 1)
        if part.image is not None
    )
    return World(
        note=ClipMetadata(identifier="cutout", source="cutout", license="", metric="exact"),
        times_s=np.zeros(1),
        objects=objects,
        light=light,
        sky=sky,
        views=(camera_batch(view, lens, 0.0),),
    )
