"""Relative disparity by Video Depth Anything: 0 is infinitely far, scale and shift are unknown.

``--save_npz`` writes ``NAME_depths.npz`` with ``depths`` (t, h, w); ``--save_exr`` a folder of one
EXR per frame with the channel Z. The metric checkpoints write metres into the same files: those are
depth, not disparity, and a fit refuses them because they fall where disparity grows.
Source: the tool's run.py.
"""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from diff4splat.data_prep.datasets.files.npz_file import NpzFile
from diff4splat.data_prep.readers.files.float_files import exr_channels
from diff4splat.errors import FileFormatError

_SUFFIX = "_depths.npz"


def find_disparity(folder: Path, identifier: str) -> Path:
    """The file or folder of a clip: ``ID_depths.npz``, ``ID.npz`` or frames in ``ID/``.

    Raises:
        FileFormatError: there is none.
    """
    names = (f"{identifier}{_SUFFIX}", f"{identifier}.npz", identifier)
    found = next((folder / name for name in names if (folder / name).exists()), None)
    if found is None:
        raise FileFormatError(
            f"{folder}: expected {identifier}{_SUFFIX} or a folder {identifier} of EXR frames, got "
            "neither; run Video Depth Anything on the frames of the clip"
        )
    return found


def read_disparity(file: Path) -> Float32[np.ndarray, "t h w"]:
    """Disparity per frame; not finite and negative values become 0, infinitely far.

    Raises:
        FileFormatError: missing, damaged, or of another form.
    """
    values = _frames(file) if file.is_dir() else NpzFile(file).array("depths", (None, None, None))
    if not values.size:
        raise FileFormatError(f"{file}: expected disparity of frames, got none; run the tool again")
    values = np.asarray(values, np.float32)
    return np.where(np.isfinite(values) & (values > 0), values, np.float32(0))


def _frames(folder: Path) -> np.ndarray:
    files = sorted(folder.glob("*.exr"), key=_number)
    frames = []
    for file in files:
        channels = exr_channels(file)
        if "Z" not in channels:
            names = ", ".join(sorted(channels))[:60]
            raise FileFormatError(f"{file}: expected a channel Z, got {names or 'none'}")
        frames.append(np.asarray(channels["Z"], np.float32))
    if len({frame.shape for frame in frames}) > 1:
        raise FileFormatError(f"{folder}: expected frames of one size, got several; run it again")
    return np.stack(frames) if frames else np.zeros((0, 0, 0), np.float32)


def _number(file: Path) -> tuple[int, str]:
    """By the last number of a name, so that frame 10 follows frame 9."""
    numbers = re.findall(r"\d+", file.stem)
    return (int(numbers[-1]) if numbers else -1, file.name)
