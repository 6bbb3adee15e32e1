"""One ``camera/*.json`` of Nerfies and HyperNeRF.

``orientation`` is camera_from_world, row by row, in OpenCV axes; ``position`` is the camera's
centre; the focal length along y is ``focal_length`` times ``pixel_aspect_ratio``; distortion is
OpenCV's (k₁, k₂, k₃ and p₁, p₂). Older files call the last ``tangential``
(https://github.com/google/nerfies#datasets).
"""

from dataclasses import dataclass
from pathlib import Path

from diff4splat.data_prep.readers.common.intrinsics import Intrinsics
from diff4splat.data_prep.readers.files.json_file import read_object
from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.json_fields import number_list, numbers, optional_number


@dataclass(frozen=True, slots=True, kw_only=True)
class NerfiesCamera:
    """As in the file, in its world and for its full image."""

    lens: Intrinsics
    orientation: list[list[float]]
    """camera_from_world rotation, by rows."""
    position: list[float]


def read_nerfies_camera(file: Path) -> NerfiesCamera:
    """The camera of one image.

    Raises:
        FileFormatError: missing, or a value is missing, of another kind or not finite.
    """
    record, where = read_object(file), str(file)
    rows = record.get("orientation")
    if not isinstance(rows, list) or len(rows) != 3:
        raise FileFormatError(f"{where}: 'orientation': expected 3 rows of 3 numbers, got others")
    width, height = numbers(record, "image_size", 2, where)
    focal_px = optional_number(record, "focal_length", where)
    aspect = optional_number(record, "pixel_aspect_ratio", where)
    if focal_px is None or focal_px <= 0 or min(width, height) < 1:
        raise FileFormatError(
            f"{where}: expected a focal_length and an image_size above 0, got {focal_px}, "
            f"{width:g} and {height:g}; repair the file"
        )
    column, row = numbers(record, "principal_point", 2, where)
    tangential = "tangential" if "tangential" in record else "tangential_distortion"
    k1, k2, k3 = _distortion(record, "radial_distortion", 3, where)
    p1, p2 = _distortion(record, tangential, 2, where)
    lens = Intrinsics(
        focal_px=(focal_px, focal_px * (1.0 if aspect is None else aspect)),
        center_px=(column, row),
        size_px=(int(height), int(width)),
        skew_px=optional_number(record, "skew", where) or 0.0,
        radial=(k1, k2, k3),
        tangential=(p1, p2),
    )
    orientation = [number_list(values, 3, f"{where}: 'orientation'") for values in rows]
    return NerfiesCamera(
        lens=lens, orientation=orientation, position=numbers(record, "position", 3, where)
    )


def _distortion(record: dict[str, object], key: str, count: int, where: str) -> list[float]:
    return [0.0] * count if record.get(key) is None else numbers(record, key, count, where)
