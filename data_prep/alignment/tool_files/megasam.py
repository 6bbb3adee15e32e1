"""Output files of MegaSaM, and the normaliser that it divides by and does not keep.

``outputs_cvd/SCENE_sgd_cvd_hr.npz``: ``depths`` (t, h, w) float16, ``intrinsic`` (3, 3),
``cam_c2w`` (t, 4, 4). ``outputs/SCENE_droid.npz`` has the same keys, but its ``depths`` are the
monocular ones that went in: they are refused. ``reconstructions/SCENE/motion_prob.npy`` (t, h/8,
w/8) is low where something moves. Source: the tool's camera_tracking_scripts and cvd_opt.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, Float64

from diff4splat.data_prep.datasets.common import poses
from diff4splat.data_prep.datasets.files.npz_file import NpzFile
from diff4splat.data_prep.readers.files.float_files import npy_array
from diff4splat.errors import FileFormatError, InputError

_SUFFIX = "_sgd_cvd_hr.npz"
_CLIPPED = (1.001e-3, 99.9)
"""Depths at the limits of the tool's clipping are no measurements."""
_PERCENTILE = 98
_LEAST_CONTRAST, _THRESHOLD, _MOST_MOVING = 0.1, 0.4, 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class MegasamScene:
    """One reconstruction, in units of the tool."""

    depth: Float32[np.ndarray, "t h w"]
    """z; 0 where unknown."""
    world_from_camera: Float64[np.ndarray, "t 4 4"]


def find_megasam(folder: Path, identifier: str) -> Path:
    """``ID_sgd_cvd_hr.npz`` of a clip.

    Raises:
        FileFormatError: there is none, or only depth that went in.
    """
    file = folder / f"{identifier}{_SUFFIX}"
    if file.is_file():
        return file
    if (folder / f"{identifier}_droid.npz").is_file():
        raise FileFormatError(
            f"{folder}: expected {file.name}, got {identifier}_droid.npz alone, whose depth is "
            "what went into MegaSaM; run its cvd_opt step"
        )
    raise FileFormatError(f"{folder}: expected {file.name}, got no such file; run MegaSaM")


def read_megasam(file: Path) -> MegasamScene:
    """Depth and poses as the tool wrote them.

    Raises:
        FileFormatError: missing, damaged, or of another form.
    """
    archive = NpzFile(file)
    depth = archive.array("depths", (None, None, None)).astype(np.float32)
    matrices = archive.array("cam_c2w", (len(depth), 4, 4)).astype(np.float64)
    near, far = _CLIPPED
    known = np.isfinite(depth) & (depth > near) & (depth < far)
    return MegasamScene(
        depth=np.where(known, depth, np.float32(0)),
        world_from_camera=poses.cleaned(matrices, f"{file}, cam_c2w"),
    )


def normaliser(
    disparity: Float[np.ndarray, "t h w"], metric_depth: Float[np.ndarray, "t2 h2 w2"]
) -> float:
    """What MegaSaM divided by: lengths of its output over this are metres.

    From the inputs of the tool, Depth Anything's disparity and UniDepth's depth in metres: each
    frame gives scale and shift by medians, the frame with the middle scale · shift counts, and the
    98th percentile of scale · d + shift, halved, is the normaliser.

    Raises:
        InputError: other shapes, or inputs without variation.
    """
    if disparity.shape != metric_depth.shape or not disparity.size:
        raise InputError(
            f"normaliser: expected maps of one shape, got {disparity.shape} and "
            f"{metric_depth.shape}; resize the disparity to the metric depth"
        )
    lines = [
        _median_line(d, 1 / z.clip(1e-6)) for d, z in zip(disparity, metric_depth, strict=True)
    ]
    order = np.argsort([scale * shift for scale, shift in lines], kind="stable")
    scale, shift = lines[order[len(order) // 2]]
    found = float(np.percentile(scale * disparity + shift, _PERCENTILE) / 2)
    if not (np.isfinite(found) and found > 0):
        raise InputError(f"normaliser: expected a number above 0, got {found}; check the inputs")
    return found


def moving_pixels(
    probability: Float[np.ndarray, "t h2 w2"], size_px: tuple[int, int]
) -> Bool[np.ndarray, "t h w"] | None:
    """Pixels that move by ``motion_prob``, low where they do; None where it does not decide.

    It is low on sky, water and bare walls too: without contrast, or with more than 30 % of the
    pixels, nothing is known.
    """
    low, high = float(probability.min()), float(probability.max())
    if high - low < _LEAST_CONTRAST:
        return None
    moving = probability < low + _THRESHOLD * (high - low)
    if moving.mean() > _MOST_MOVING:
        return None
    width_height = size_px[::-1]
    frames = [
        cv2.resize(each.astype(np.uint8), width_height, interpolation=cv2.INTER_NEAREST)
        for each in moving
    ]
    return np.stack(frames).astype(bool)


def read_motion_probability(file: Path) -> Float32[np.ndarray, "t h2 w2"]:
    """``motion_prob.npy``.

    Raises:
        FileFormatError: missing, damaged, or of another form.
    """
    values = np.array(npy_array(file), np.float32)
    if values.ndim != 3 or not values.size or not np.isfinite(values).all():
        raise FileFormatError(f"{file}: expected finite (t, h, w), got shape {values.shape}")
    return values


def _median_line(disparity: np.ndarray, inverse: np.ndarray) -> tuple[float, float]:
    d, y = disparity.astype(np.float64), inverse.astype(np.float64)
    off = d - np.median(d)
    varies = np.abs(off) > 1e-9
    if not varies.any():
        raise InputError("normaliser: expected disparity that varies, got one value in a frame")
    scale = float(np.median((y - np.median(y))[varies] / off[varies]))
    return scale, float(np.median(y - scale * d))
