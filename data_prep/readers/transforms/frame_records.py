"""Frames of ``transforms*.json``: poses, times and files, for D-NeRF and nerfstudio alike.

Axes: ``f`` frames. ``transform_matrix`` is world_from_camera with OpenGL camera axes (x right,
y up, z back); a value of a frame overrides the one given for all.
"""

from collections import ChainMap
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data_prep.readers.files.file_discovery import find_image
from diff4splat.data_prep.readers.files.image_file import ImageFile
from diff4splat.data_prep.readers.files.json_file import read_object
from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.axes import swap_opengl_opencv
from diff4splat.paths.formats.checks import exact_poses
from diff4splat.paths.formats.json_fields import (
    FrameRecord,
    frame_records,
    kind_of,
    optional_number,
)
from diff4splat.paths.formats.transforms_json import pose_matrix


def load_frames(file: Path) -> tuple[dict[str, object], list[FrameRecord]]:
    """The top-level object and the frames, each merged with the values given for all.

    Raises:
        FileFormatError: missing, not JSON, or without frames.
    """
    root = read_object(file)
    shared = {key: value for key, value in root.items() if key != "frames"}
    frames = [
        FrameRecord(
            fields=dict(ChainMap(frame.fields, shared)), label=frame.label, where=frame.where
        )
        for frame in frame_records(root, "frames", str(file))
    ]
    return root, frames


def record_poses(frames: list[FrameRecord], file: Path) -> Float[Tensor, "f 4 4"]:
    """world_from_camera, OpenCV axes, float64.

    Raises:
        FileFormatError: a matrix is missing, not finite, or no rotation and translation.
    """
    matrices = torch.tensor([pose_matrix(frame) for frame in frames], dtype=torch.float64)
    exact = exact_poses(matrices, [frame.label for frame in frames], str(file))
    return swap_opengl_opencv(exact)


def record_image(frame: FrameRecord, folder: Path) -> ImageFile:
    """The image under ``file_path``.

    Raises:
        FileFormatError: no name, no such file, or one outside the folder.
    """
    return ImageFile(file=find_image(folder, file_name(frame, "file_path"), frame.where))


def file_name(frame: FrameRecord, key: str) -> str:
    """The text under ``key``.

    Raises:
        FileFormatError: it is no text.
    """
    name = frame.fields.get(key)
    if not isinstance(name, str):
        raise FileFormatError(
            f"{frame.where}: '{key}': expected the path of a file, got {kind_of(name)}; add it"
        )
    return name


def record_time_s(frame: FrameRecord, advice: str) -> float:
    """The number under ``time``.

    Raises:
        FileFormatError: there is none; ``advice`` says what to do.
    """
    time_s = optional_number(frame.fields, "time", frame.where)
    if time_s is None:
        raise FileFormatError(f"{frame.where}: expected 'time', got none; {advice}")
    return time_s
