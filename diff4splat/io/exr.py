"""Depth videos as OpenEXR: one float32 part per frame, with its camera in the header.

Axes: ``t`` frames, ``h w`` pixels. Channel ``Z`` is z-depth, ZIP-compressed without loss; 0 means
no depth. A lens that sees behind itself has no z-depth; its files have a channel ``distance``, the
length of the ray. Attributes per part: ``time_s``, ``focal_px``, ``center_px``,
``world_from_camera``, ``unit``, ``conventions``, ``frame_count``, and ``optics`` (JSON) of physical
cameras; numbers are double precision.
"""

import errno
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, Literal

import numpy as np
import OpenEXR
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from diff4splat.errors import FileFormatError, InputError, OutputError, ShapeError
from diff4splat.geometry.camera import Camera
from diff4splat.io.atomic import atomic_path
from diff4splat.io.exr_header import exr_sizes
from diff4splat.io.require_file import require_file
from diff4splat.io.silence_stderr import silence_native_stderr
from diff4splat.paths.camera_path import CameraPath, require_valid_path

_REST = (
    "OpenCV axes (x right, y down, z forward); "
    "pixel centres at +0.5; world_from_camera maps homogeneous column vectors"
)
CONVENTIONS = f"Z is depth along the optical axis, 0 where unknown; {_REST}"
_OF_QUANTITY = {
    "depth": ("Z", CONVENTIONS),
    "distance": ("distance", f"distance is the length of the ray, 0 where unknown; {_REST}"),
}
Quantity = Literal["depth", "distance"]


def write_depth_exr(
    depth: Float[Tensor, "t h w"],
    path: CameraPath,
    file: Path | str,
    unit: Literal["scene-units", "metres"] = "scene-units",
    quantity: Quantity = "depth",
    optics: str | None = None,
) -> None:
    """Write a depth video whole or not at all; NaN, infinite and negative depth becomes 0.

    ``optics`` is JSON (see ``optics_json``) of a physical camera.

    Raises:
        InputError: there are no frames.
        ShapeError: the path has another length or image size.
        OutputError: the folder cannot be written, or the disk is full.
    """
    file = Path(file)
    want = (len(path), *path.cameras.size_px)
    if tuple(depth.shape) != want:
        raise ShapeError(f"depth: expected {want} (from the camera path), got {tuple(depth.shape)}")
    if len(path) == 0:
        raise InputError(f"{file}: expected at least one frame of depth, got none")
    frames = depth.detach().cpu().float()
    frames = torch.where(torch.isfinite(frames) & (frames > 0), frames, 0.0).numpy()
    channel, conventions = _OF_QUANTITY[quantity]
    said = {"conventions": conventions} | ({"optics": optics} if optics else {})
    parts = [
        OpenEXR.Part(_header(path, index, unit) | said, {channel: frame}, f"frame_{index:04d}")
        for index, frame in enumerate(frames)
    ]
    with atomic_path(file) as temporary:
        _write(parts, temporary)
        _verify(frames, temporary, file, channel)


def read_depth_exr(
    file: Path | str, quantity: Quantity = "depth"
) -> tuple[Float[Tensor, "t h w"], CameraPath]:
    """Depth in float32 and the cameras in float64, as written by ``write_depth_exr``.

    Raises:
        FileFormatError: missing, damaged, cut off, of another quantity, or without the camera
            attributes.
    """
    file = Path(file)
    require_file(file, "an OpenEXR depth file")
    try:
        headers, frames = _read(file, _OF_QUANTITY[quantity][0])
        return torch.from_numpy(frames), _path(headers, frames.shape[1:])
    except (FileFormatError, InputError, ShapeError) as error:
        raise FileFormatError(f"{file}: {error}") from error


