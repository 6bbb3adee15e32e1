"""A clip as the members of a shard: names and bytes, equal for equal clips.

Encoding takes far longer than writing, so it is a function of its own that workers can run; what
comes back goes to ``ShardWriter.write``.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from torch import Tensor

from diff4splat.data.checks import require_first_camera, require_valid_clip
from diff4splat.data.clip import Clip, View
from diff4splat.data.codecs.cameras import encode_cameras
from diff4splat.data.codecs.depth import DepthCoding, encode_exr, encode_npy
from diff4splat.data.codecs.images import encode_jpeg, encode_png
from diff4splat.data.codecs.masks import encode_masks, has_masks
from diff4splat.data.codecs.metadata import encode_metadata
from diff4splat.data.codecs.motion import encode_flow, encode_tracks
from diff4splat.data.codecs.video import encode_mp4
from diff4splat.data.entry import ClipEntry, entry_of
from diff4splat.errors import InputError

_DEFAULT_FPS = 10.0
"""Of the MP4 of a single frame; times are in ``camera.npz``, this is for players alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Coding:
    """How pixels are stored."""

    images: Literal["png", "jpeg", "mp4"] = "png"
    """PNG without loss; JPEG is read fastest; MP4 is smallest, for sets that were video before."""
    depth: DepthCoding = "pxr24"


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """One file of a clip."""

    suffix: str
    """``<field>.<ext>``, such as ``depth00.exr``; in the tar it follows ``<id>.``."""
    content: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class EncodedClip:
    """A clip ready to be written; it can be sent between processes."""

    entry: ClipEntry
    source: str
    members: tuple[Member, ...]


def encode_clip(clip: Clip, coding: Coding | None = None) -> EncodedClip:
    """Check and encode; ``coding`` None is the default one.

    Raises:
        InputError: the clip contradicts itself or cannot be stored so; says what and where.
    """
    require_valid_clip(clip)
    require_first_camera(clip)
    try:
        members = tuple(Member(suffix=s, content=c) for s, c in _members(clip, coding or Coding()))
    except InputError as error:
        raise InputError(f"clip '{clip.note.identifier}': {error}") from error
    return EncodedClip(entry=entry_of(clip), source=clip.note.source, members=members)


def _members(clip: Clip, coding: Coding) -> Iterator[tuple[str, bytes]]:
    """Small ones first: who streams the tar knows the sizes before the pixels come."""
    yield "meta.json", encode_metadata(clip.note, entry_of(clip))
    yield "camera.npz", encode_cameras(clip)
    if clip.tracks is not None and clip.tracks.positions.shape[1]:
        yield "tracks.npz", encode_tracks(clip, clip.tracks, packed=coding.depth != "half_plain")
    fps = _fps(clip.times_s)
    for number, view in enumerate(clip.views):
        yield from ((f"{name}{number:02d}.{ext}", c) for name, ext, c in _pixels(view, coding, fps))


def _pixels(view: View, coding: Coding, fps: float) -> Iterator[tuple[str, str, bytes]]:
    rgb = view.rgb.numpy()
    if coding.images == "mp4":
        yield "rgb", "mp4", encode_mp4(rgb, fps)
    else:
        jpeg = coding.images == "jpeg"
        yield "rgb", "jpg" if jpeg else "png", encode_jpeg(rgb) if jpeg else encode_png(rgb)
    if view.depth is not None:
        depth, plain = view.depth.numpy(), coding.depth == "half_plain"
        content = encode_npy(depth) if plain else encode_exr(depth, coding.depth)
        yield "depth", "npy" if plain else "exr", content
    if view.instances is not None:
        yield "instances", "png", encode_png(view.instances.numpy())
    if has_masks(view):
        yield "masks", "npz", encode_masks(view)
    if view.flow is not None:
        yield "flow", "npz", encode_flow(view.flow)


def _fps(times_s: Tensor) -> float:
    return float(1 / np.median(times_s.diff().numpy())) if len(times_s) > 1 else _DEFAULT_FPS
