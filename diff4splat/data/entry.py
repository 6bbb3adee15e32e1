"""What is known of a clip without opening it: one entry of the manifest."""

from dataclasses import dataclass
from typing import Any, get_args

from diff4splat.data import json_fields
from diff4splat.data.clip import Clip, MotionTruth
from diff4splat.data.json_fields import take, take_choice, take_count, take_number
from diff4splat.data.licenses import commercial_ok
from diff4splat.errors import FileFormatError

LAYERS = ("depth", "instances", "sky", "moving", "flow")
"""Fields of a view that may be absent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipEntry:
    """Sizes and rights of one clip."""

    identifier: str
    frames: int
    size_px: tuple[int, int]
    """(height, width)"""
    views: int
    tracks: int
    """How many points are tracked; 0 when none are."""
    is_static: bool
    license: str
    dataset: str = ""
    scene: str = ""
    fps: float | None = None
    """None where the source has no frame rate, or the clip was written before it was kept."""
    layers: tuple[str, ...] = ("depth",)
    """Of ``LAYERS``, what every view has; clips of version 1 name depth alone."""
    motion: MotionTruth = "unknown"

    @property
    def commercial_ok(self) -> bool:
        """Whether the licence is known to allow commercial use."""
        return commercial_ok(self.license)


def entry_of(clip: Clip) -> ClipEntry:
    """The entry that describes ``clip``."""
    return ClipEntry(
        identifier=clip.note.identifier,
        frames=clip.frames,
        size_px=clip.size_px,
        views=len(clip.views),
        tracks=0 if clip.tracks is None else clip.tracks.positions.shape[1],
        is_static=clip.note.is_static,
        license=clip.note.license,
        dataset=clip.note.dataset,
        scene=clip.note.scene,
        fps=clip.fps,
        layers=tuple(name for name in LAYERS if _has_layer(clip, name)),
        motion=clip.motion_truth,
    )


def _has_layer(clip: Clip, name: str) -> bool:
    return all(getattr(view, name) is not None for view in clip.views)


def entry_to_json(entry: ClipEntry) -> dict[str, Any]:
    """The entry as JSON values."""
    return {
        "id": entry.identifier,
        "frames": entry.frames,
        "size_px": list(entry.size_px),
        "views": entry.views,
        "tracks": entry.tracks,
        "static": entry.is_static,
        "license": entry.license,
        "dataset": entry.dataset,
        "scene": entry.scene,
        "fps": entry.fps,
        "layers": list(entry.layers),
        "motion": entry.motion,
    }


def entry_from_json(source: dict[str, Any]) -> ClipEntry:
    """The entry out of JSON values.

    Raises:
        FileFormatError: a value is missing, of another type, or absurd.
    """
    size = take(source, "size_px", list)
    sane = [type(side) is int and 1 <= side <= json_fields.MAX_SIDE_PX for side in size]
    if len(size) != 2 or not all(sane):
        raise FileFormatError(
            f"'size_px': expected height and width from 1 to {json_fields.MAX_SIDE_PX}, "
            f"got {repr(size)[:60]}"
        )
    is_static = take(source, "static", bool)
    tracks = take_count(source, "tracks", 0, json_fields.MAX_TRACKS)
    # Clips of version 1 had masks of all objects beside their tracks.
    motion = "static" if is_static else "objects" if tracks else "unknown"
    values = {"dataset": "", "scene": "", "layers": ["depth"], "motion": motion} | source
    return ClipEntry(
        identifier=json_fields.take_identifier(source, "id"),
        frames=take_count(source, "frames", 1, json_fields.MAX_FRAMES),
        size_px=(size[0], size[1]),
        views=take_count(source, "views", 1, json_fields.MAX_VIEWS),
        tracks=tracks,
        is_static=is_static,
        license=take(source, "license", str),
        dataset=take(values, "dataset", str),
        scene=take(values, "scene", str),
        fps=take_number(values, "fps"),
        layers=_layers(take(values, "layers", list)),
        motion=take_choice(values, "motion", get_args(MotionTruth)),
    )


def _layers(names: list[Any]) -> tuple[str, ...]:
    if not all(name in LAYERS for name in names):
        raise FileFormatError(
            f"'layers': expected some of {', '.join(LAYERS)}, got {repr(names)[:60]}"
        )
    return tuple(names)
