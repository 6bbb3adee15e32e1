"""DynamicReplica: synthetic rooms with people and animals, two eyes, depth, flow and tracks.

Cameras are PyTorch3D's (row vectors, +x left, +y up), lenses in ``ndc_isotropic``. Depth and flow
are 16-bit PNG whose numbers are the bits of float16, not whole numbers. Tracks are torch files of
the left eye, one per frame. Source: facebookresearch/dynamic_stereo.
"""

import gzip
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from diff4splat.data_prep.datasets.common import poses
from diff4splat.data_prep.datasets.common.folders import require_equal_counts
from diff4splat.data_prep.datasets.common.pytorch3d import camera_of, mapping
from diff4splat.data_prep.datasets.common.sequence import (
    Dataset,
    DatasetFacts,
    FlowMap,
    FrameMaps,
    ListedSequence,
    PointTracks,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.datasets.files.png_file import png_levels
from diff4splat.data_prep.datasets.files.rgb_image import read_rgb, require_size
from diff4splat.data_prep.readers.files.file_discovery import natural_key, resolve_inside
from diff4splat.errors import FileFormatError
from diff4splat.io.checkpoints.torch_file import load_torch_file
from diff4splat.io.require_file import require_file
from diff4splat.paths.formats.json_text import decode_json

FPS = 30.0
_LARGEST_LIST, _PIECE = 2 << 30, 1 << 24
Entries = list[dict[str, Any]]


def _sequences(root: Path) -> Iterator[ListedSequence]:
    for file in sorted(root.rglob("frame_annotations_*.jgz")):
        grouped = _grouped(file)
        for name in sorted(grouped, key=natural_key):
            eyes = grouped[name]
            yield ListedSequence(
                name=f"{file.parent.name}/{name}", open=partial(_open, file.parent, name, eyes)
            )


def _read_at_most(stream: gzip.GzipFile, count: int) -> bytes:
    """Up to ``count`` bytes in pieces: one read would reserve all of them at once."""
    content = bytearray()
    while len(content) < count and (piece := stream.read(min(_PIECE, count - len(content)))):
        content += piece
    return bytes(content)


def _grouped(file: Path) -> dict[str, dict[str, Entries]]:
    """Entries by sequence and eye."""
    require_file(file, "a list of frames")
    try:
        with gzip.open(file) as stream:
            content = _read_at_most(stream, _LARGEST_LIST + 1)
    except (OSError, EOFError, ValueError) as error:
        raise FileFormatError(
            f"{file}: expected a whole gzip file, got a cut off or damaged one; copy it again"
        ) from error
    if len(content) > _LARGEST_LIST:
        raise FileFormatError(f"{file}: expected at most {_LARGEST_LIST >> 30} GiB of text")
    entries = decode_json(content)
    if not isinstance(entries, list) or not all(isinstance(each, dict) for each in entries):
        raise FileFormatError(f"{file}: expected a list of frames, got JSON of another kind")
    grouped: dict[str, dict[str, Entries]] = defaultdict(lambda: defaultdict(list))
    for entry in entries:
        name, eye = _name_and_eye(entry, file)
        grouped[name][eye].append(entry)
    return grouped


def _name_and_eye(entry: dict[str, Any], file: Path) -> tuple[str, str]:
    name, eye = entry.get("sequence_name"), entry.get("camera_name")
    if not isinstance(name, str) or not isinstance(entry.get("frame_number"), int):
        raise FileFormatError(f"{file}: expected sequence_name and frame_number, got {name!r:.60}")
    match = re.fullmatch(r"(.*?)[_-](left|right)", name)
    if match:
        return match[1], match[2]
    return name, eye if eye in ("left", "right") else "left"


def _open(folder: Path, name: str, eyes: dict[str, Entries]) -> Sequence:
    if "left" not in eyes:
        raise FileFormatError(f"{folder}: expected the left eye of '{name}', got the right alone")
    left = sorted(eyes["left"], key=lambda entry: entry["frame_number"])
    views = {
        eye: _view(folder, sorted(entries, key=lambda entry: entry["frame_number"]))
        for eye, entries in sorted(eyes.items())
    }
    where = f"{folder}, sequence '{name}'"
    if len(views) == 2:
        first, second = (view.cameras.world_from_camera.numpy() for view in views.values())
        require_equal_counts(folder, {"left frames": len(first), "right frames": len(second)})
        poses.require_right_of(first, second, where)
    tracked = all(mapping(entry, "trajectories").get("path") for entry in left)
    return Sequence(
        scene=name,
        views=tuple(views.values()),
        times_s=np.arange(len(left)) / FPS,
        tracks=partial(_tracks, folder, left) if tracked else None,
    )


def _view(folder: Path, entries: Entries) -> SequenceView:
    numbers = [entry["frame_number"] for entry in entries]
    if numbers != list(range(len(numbers))):
        raise FileFormatError(f"{folder}: expected frames from 0 without a gap, got {numbers[:9]}")
    size_px = read_rgb(_file(folder, entries[0], "image")).shape[:2]
    where = f"{folder}, {entries[0]['sequence_name']}"
    made = [camera_of(entry, size_px, where) for entry in entries]
    camera_from_world = poses.cleaned(np.stack([pose for pose, _ in made]), where)
    lenses = np.stack([lens for _, lens in made])
    return SequenceView(
        cameras=poses.cameras(poses.inverted(camera_from_world), lenses, size_px),
        read=lambda index: _read(folder, entries[index], size_px),
    )


def _read(folder: Path, entry: dict[str, Any], size_px: tuple[int, int]) -> FrameMaps:
    file = _file(folder, entry, "image")
    rgb = read_rgb(file)
    require_size(file, rgb.shape, size_px)
    depth_file = _file(folder, entry, "depth")
    depth = _half_floats(depth_file)
    require_size(depth_file, depth.shape, size_px)
    adjustment = mapping(entry, "depth").get("scale_adjustment")
    depth = depth * np.float32(1.0 if adjustment is None else adjustment)
    return FrameMaps(
        rgb=rgb,
        depth=np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0)),
        to_next=_flow(folder, entry, "flow_forward", size_px),
        to_previous=_flow(folder, entry, "flow_backward", size_px),
    )


