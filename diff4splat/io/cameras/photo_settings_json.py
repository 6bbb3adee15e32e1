"""How photographs were taken, as plain JSON values: what their bits depend on."""

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.strict_json import (
    JsonObject,
    optional_number,
    optional_whole,
    take_flag,
    take_number,
    take_whole,
)
from diff4splat.render.physical.settings import PhotoSettings


def photo_settings_json(settings: PhotoSettings) -> dict[str, object]:
    """``settings`` without memory, cutoffs and colours; null is the default of each."""
    return {
        "samples": settings.samples,
        "seed": settings.seed,
        "pixel_area": settings.pixel_area,
        "smoothing_px2": settings.smoothing_px2,
        "tolerance_px": settings.tolerance_px,
        "rows_per_chunk": settings.rows_per_chunk,
        "most_intervals": settings.most_intervals,
    }


def read_photo_settings(own: JsonObject, where: str) -> PhotoSettings:
    """The settings that ``photo_settings_json`` wrote.

    Raises:
        FileFormatError: a value is missing, of another kind, or impossible; names it.
    """
    try:
        return PhotoSettings(
            samples=optional_whole(own, "samples", where, least=1),
            seed=take_whole(own, "seed", where),
            pixel_area=take_flag(own, "pixel_area", where),
            smoothing_px2=optional_number(own, "smoothing_px2", where),
            tolerance_px=take_number(own, "tolerance_px", where),
            rows_per_chunk=optional_whole(own, "rows_per_chunk", where, least=1),
            most_intervals=take_whole(own, "most_intervals", where, least=1),
        )
    except ConfigError as error:
        raise FileFormatError(f"{where}: {error}; repair the file") from error
