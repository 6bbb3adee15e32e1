"""Members back to a clip, or to the part of it that is wanted."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import torch
from torch import Tensor

from diff4splat.data.clip import Clip, Flow, Tracks, View
from diff4splat.data.clip_part import ClipPart, chosen_frames, chosen_views
from diff4splat.data.codecs.cameras import decode_cameras
from diff4splat.data.codecs.depth import decode_exr, decode_npy
from diff4splat.data.codecs.images import decode_jpeg, decode_png
from diff4splat.data.codecs.masks import decode_masks
from diff4splat.data.codecs.metadata import decode_metadata
from diff4splat.data.codecs.motion import VisibleTracks, decode_flow, decode_tracks
from diff4splat.data.codecs.video import decode_mp4
from diff4splat.data.entry import ClipEntry
from diff4splat.errors import FileFormatError
from diff4splat.geometry.camera import Camera

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Job:
    """What to take from which members."""

    entry: ClipEntry
    members: Mapping[str, bytes]
    frames: tuple[int, ...]
    views: tuple[int, ...]

    def decode(self, suffix: str, decoder: Callable[[bytes], _T]) -> _T:
        """One member, with its name before whatever is wrong with it."""
        if suffix not in self.members:
            raise FileFormatError(f"'{suffix}': expected this member, got a clip without it")
        try:
            return decoder(self.members[suffix])
        except FileFormatError as error:
            raise FileFormatError(f"'{suffix}': {error}") from error

    def of_frames(self, values: Tensor) -> Tensor:
        """The chosen frames; a copy only when some are left out."""
        every = len(self.frames) == self.entry.frames
        return values if every else values[list(self.frames)]


def wanted_members(stored: Collection[str], entry: ClipEntry, part: ClipPart) -> list[str]:
    """The suffixes, among those ``stored``, that ``decode_clip`` will need."""
    names = ["meta.json", "camera.npz", *(["tracks.npz"] if part.tracks else [])]
    for view in chosen_views(part, entry):
        names += [f"rgb{view:02d}.{suffix}" for suffix in ("png", "jpg", "mp4")]
        names += [f"depth{view:02d}.{suffix}" for suffix in ("exr", "npy")]
        names += [f"instances{view:02d}.png"] if part.instances else []
        names += [f"masks{view:02d}.npz"] if part.masks else []
        names += [f"flow{view:02d}.npz"] if part.flow else []
    return [name for name in names if name in stored]


def decode_clip(members: Mapping[str, bytes], entry: ClipEntry, part: ClipPart) -> Clip:
    """The clip out of the bytes of its members, by suffix.

    Raises:
        FileFormatError: a member is missing, damaged, or of another size than the entry says.
        InputError: ``part`` names frames or views that the clip lacks.
    """
    frames, views = chosen_frames(part, entry), chosen_views(part, entry)
    job = _Job(entry=entry, members=members, frames=frames, views=views)
    note = job.decode("meta.json", lambda content: decode_metadata(content, entry))
    cameras = job.decode("camera.npz", lambda content: decode_cameras(content, entry))
    tracks, seen = _tracks(job) if part.tracks and entry.tracks else (None, (None,) * len(views))
    return Clip(
        note=note,
        times_s=job.of_frames(cameras.times_s),
        views=tuple(
            _view(job, number, cameras.views[number], where)
            for number, where in zip(views, seen, strict=True)
        ),
        tracks=tracks,
    )


def _view(job: _Job, number: int, camera: Camera, seen: VisibleTracks | None) -> View:
    instances, flow = f"instances{number:02d}.png", f"flow{number:02d}.npz"
    shape = (job.entry.frames, *job.entry.size_px)
    return View(
        rgb=job.of_frames(_rgb(job, number)),
        depth=_depth(job, f"depth{number:02d}", shape),
        cameras=_cameras(job, camera),
        instances=_instances(job, instances, shape) if instances in job.members else None,
        **_masks(job, f"masks{number:02d}.npz"),
        flow=_flow(job, flow) if flow in job.members else None,
        track_uv=None if seen is None else job.of_frames(seen.uv),
        track_visible=None if seen is None else job.of_frames(seen.visible),
    )


def _cameras(job: _Job, camera: Camera) -> Camera:
    return replace(
        camera,
        focal_px=job.of_frames(camera.focal_px),
        center_px=job.of_frames(camera.center_px),
        world_from_camera=job.of_frames(camera.world_from_camera),
    )


def _rgb(job: _Job, number: int) -> Tensor:
    shape = (job.entry.frames, *job.entry.size_px, 3)
    movie = f"rgb{number:02d}.mp4"
    if movie in job.members:
        return torch.from_numpy(job.decode(movie, lambda content: decode_mp4(content, shape)))
    photo = f"rgb{number:02d}.jpg"
    if photo in job.members:
        return torch.from_numpy(job.decode(photo, lambda content: decode_jpeg(content, shape)))
    image = f"rgb{number:02d}.png"
    return torch.from_numpy(job.decode(image, lambda content: decode_png(content, shape)))


def _depth(job: _Job, name: str, shape: tuple[int, int, int]) -> Tensor | None:
    plain, suffix = f"{name}.npy", f"{name}.exr"
    if plain in job.members:
        return job.decode(plain, lambda content: decode_npy(content, shape, job.frames))
    if suffix not in job.members and "depth" not in job.entry.layers:
        return None
    decoded = job.decode(suffix, lambda content: decode_exr(content, shape))
    return job.of_frames(torch.from_numpy(decoded))


def _masks(job: _Job, suffix: str) -> dict[str, Tensor]:
    if suffix not in job.members:
        return {}
    masks = job.decode(suffix, lambda content: decode_masks(content, job.entry))
    return {name: job.of_frames(mask) for name, mask in masks.items()}


def _instances(job: _Job, suffix: str, shape: tuple[int, ...]) -> Tensor:
    decoded = job.decode(suffix, lambda content: decode_png(content, shape))
    return job.of_frames(torch.from_numpy(decoded))


def _flow(job: _Job, suffix: str) -> Flow:
    """Between the chosen frames, which follow each other."""
    flow = job.decode(suffix, lambda content: decode_flow(content, job.entry))
    pairs = slice(job.frames[0], job.frames[-1])
    return Flow(to_next=flow.to_next[pairs], known=flow.known[pairs], visible=flow.visible[pairs])


def _tracks(job: _Job) -> tuple[Tracks, tuple[VisibleTracks | None, ...]]:
    tracks, seen = job.decode(
        "tracks.npz", lambda content: decode_tracks(content, job.entry, job.views)
    )
    return Tracks(
        positions=job.of_frames(tracks.positions),
        known=None if tracks.known is None else job.of_frames(tracks.known),
        instances=tracks.instances,
        found_at=_renumbered(job, tracks.found_at),
    ), seen


def _renumbered(job: _Job, found_at: Tensor) -> Tensor:
    """(view, frame) within the part; (−1, −1) for what was found outside of it."""
    sizes, chosen = (job.entry.views, job.entry.frames), (job.views, job.frames)
    columns = []
    for column, (size, numbers) in enumerate(zip(sizes, chosen, strict=True)):
        # One more place, reached by index −1, which no choice fills.
        place = torch.full((size + 1,), -1, dtype=torch.int64)
        place[list(numbers)] = torch.arange(len(numbers))
        columns.append(place[found_at[:, column]])
    inside = torch.stack(columns, -1)
    return torch.where((inside < 0).any(-1, keepdim=True), -1, inside)
