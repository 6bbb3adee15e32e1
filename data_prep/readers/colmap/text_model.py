"""Text files of a COLMAP model: one camera or point per line, two lines per image.

Lines that begin with ``#`` are comments. The second line of an image lists 2D points and may be
empty, so empty lines count there.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float

from diff4splat.data_prep.readers.colmap.binary_model import require_known_model
from diff4splat.data_prep.readers.colmap.model import PARAMETERS, ModelCamera, ModelImage
from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import read_bytes

_CAMERA = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS"
_IMAGE = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
_POINT = "POINT3D_ID X Y Z R G B"


def read_cameras(file: Path) -> dict[int, ModelCamera]:
    """Cameras by identifier.

    Raises:
        FileFormatError: missing, with a line of another form, or a model that cannot be read.
    """
    cameras = {}
    for number, line in _lines(file):
        words, where = line.split(), f"{file}: line {number}"
        if len(words) < 4:
            raise _odd(where, _CAMERA)
        require_known_model(words[1], where)
        identifier, width, height = _numbers([words[0], *words[2:4]], int, where, _CAMERA)
        parameters = _numbers(words[4:], float, where, _CAMERA)
        if len(parameters) != PARAMETERS[words[1]]:
            raise _odd(where, f"{_CAMERA} with {PARAMETERS[words[1]]} PARAMS")
        cameras[identifier] = ModelCamera(
            model=words[1], size_px=(height, width), parameters=tuple(parameters)
        )
    return cameras


def read_images(file: Path) -> list[ModelImage]:
    """Images in the order of the file.

    Raises:
        FileFormatError: missing, or with a line of another form.
    """
    images, lines = [], _lines(file, keep_empty=True)
    for number, line in lines:
        if not line.strip():
            continue
        words, where = line.split(maxsplit=9), f"{file}: line {number}"
        if len(words) < 10:
            raise _odd(where, _IMAGE)
        pose = _numbers(words[1:8], float, where, _IMAGE)
        (camera,) = _numbers(words[8:9], int, where, _IMAGE)
        images.append(
            ModelImage(
                name=words[9].strip(),
                camera=camera,
                quat=tuple(pose[:4]),
                translation=tuple(pose[4:]),
            )
        )
        # The line of its 2D points, which may be empty or, at the end of the file, missing.
        next(lines, None)
    return images


def read_points(file: Path) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, "p 3"]]:
    """Positions, and RGB in [0, 1].

    Raises:
        FileFormatError: missing, or with a line of another form.
    """
    rows = []
    for number, line in _lines(file):
        words, where = line.split(maxsplit=7), f"{file}: line {number}"
        if len(words) < 7:
            raise _odd(where, _POINT)
        rows.append(_numbers(words[1:7], float, where, _POINT))
    table = np.array(rows, np.float64).reshape(-1, 6)
    return table[:, :3], table[:, 3:] / 255


def _lines(file: Path, keep_empty: bool = False) -> Iterator[tuple[int, str]]:
    content = read_bytes(file, "a text file of a COLMAP model")
    text = content.decode("utf-8", errors="replace")
    for number, line in enumerate(text.split("\n"), start=1):
        if not line.startswith("#") and (keep_empty or line.strip()):
            yield number, line


def _numbers(words: list[str], kind: type, where: str, form: str) -> list:
    try:
        return [kind(word) for word in words]
    except ValueError:  # of words that are no numbers, and of thousands of digits
        raise _odd(where, form) from None


def _odd(where: str, form: str) -> FileFormatError:
    return FileFormatError(f"{where}: expected {form}, got another line; write the model again")
