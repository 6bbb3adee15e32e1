"""H.264 in MP4 by the ``ffmpeg`` program of this machine; the package itself holds no encoder.

H.264 plays everywhere, but encoders that are free to ship are not: OpenCV's FFmpeg has none.
"""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from diff4splat.errors import OutputError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.video import Frame, even_bytes, first_frame, require_frame, require_frame_count

ENCODERS = {
    "libx264": ("-crf", "18"),
    "libopenh264": ("-b:v", "8M"),
    "h264_videotoolbox": ("-b:v", "8M"),
    "h264_mf": ("-b:v", "8M"),
}
"""In order of preference, with options for a quality at which pixels look like the frames."""
LIST_TIMEOUT_S = 20.0


@cache
def h264_encoder() -> tuple[str, str] | None:
    """The program and the name of its encoder; None where there is no program or no encoder."""
    program = shutil.which("ffmpeg")
    if program is None:
        return None
    try:
        listed = subprocess.run(
            [program, "-hide_banner", "-encoders"],
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            timeout=LIST_TIMEOUT_S,
            check=False,
        ).stdout
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None
    names = set(re.findall(r"^ *V\S* +(\S+)", listed, re.MULTILINE))
    return next(((program, name) for name in ENCODERS if name in names), None)


def write_h264(
    frames: Iterator[Frame], file: Path, fps: float, advance: Callable[[], None]
) -> tuple[str, ...]:
    """Write frames as they come, whole or not at all; returns what differs from them, in words.

    Raises:
        ConfigError, InputError, ShapeError: as ``write_video``.
        OutputError: no encoder, it failed, the folder cannot be written, or the disk is full.
    """
    found = h264_encoder()
    if found is None:
        raise OutputError(f"{file}: expected an H.264 encoder, got none; install ffmpeg")
    first, rest = first_frame(frames, file, fps)
    height, width = even_bytes(first).shape[:2]
    with atomic_path(file) as temporary, tempfile.TemporaryFile() as errors:
        temporary.touch()  # names the trouble with the folder
        process = subprocess.Popen(
            _arguments(found, (height, width), fps, temporary),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        count = _feed(process, first, rest, advance)
        errors.seek(0)
        if process.returncode:
            reason = " ".join(errors.read().decode(errors="replace").split())[-200:]
            raise OutputError(f"{file}: expected a video from ffmpeg, got: {reason}; use .webm")
        require_frame_count(temporary, count, file)
    if (height, width) == tuple(first.shape[:2]):
        return ()
    before, after = f"{first.shape[1]}x{first.shape[0]}", f"{width}x{height}"
    return (f"padded from {before} to {after}, since video needs even sizes",)


def _arguments(
    encoder: tuple[str, str], size_px: tuple[int, int], fps: float, temporary: Path
) -> list[str]:
    program, name = encoder
    source = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size_px[1]}x{size_px[0]}")
    result = ("-an", "-c:v", name, *ENCODERS[name], "-pix_fmt", "yuv420p")
    return [
        *(program, "-hide_banner", "-loglevel", "error", "-nostdin", "-y"),
        *(*source, "-r", f"{fps:g}", "-i", "-"),
        *(*result, "-movflags", "+faststart", str(temporary)),
    ]


def _feed(
    process: subprocess.Popen, first: Frame, rest: Iterator[Frame], advance: Callable[[], None]
) -> int:
    """Hand over every frame, and end the process whatever happens."""
    count, frame = 0, first
    try:
        while frame is not None:
            require_frame(frame, count, tuple(first.shape))
            process.stdin.write(even_bytes(frame).tobytes())
            count += 1
            advance()
            frame = next(rest, None)
        process.stdin.close()
        process.wait()
    except BrokenPipeError:
        process.wait()
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    return count
