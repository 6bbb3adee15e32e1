"""Point maps, as 4DNeX and similar models predict them: a 3D point and a colour for every pixel.

Axes: ``t`` frames, ``h`` rows, ``w`` columns. A ``.npz`` holds ``points`` (or ``xyz``, ``pts3d``,
``point_map``, ``world_points``), t h w 3 or h w 3; ``colors`` (or ``rgb``, ``images``) of the same
shape, in bytes or from 0 to 1; and, if known, ``mask`` (true where a pixel has a point) and
``times_s``. A Gaussian is as large as half the distance to its nearest neighbour in the map.
Nothing is known of the motion between frames, so each frame is kept.
"""

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float

from diff4splat.errors import FileFormatError
from diff4splat.io.npy_header import START_BYTES, read_npy_header
from diff4splat.io.require_file import opened_file
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color

POINTS = ("points", "xyz", "pts3d", "point_map", "world_points")
COLORS = ("colors", "rgb", "images")
MAX_BYTES = 1 << 30
"""Of all arrays together."""
MAX_FRAMES = 10_000
OPACITY = 0.98
_LARGEST = 1e9


def read_point_maps(file: Path, fps: float) -> tuple[list[Gaussians], list[float]]:
    """Gaussians and time in seconds of each frame.

    Raises:
        FileFormatError: another kind of file, arrays that do not fit together or are too large.
    """
    try:
        with opened_file(file, "point maps (.npz)") as stream, zipfile.ZipFile(stream) as archive:
            arrays = _arrays(archive)
        return _frames(arrays, fps)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
    except (zipfile.BadZipFile, OSError, EOFError, ValueError, NotImplementedError) as error:
        raise FileFormatError(f"{file}: expected point maps (.npz), got a damaged file") from error
    except Exception as error:  # zlib and encrypted entries raise what is not documented
        if isinstance(error, MemoryError):
            raise
        raise FileFormatError(f"{file}: expected point maps (.npz), got a damaged file") from error


def _arrays(archive: zipfile.ZipFile) -> dict[str, np.ndarray]:
    entries = [e for e in archive.infolist() if Path(e.filename).stem in _KNOWN]
    if sum(entry.file_size for entry in entries) > MAX_BYTES:
        raise FileFormatError(f"expected at most {MAX_BYTES >> 20} MiB of arrays, got more")
    return {Path(e.filename).stem: _array(archive, e) for e in entries[: len(_KNOWN)]}


_KNOWN = (*POINTS, *COLORS, "mask", "times_s")


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> np.ndarray:
    with archive.open(entry) as stream:
        start = stream.read(START_BYTES)
        header = read_npy_header(start)
        needed = header.data_start + header.data_bytes
        if header.by_columns or needed > entry.file_size:
            raise FileFormatError(f"{entry.filename[:40]}: expected rows of {needed} bytes")
        data = start + stream.read(needed - len(start) if needed > len(start) else 0)
    if len(data) < needed:
        raise FileFormatError(f"{entry.filename[:40]}: expected {needed} bytes, got fewer")
    values = np.frombuffer(data[header.data_start : needed], header.dtype)
    return values.reshape(header.shape)


def _frames(arrays: Mapping[str, np.ndarray], fps: float) -> tuple[list[Gaussians], list[float]]:
    points = _maps(arrays, POINTS)
    colors = _maps(arrays, COLORS)
    if colors.shape != points.shape:
        raise FileFormatError(f"expected colours of shape {points.shape}, got {colors.shape}")
    masks = arrays.get("mask", np.ones(points.shape[:3], bool)).reshape(-1)
    if masks.size != math.prod(points.shape[:3]) or len(points) > MAX_FRAMES:
        raise FileFormatError("expected one mask value per point of at most 10,000 frames")
    masks = masks.astype(bool).reshape(points.shape[:3])
    frames = [_gaussians(*maps) for maps in zip(points, colors, masks, strict=True)]
    if not sum(map(len, frames)):
        raise FileFormatError("expected points, got only masked ones or NaN")
    return frames, _times_s(arrays, len(frames), fps)


def _maps(arrays: Mapping[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    found = [arrays[name] for name in names if name in arrays]
    maps = found[0] if found else np.zeros(0)
    maps = maps[None] if maps.ndim == 3 else maps
    if maps.ndim != 4 or maps.shape[-1] != 3 or maps.dtype.kind not in "fu" or not maps.size:
        raise FileFormatError(
            f"expected an array '{names[0]}' of numbers in frames × rows × columns × 3, got "
            f"{maps.dtype} of shape {maps.shape}"
        )
    return maps


def _times_s(arrays: Mapping[str, np.ndarray], count: int, fps: float) -> list[float]:
    times_s = arrays.get("times_s", np.arange(count) / fps).astype(np.float64).reshape(-1)
    if (
        len(times_s) != count
        or not (np.abs(times_s) < _LARGEST).all()
        or (np.diff(times_s) <= 0).any()
    ):
        raise FileFormatError(f"times_s: expected {count} increasing seconds, got others")
    return times_s.tolist()


def _gaussians(points: np.ndarray, colors: np.ndarray, mask: Bool[np.ndarray, "h w"]) -> Gaussians:
    with np.errstate(invalid="ignore", over="ignore"):
        places = points.astype(np.float64)
        kept = mask & (np.abs(places) < _LARGEST).all(-1)
    rgb = colors / 255.0 if colors.dtype.kind == "u" else colors.astype(np.float64)
    rgb = np.clip(np.nan_to_num(rgb[kept], nan=0.0, posinf=1.0, neginf=0.0), 0, 1)
    size = _spacing(np.where(kept[..., None], places, np.nan))[kept] / 2
    count = int(kept.sum())
    return Gaussians(
        means=torch.from_numpy(places[kept]).float(),
        quats=torch.tensor([1.0, 0, 0, 0]).repeat(count, 1),
        scales=torch.from_numpy(size).float()[:, None].repeat(1, 3),
        opacities=torch.full((count,), OPACITY),
        sh=dc_from_color(torch.from_numpy(rgb)).float()[:, None],
    )


def _spacing(places: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w"]:
    """Distance to the nearest of the four neighbours; the median for points that have none."""
    nearest = np.full(places.shape[:2], np.inf)
    for axis in (0, 1):
        gap = np.linalg.norm(np.diff(places, axis=axis), axis=-1)
        gap = np.where(np.isfinite(gap), gap, np.inf)
        lower, upper = np.split(nearest, [-1], axis)[0], np.split(nearest, [1], axis)[1]
        np.minimum(lower, gap, out=lower)
        np.minimum(upper, gap, out=upper)
    known = nearest[np.isfinite(nearest)]
    typical = float(np.median(known)) if known.size else 1.0
    return np.where(np.isfinite(nearest), nearest, typical)