def _header(path: CameraPath, index: int, unit: str) -> dict[str, Any]:
    camera = path.cameras[index]
    return {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        # An array of one keeps double precision; a plain number would be stored as float32.
        "time_s": _doubles(path.times_s[index : index + 1]),
        "focal_px": _doubles(camera.focal_px),
        "center_px": _doubles(camera.center_px),
        "world_from_camera": _doubles(camera.world_from_camera),
        "unit": unit,
        "conventions": CONVENTIONS,
        "frame_count": len(path),
    }


def _doubles(values: Tensor) -> np.ndarray:
    return values.detach().cpu().double().numpy()


def _write(parts: list[OpenEXR.Part], temporary: Path) -> None:
    """Write the parts; the library wraps the system's errors in its own, without their number."""
    try:
        with _silent(), OpenEXR.File(parts) as opened:
            opened.write(str(temporary))
    except RuntimeError as error:
        full = os.strerror(errno.ENOSPC) in str(error)
        raise OSError(errno.ENOSPC if full else errno.EIO, str(error)) from error


def _verify(
    frames: Float32[np.ndarray, "t h w"], temporary: Path, file: Path, channel: str
) -> None:
    """Read back what was written: the library does not report a full disk."""
    try:
        complete = np.array_equal(_read(temporary, channel)[1], frames)
    except FileFormatError:
        complete = False
    if not complete:
        raise OutputError(
            f"{file}: expected to write {len(frames)} frames, but the file came out incomplete; "
            "the disk may be full, free some space or choose another folder"
        )


@contextmanager
def _silent() -> Iterator[io.StringIO]:
    """Catch what the library prints: it reports damaged pixels only that way."""
    said = io.StringIO()
    with silence_native_stderr(), redirect_stdout(said):
        yield said


def _read(file: Path, channel: str) -> tuple[list[dict[str, Any]], Float32[np.ndarray, "t h w"]]:
    """Headers and depth of every part."""
    with _silent():
        exr_sizes(file)
    try:
        with _silent() as said, OpenEXR.File(str(file), separate_channels=True) as opened:
            headers = [dict(part.header) for part in opened.parts]
            found = [part.channels for part in opened.parts]
            frames = [channels[channel].pixels for channels in found if channel in channels]
            others = {name for channels in found for name in channels} - {channel}
    except Exception as error:  # damaged data makes the library raise almost anything
        raise FileFormatError("expected an OpenEXR file, got a damaged or other one") from error
    # A frame that cannot be decoded is left out by the library; only the others still tell.
    counts = [header.get("frame_count") for header in headers]
    if all(count is None for count in counts) and not said.getvalue():
        raise FileFormatError("expected depth with cameras, got an OpenEXR file of another kind")
    if not frames and others and not said.getvalue():
        raise FileFormatError(
            f"expected a channel '{channel}', got {', '.join(sorted(others))}: z and distance "
            "along the ray are not the same"
        )
    whole = all(isinstance(count, int) and count == len(frames) for count in counts)
    if said.getvalue() or not whole:
        raise FileFormatError("expected depth in every frame, got a cut off or damaged file")
    if len({(frame.shape, frame.dtype.name) for frame in frames}) != 1:
        raise FileFormatError("expected float32 frames of one size, got several kinds")
    return headers, np.stack(frames)


def _path(headers: list[dict[str, Any]], size_px: tuple[int, int]) -> CameraPath:
    def take(name: str, shape: tuple[int, ...]) -> Tensor:
        values = [np.asarray(header.get(name, ())) for header in headers]
        if any(value.shape != shape or value.dtype != np.float64 for value in values):
            raise FileFormatError(f"expected attribute '{name}' in every part, got some without it")
        return torch.from_numpy(np.stack(values))

    cameras = Camera(
        focal_px=take("focal_px", (2,)),
        center_px=take("center_px", (2,)),
        world_from_camera=take("world_from_camera", (4, 4)),
        size_px=(int(size_px[0]), int(size_px[1])),
    )
    return require_valid_path(
        CameraPath(cameras=cameras, times_s=take("time_s", (1,))[:, 0]), "path"
    )
