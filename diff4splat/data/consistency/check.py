"""Consistency of the cameras, depth, flow and tracks of a clip, to detect wrong readers.

Poses must be rotations. Depth of one frame, reprojected into another, must equal the depth there.
Flow of static pixels must follow from depth and cameras. Tracks must agree with cameras, depth and
flow, and be visible only where depth allows. A mirrored axis, a transposed rotation, ray length
instead of z, or an offset of half a pixel or one frame changes at least one figure.
"""

from dataclasses import dataclass
from typing import Literal

from diff4splat.data.clip import Clip
from diff4splat.data.consistency.pixels import across_views, flow_errors, over_time, rotation_errors
from diff4splat.data.consistency.statistics import (
    ErrorStatistics,
    TrueFraction,
    error_statistics,
    true_fraction,
)
from diff4splat.data.consistency.tracks import compare_at_query, compare_where_visible
from diff4splat.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Consistency:
    """Error statistics per comparison; None if the clip lacks the data."""

    rotation: ErrorStatistics | None
    """Largest entry of RᵀR − I or of det R − 1, per pose."""
    reprojection: ErrorStatistics | None
    """Relative depth error between frames of one view, for static pixels."""
    flow_px: ErrorStatistics | None
    """Stored flow against flow from depth and cameras, for static pixels."""
    found_pixel_px: ErrorStatistics | None
    """Distance of a track to the nearest pixel centre, at its query pixel."""
    found_depth: ErrorStatistics | None
    """Relative error of the z of a track against the depth map, at its query pixel."""
    found_flow_px: ErrorStatistics | None
    """Flow against the displacement of a track, at its query pixel."""
    projection_px: ErrorStatistics | None
    """Projected positions against ``uv``, where visible."""
    found_visible: TrueFraction | None
    """Tracks that are visible at their query pixel."""
    across_views: TrueFraction | None
    """Points of one view that are not in front of the surface that another view sees."""
    visible_depth: TrueFraction | None
    """Visible tracks whose z is that of the depth map, within 3 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """Largest errors and smallest fractions that pass."""

    rotation: float = 1e-5
    pixels: float = 1e-3
    depth: float = 1e-4
    """Relative depth error of tracks at their query pixels."""
    reprojection: float = 0.02
    """Median relative error: edges and occluded surfaces always have larger errors."""
    share: float = 0.98
    visible_share: float = 0.98
    """Fraction of visible tracks at the depth of the map; lower for structures below a pixel."""
    statistic: Literal["max", "median"] = "max"
    """Statistic of pixel and depth errors that is compared."""


EXACT = Tolerances()
"""For synthetic data."""
MEASURED = Tolerances(pixels=1.0, depth=0.03, share=0.8, visible_share=0.8, statistic="median")
"""For data whose depth or tracks were measured or estimated."""


def measure_consistency(clip: Clip) -> Consistency:
    """Compare all data of ``clip`` that constrain each other."""
    views = clip.views
    at_query = [errors for k in range(len(views)) if (errors := compare_at_query(clip, k))]
    visible = [errors for view in views if (errors := compare_where_visible(clip, view))]
    return Consistency(
        rotation=error_statistics(rotation_errors(view.cameras) for view in views),
        reprojection=error_statistics(each for view in views for each in over_time(clip, view)),
        flow_px=error_statistics(each for view in views for each in flow_errors(clip, view)),
        found_pixel_px=error_statistics(each.pixel_px for each in at_query),
        found_depth=error_statistics(each.depth for each in at_query),
        found_flow_px=error_statistics(each.flow_px for each in at_query),
        projection_px=error_statistics(each.projection_px for each in visible),
        found_visible=true_fraction(each.visible for each in at_query),
        across_views=true_fraction(across_views(clip)),
        visible_depth=true_fraction(each.at_depth for each in visible),
    )


def require_consistency(clip: Clip, tolerances: Tolerances = EXACT) -> Consistency:
    """Return the figures of ``clip`` if all of them pass.

    Raises:
        InputError: one fails; with the value, the limit and the usual cause.
    """
    figures = measure_consistency(clip)
    for name, limit, hint in consistency_limits(tolerances):
        figure = getattr(figures, name)
        if figure is None:
            continue
        low, value = isinstance(figure, TrueFraction), checked_value(figures, name, tolerances)
        if value < limit if low else value > limit:
            raise InputError(
                f"clip '{clip.note.identifier}': {name}: expected at "
                f"{'least' if low else 'most'} {limit:.3g}, got {value:.3g} over "
                f"{figure.count} comparisons; {hint}"
            )
    return figures


def checked_value(figures: Consistency, name: str, tolerances: Tolerances) -> float:
    """The statistic of a comparison that its limit is for."""
    figure = getattr(figures, name)
    if isinstance(figure, TrueFraction):
        return figure.share
    always = {"rotation": "max", "reprojection": "median"}
    return getattr(figure, always.get(name, tolerances.statistic))


def consistency_limits(tolerances: Tolerances) -> tuple[tuple[str, float, str], ...]:
    """Name, limit and usual cause of each check, ordered from causes to consequences."""
    cameras = "look for a mirrored axis, a transposed rotation or camera_from_world"
    pixels = "look for pixel centres half a pixel away or a frame too early or late"
    return (
        ("rotation", tolerances.rotation, cameras),
        ("found_pixel_px", tolerances.pixels, pixels),
        ("found_visible", tolerances.share, pixels),
        ("projection_px", tolerances.pixels, f"{cameras}, or {pixels.removeprefix('look for ')}"),
        ("found_depth", tolerances.depth, "look for ray length in place of z, or another unit"),
        ("found_flow_px", tolerances.pixels, "look for flow of another frame or backwards"),
        ("flow_px", tolerances.pixels, f"{cameras}, or flow of another frame"),
        ("reprojection", tolerances.reprojection, f"{cameras}, or ray length in place of z"),
        ("across_views", tolerances.share, f"{cameras}, or views in different world frames"),
        ("visible_depth", tolerances.visible_share, "look for hidden tracks called visible"),
    )