def _half_floats(file: Path) -> np.ndarray:
    """The bits of the numbers as float16."""
    return png_levels(file, 16, 1).astype(np.uint16).view(np.float16).astype(np.float32)


def _flow(
    folder: Path, entry: dict[str, Any], key: str, size_px: tuple[int, int]
) -> FlowMap | None:
    """Halves u and v of one image; absent in the last frame forward and the first one backward."""
    if not mapping(entry, key).get("path"):
        return None
    file = _file(folder, entry, key)
    values = _half_floats(file)
    height, width = size_px
    require_size(file, values.shape, (height, 2 * width))
    offset_px = np.stack([values[:, :width], values[:, width:]], -1)
    return FlowMap(offset_px=offset_px, known=np.isfinite(offset_px).all(-1))


def _tracks(folder: Path, entries: Entries, window: range) -> PointTracks:
    frames = [_points(_file(folder, entries[index], "trajectories")) for index in window]
    if len({len(visible) for _, _, visible in frames}) > 1:
        raise FileFormatError(f"{folder}: expected as many points in every frame, got others")
    uv, positions, visible = (np.stack(part) for part in zip(*frames, strict=True))
    return PointTracks(
        positions=positions, known=np.isfinite(positions).all(-1), uv=uv, visible=visible
    )


def _points(file: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(uv, positions, visible) of one frame."""
    found = load_torch_file(file, "a torch file of tracks")
    try:
        uv = found["traj_2d"][:, :2].double().numpy()
        positions = found["traj_3d_world"].double().numpy()
        visible = found["verts_inds_vis"].bool().numpy()
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise FileFormatError(f"{file}: expected traj_2d, traj_3d_world, verts_inds_vis") from error
    if positions.shape != (len(uv), 3) or visible.shape != (len(uv),):
        raise FileFormatError(
            f"{file}: expected as many points as pixels, got {positions.shape} and {uv.shape}"
        )
    return uv, positions, visible


def _file(folder: Path, entry: dict[str, Any], key: str) -> Path:
    name = mapping(entry, key).get("path")
    if not isinstance(name, str):
        raise FileFormatError(f"{folder}: expected a path of '{key}', got {name!r:.60}")
    return resolve_inside(folder, name, f"{folder}, '{key}'")


DATASET = Dataset(
    facts=DatasetFacts(
        name="dynamic_replica", title="DynamicReplica", license="CC-BY-NC-4.0", metric="exact"
    ),
    expected_files="train/frame_annotations_train.jgz and train/SEQUENCE_left",
    sequences=_sequences,
)
