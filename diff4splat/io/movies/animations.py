"""GIF and WebP animations, and numbered PNG files.

Axes: ``h w 3`` RGB in [0, 1]. A GIF has 256 colours a frame and times in hundredths of a second.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

from PIL import Image

from diff4splat.errors import ConfigError
from diff4splat.io.atomic import atomic_folder, atomic_path
from diff4splat.io.photos.images import write_png
from diff4splat.io.pixels import to_bytes
from diff4splat.io.video import Frame, first_frame, require_frame

WEBP_QUALITY = 90
MIN_GIF_MS = 20
"""Browsers slow down animations that are faster."""
_NUMBER = re.compile(r"%(0\d+)?d")


def write_animation(
    frames: Iterator[Frame], file: Path, fps: float, advance: Callable[[], None]
) -> tuple[str, ...]:
    """Write a GIF or WebP animation that repeats, whole or not at all.

    Raises:
        ConfigError, InputError, ShapeError: as ``write_video``.
        OutputError: the folder cannot be written, or the disk is full.
    """
    first, rest = first_frame(frames, file, fps)
    options = {"save_all": True, "loop": 0, "duration": round(1000 / fps)}
    notes: tuple[str, ...] = ()
    if file.suffix.lower() == ".gif":
        options["duration"] = max(round(100 / fps) * 10, MIN_GIF_MS)
        notes = (f"a GIF has 256 colours, and {1000 / options['duration']:.3g} frames per second",)
    else:
        options |= {"quality": WEBP_QUALITY, "method": 4}
    images = _images(first, rest, file.suffix.lower() == ".gif", advance)
    with atomic_path(file) as temporary:
        next(images).save(temporary, append_images=images, **options)
    return notes


def write_sequence(
    frames: Iterator[Frame], file: Path, fps: float, advance: Callable[[], None]
) -> tuple[str, ...]:
    """Write one PNG per frame, numbered from 0 at the ``%04d`` of the name; all or none appear.

    Raises:
        ConfigError: the name has no or several numbers.
        InputError, ShapeError: as ``write_video``.
        OutputError: the folder cannot be written, or the disk is full.
    """
    require_numbered(file)
    first, rest = first_frame(frames, file, fps)
    with atomic_folder(file.parent) as staging:
        count, frame = 0, first
        while frame is not None:
            require_frame(frame, count, tuple(first.shape))
            write_png(frame, staging / (file.name % count))
            count += 1
            advance()
            frame = next(rest, None)
    return ()


def require_numbered(file: Path) -> None:
    """Require one number in the name of a sequence.

    Raises:
        ConfigError: the name has no or several numbers.
    """
    if len(_NUMBER.findall(file.name)) != 1 or file.name.count("%") != 1:
        raise ConfigError(f"--out: expected one number such as %04d in the name, got {file.name}")


def _images(
    first: Frame, rest: Iterator[Frame], palette: bool, advance: Callable[[], None]
) -> Iterator[Image.Image]:
    count, frame = 0, first
    while frame is not None:
        require_frame(frame, count, tuple(first.shape))
        image = Image.fromarray(to_bytes(frame))
        yield image.quantize(256) if palette else image
        count += 1
        advance()
        frame = next(rest, None)
