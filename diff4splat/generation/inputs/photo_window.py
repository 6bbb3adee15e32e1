"""Which part of a photograph an image shows: what belongs to the photograph is cut alike."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoWindow:
    """A rectangle of the upright photograph; outside of it the edge goes on."""

    photo_px: tuple[int, int]
    """(height, width) of the upright photograph."""
    corner_px: tuple[int, int]
    """(row, column) of the first pixel; negative where the image was padded."""
    size_px: tuple[int, int]
    """(height, width) of the rectangle."""
    orientation: int = 1
    """EXIF orientation of the file, before it was turned upright."""

    @classmethod
    def full(cls, size_px: tuple[int, int]) -> "PhotoWindow":
        """All of a photograph."""
        return cls(photo_px=size_px, corner_px=(0, 0), size_px=size_px)
