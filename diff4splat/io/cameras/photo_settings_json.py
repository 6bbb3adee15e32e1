"""``PhotoSettings`` as JSON values: the settings that determine the pixels."""

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.strict_json import (
    JsonObject,
    optional_int,
    optional_number,
    take_flag,
    take_int,
    take_number,
)
from diff4splat.render.physical.settings import PhotoSettings


def photo_settings_json(settings: PhotoSettings) -> dict[str, object]:
    """``settings`` without memory limits, cutoffs and colours; null means the default."""
    return {
        "samples": settings.samples,
        "seed": settings.seed,
        "pixel_area": settings.pixel_area,
        "smoothing_px2": settings.smoothing_px2,
        "tolerance_px": settings.tolerance_px,
        "rows_per_chunk": settings.rows_per_chunk,
        "most_intervals": settings.most_intervals,
    }


def read_photo_settings(source: JsonObject, where: str) -> PhotoSettings:
    """Read the settings that ``photo_settings_json`` wrote.

    Raises:
        FileFormatError: a value is missing, of another type, or out of range.
    """
    try:
        return PhotoSettings(
            samples=optional_int(source, "samples", where, least=1),
            seed=take_int(source, "seed", where),
            pixel_area=take_flag(source, "pixel_area", where),
            smoothing_px2=optional_number(source, "smoothing_px2", where),
            tolerance_px=take_number(source, "tolerance_px", where),
            rows_per_chunk=optional_int(source, "rows_per_chunk", where, least=1),
            most_intervals=take_int(source, "most_intervals", where, least=1),
        )
    except ConfigError as error:
        raise FileFormatError(f"{where}: {error}; repair the file") from error
