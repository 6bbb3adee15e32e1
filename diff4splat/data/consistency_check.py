"""Do the contents of a clip agree with each other? Figures that find nearly every wrong reader.

Poses must be rotations; depth of one frame, carried into another, must be the depth seen there; on
what stands still, depth and cameras alone give the flow; tracks must lie where cameras, depth and
flow say, and be visible only where depth lets them. A mirrored axis, a transposed rotation, ray
length for z, half a pixel or one frame too much: each shows in at least one figure.
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
    """Errors by what was compared; None where there was nothing to compare."""

    rotation: ErrorStatistics | None
    """Largest entry of RᵀR − I or of det R − 1, per pose."""
    reprojection: ErrorStatistics | None
    """Relative depth error between frames of one view, on what stands still."""
    flow_px: ErrorStatistics | None
    """From stored flow to that of depth and cameras, on what stands still."""
    found_pixel_px: ErrorStatistics | None
    """From a track to the nearest pixel centre, where it was found."""
    found_depth: ErrorStatistics | None
    """Relative, from a track's z to the depth map, where it was found."""
    found_flow_px: ErrorStatistics | None
    """From flow to the step of a track, where it was found."""
    projection_px: ErrorStatistics | None
    """From projected positions to ``uv``, wherever visible."""
    found_visible: TrueFraction | None
    """Tracks that are visible where they were found."""
    across_views: TrueFraction | None
    """Points of one view that are not before what another view sees there at the same time."""
    visible_depth: TrueFraction | None
    """Visible tracks whose z is that of the depth map, within 3 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """The largest errors and the smallest shares that pass."""

    rotation: float = 1e-5
    pixels: float = 1e-3
    depth: float = 1e-4
    """Relative, of tracks where they were found."""
    reprojection: float = 0.02
    """Relative, of the median: edges and hidden surfaces differ by far more, whatever the data."""
    share: float = 0.98
    visible_share: float = 0.98
    """Of visible tracks at the depth of the map; lower where much is thinner than a pixel."""
    judge: Literal["max", "median"] = "max"
    """What of pixels and depth is compared."""


EXACT = Tolerances()
"""For synthetic data."""
MEASURED = Tolerances(pixels=1.0, depth=0.03, share=0.8, visible_share=0.8, judge="median")
"""For data whose depth or tracks were measured or estimated."""


def measure_consistency(clip: Clip) -> Consistency:
    """Compare everything in ``clip`` that says something of something else."""
    views = clip.views
    found = [made for number in range(len(views)) if (made := compare_at_query(clip, number))]
    seen = [made for view in views if (made := compare_where_visible(clip, view))]
    return Consistency(
        rotation=error_statistics(rotation_errors(view.cameras) for view in views),
        reprojection=error_statistics(each for view in views for each in over_time(clip, view)),
        flow_px=error_statistics(each for view in views for each in flow_errors(clip, view)),
        found_pixel_px=error_statistics(each.pixel_px for each in found),
        found_depth=error_statistics(each.depth for each in found),
        found_flow_px=error_statistics(each.flow_px for each in found),
        projection_px=error_statistics(each.projection_px for each in seen),
        found_visible=true_fraction(each.visible for each in found),
        across_views=true_fraction(across_views(clip)),
        visible_depth=true_fraction(each.at_depth for each in seen),
    )


def require_consistency(clip: Clip, tolerances: Tolerances = EXACT) -> Consistency:
    """Return the figures of ``clip`` when all of them pass.

    Raises:
        InputError: one does not; says which, by how much, and what usually causes it.
    """
    figures = measure_consistency(clip)
    for name, limit, hint in _checks(tolerances):
        figure = getattr(figures, name)
        if figure is None:
            continue
        always = {"rotation": "max", "reprojection": "median"}.get(name, tolerances.judge)
        low = isinstance(figure, TrueFraction)
        value = figure.share if low else getattr(figure, always)
        if value < limit if low else value > limit:
            raise InputError(
                f"clip '{clip.note.identifier}': {name}: expected at "
                f"{'least' if low else 'most'} {limit:.3g}, got {value:.3g} over "
                f"{figure.count} comparisons; {hint}"
            )
    return figures


def _checks(tolerances: Tolerances) -> tuple[tuple[str, float, str], ...]:
    """Figures in an order in which the first failure is nearest to the cause."""
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
