"""One door for moving images: the name decides the format.

| name | format |
|---|---|
| ``.mp4`` | H.264 where ffmpeg is installed, else VP9, which QuickTime does not play |
| ``.webm`` | VP8 |
| ``.gif``, ``.webp`` | animations that repeat |
| ``%04d.png`` | numbered images |
"""

from collections.abc import Callable, Iterator
from pathlib import Path

from diff4splat.io.movies.animations import write_animation, write_sequence
from diff4splat.io.movies.h264 import h264_encoder, write_h264
from diff4splat.io.movies.suffixes import is_sequence
from diff4splat.io.video import Frame, write_video

NOT_H264 = "VP9 in MP4, since ffmpeg is not installed; browsers and VLC play it, QuickTime does not"


def default_suffix() -> str:
    """MP4 where it holds H.264, else WebM: what the most players of this machine's kind take."""
    return ".webm" if h264_encoder() is None else ".mp4"


def write_movie(
    frames: Iterator[Frame], file: Path, fps: float, advance: Callable[[], None] = lambda: None
) -> tuple[str, ...]:
    """Write frames as they come, whole or not at all; returns what differs from them, in words.

    Raises:
        ConfigError: no format has such a name, or ``fps`` is not a number above 0.
        InputError: there are no frames.
        ShapeError: the frames are not of one size.
        OutputError: no encoder, the folder cannot be written, or the disk is full.
    """
    suffix = file.suffix.lower()
    if is_sequence(file):
        return write_sequence(frames, file, fps, advance)
    if suffix in (".gif", ".webp"):
        return write_animation(frames, file, fps, advance)
    if suffix == ".mp4" and h264_encoder() is not None:
        return write_h264(frames, file, fps, advance)
    notes = write_video(frames, file, fps, advance).notes
    if suffix == ".mp4" and not any("MPEG-4" in note for note in notes):
        return (*notes, NOT_H264)
    return notes
