"""Three frames of a clip as one small JPEG in a data address."""

import base64
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.clip_part import ClipPart
from diff4splat.data_prep.curation.clip_record import ClipRecord
from diff4splat.errors import Diff4SplatError

_HEIGHT_PX, _WIDEST_PX, _QUALITY = 96, 160, 72


class Thumbnails:
    """Reads clips of several folders when they are asked for."""

    def __init__(self, folders: tuple[Path, ...]) -> None:
        self._folders = {folder.resolve().name: ClipFolder(folder) for folder in folders}
        self._places = {
            name: {identifier: number for number, identifier in enumerate(folder.identifiers)}
            for name, folder in self._folders.items()
        }

    def address(self, record: ClipRecord) -> str | None:
        """``data:image/jpeg;...``; None where the clip cannot be read."""
        folder = self._folders[record.folder]
        position = self._places[record.folder][record.identifier]
        last = folder.entries[position].frames - 1
        frames = tuple(sorted({0, last // 2, last}))
        part = ClipPart(
            frames=frames, views=(0,), flow=False, instances=False, masks=False, tracks=False
        )
        try:
            rgb = folder.clip(position, part).views[0].rgb.numpy()
        except (Diff4SplatError, ValueError, OSError):
            return None
        return jpeg_address(rgb)


def jpeg_address(rgb: UInt8[np.ndarray, "t h w 3"]) -> str:
    """Frames side by side."""
    height, width = rgb.shape[1:3]
    factor = min(_HEIGHT_PX / height, _WIDEST_PX / width)
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    small = [cv2.resize(frame, size, interpolation=cv2.INTER_AREA) for frame in rgb]
    strip = cv2.cvtColor(np.concatenate(small, 1), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", strip, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return f"data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode('ascii')}"
