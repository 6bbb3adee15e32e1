"""``flow00.npz`` of one view, and ``tracks.npz`` of all. Axes as in ``clip``."""

from dataclasses import dataclass
from zipfile import ZipFile

import numpy as np
import torch
from jaxtyping import Bool, Float32
from torch import Tensor

from diff4splat.data.clip import Clip, Flow, Tracks
from diff4splat.data.codecs.npz import (
    encode_npz,
    has_array,
    opened_npz,
    pack,
    take_array,
    take_bits,
)
from diff4splat.data.entry import ClipEntry
from diff4splat.errors import FileFormatError


@dataclass(frozen=True, slots=True, kw_only=True)
class VisibleTracks:
    """Where one view sees the tracked points."""

    uv: Float32[Tensor, "t n 2"]
    visible: Bool[Tensor, "t n"]


def encode_flow(flow: Flow) -> bytes:
    """The member's bytes."""
    return encode_npz(
        {
            "to_next": flow.to_next.numpy(),
            "known": pack(flow.known.numpy()),
            "visible": pack(flow.visible.numpy()),
        }
    )


def decode_flow(content: bytes, entry: ClipEntry) -> Flow:
    """Flow between all frames.

    Raises:
        FileFormatError: damaged, or of another size or type.
    """
    shape = (entry.frames - 1, *entry.size_px)
    with opened_npz(content) as archive:
        return Flow(
            to_next=torch.from_numpy(take_array(archive, "to_next", np.float32, (*shape, 2))),
            known=torch.from_numpy(take_bits(archive, "known", shape)),
            visible=torch.from_numpy(take_bits(archive, "visible", shape)),
        )


def encode_tracks(clip: Clip, tracks: Tracks, packed: bool = True) -> bytes:
    """The member's bytes; a view that does not say where it sees the points has no arrays.

    What is not ``packed`` is larger and read faster.
    """
    arrays = {
        "positions": tracks.positions.numpy(),
        "found_at": tracks.found_at.numpy().astype(np.int32),
    }
    if tracks.instances is not None:
        arrays["instances"] = tracks.instances.numpy()
    if tracks.known is not None:
        arrays["known"] = pack(tracks.known.numpy())
    for number, view in enumerate(clip.views):
        if view.track_uv is not None and view.track_visible is not None:
            arrays[f"uv{number:02d}"] = view.track_uv.numpy()
            arrays[f"visible{number:02d}"] = pack(view.track_visible.numpy())
    return encode_npz(arrays, packed)


def decode_tracks(
    content: bytes, entry: ClipEntry, views: tuple[int, ...]
) -> tuple[Tracks, tuple[VisibleTracks | None, ...]]:
    """The points, and where each of ``views`` sees them.

    Raises:
        FileFormatError: damaged, of another size or type, or found in frames that do not exist.
    """
    frames, count = entry.frames, entry.tracks
    with opened_npz(content) as archive:
        positions = take_array(archive, "positions", np.float32, (frames, count, 3))
        instances = _objects(archive, count)
        gaps = has_array(archive, "known")
        known = take_bits(archive, "known", (frames, count)) if gaps else None
        found_at = take_array(archive, "found_at", np.int32, (count, 2))
        seen = tuple(_seen(archive, view, (frames, count)) for view in views)
    beyond = (found_at < -1) | (found_at >= (entry.views, frames))
    if beyond.any():
        raise FileFormatError(
            f"'found_at': expected views below {entry.views} and frames below {frames}, "
            f"got {found_at[beyond.any(-1)][0].tolist()}"
        )
    tracks = Tracks(
        positions=torch.from_numpy(positions),
        known=None if known is None else torch.from_numpy(known),
        instances=None if instances is None else torch.from_numpy(instances),
        found_at=torch.from_numpy(found_at.astype(np.int64)),
    )
    return tracks, seen


def _objects(archive: ZipFile, count: int) -> np.ndarray | None:
    if not has_array(archive, "instances"):
        return None
    return take_array(archive, "instances", np.uint8, (count,))


def _seen(archive: ZipFile, view: int, shape: tuple[int, int]) -> VisibleTracks | None:
    if not has_array(archive, f"uv{view:02d}"):
        return None
    uv = take_array(archive, f"uv{view:02d}", np.float32, (*shape, 2))
    visible = take_bits(archive, f"visible{view:02d}", shape)
    return VisibleTracks(uv=torch.from_numpy(uv), visible=torch.from_numpy(visible))
