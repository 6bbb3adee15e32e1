"""One picture of a clip that shows at a glance whether images, depth and cameras fit together."""

import cv2
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.data.consistency.sampling import sample
from diff4splat.data_prep.doctor.comparisons import (
    COMPARISONS,
    flow_of_cameras,
    projected_tracks,
    step_of,
)
from diff4splat.data_prep.doctor.examination import Examined, with_unit
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.io.figures.depth_colors import colorize, robust_range
from diff4splat.io.figures.page_layout import Canvas, Style, fitted
from diff4splat.io.pixels import unit_rgb

_WIDTH, _GAP, _COLUMNS, _TITLE_PX = 1400, 16, 4, 96
_PANEL = (_WIDTH - (_COLUMNS + 1) * _GAP) // _COLUMNS
_GOOD, _BAD, _DIM = (126, 214, 144), (255, 112, 96), (154, 160, 172)
Image = Float[Tensor, "h w 3"]


def draw_examined(examined: Examined, verdict: str) -> Image:
    """Panels of the clip under the verdict."""
    panels = _panels(examined.clip)
    height, width = examined.clip.size_px
    tall = round(_PANEL * min(height / width, 1.2))
    rows = -(-len(panels) // _COLUMNS)
    total = _TITLE_PX + rows * (tall + 44 + _GAP) + 34 * len(COMPARISONS) + 3 * _GAP
    page = Canvas(_WIDTH, total)
    sound = not examined.failed
    page.text((_GAP, _GAP), verdict[:110], Style(size_px=26, color=_GOOD if sound else _BAD))
    cause = "" if examined.cause is None else f"likely cause: {examined.cause.text}"
    page.text((_GAP, 56), f"{examined.sequence}   {cause}"[:150], Style(size_px=18))
    for place, (title, rgb) in enumerate(panels):
        row, column = divmod(place, _COLUMNS)
        x, y = _GAP + column * (_PANEL + _GAP), _TITLE_PX + row * (tall + 44 + _GAP)
        page.text((x, y), title, Style(size_px=16, color=_DIM))
        page.image((x, y + 26), fitted(rgb.shape, (_PANEL, tall)), rgb)
    _draw_bars(page, examined, total - 34 * len(COMPARISONS) - _GAP)
    return page.to_rgb()


def _draw_bars(page: Canvas, examined: Examined, top: int) -> None:
    """One bar per comparison; the limit is the white line, on a logarithmic scale."""
    left, span = 560, 560
    for place, each in enumerate(COMPARISONS):
        value, y = examined.errors[each.name], top + 34 * place
        page.text((_GAP, y), each.meaning, Style(size_px=18))
        if value is None:
            page.text((left, y), "not in this clip", Style(size_px=18, color=_DIM))
            continue
        good = value <= each.limit
        # Three decades on each side of the limit.
        share = np.clip((np.log10(max(value, 1e-12) / each.limit) + 3) / 6, 0.01, 1)
        page.box((left, y + 4), (max(int(share * span), 4), 18), _GOOD if good else _BAD)
        page.box((left + span // 2, y), (3, 26), (255, 255, 255))
        text = f"{with_unit(value, each)}   limit {with_unit(each.limit, each)}"
        page.text((left + span + 20, y), text, Style(size_px=18, color=_GOOD if good else _BAD))


def _panels(clip: Clip) -> list[tuple[str, Image]]:
    first, later = 0, step_of(clip.frames)
    view = clip.views[0]
    panels = [
        (f"image {first}", unit_rgb(view.rgb[first])),
        (f"image {later}", unit_rgb(view.rgb[later])),
    ]
    if view.depth is not None:
        warped, error, depth_error = _seen_from_first(clip, first, later)
        panels += [
            (f"image {later} at the places of image {first}", warped),
            ("difference: dark is right", error),
            ("depth: near warm, far cold", _depth_colors(view.depth[first])),
            ("depth error: green right, red wrong", depth_error),
        ]
    if view.flow is not None and view.depth is not None:
        given, expected = _flows(clip, first)
        panels += [("flow as given", given), ("flow of depth and cameras", expected)]
    if projected_tracks(clip) is not None:
        panels.append(("tracks: ring given, dot projected", _draw_tracks(clip)))
    return panels


def _depth_colors(depth: Tensor) -> Image:
    return colorize(depth, robust_range(depth))


def _seen_from_first(clip: Clip, first: int, later: int) -> tuple[Image, Image, Image]:
    """The later image at the first one's pixels, the difference, and the error of depth."""
    view = clip.views[0]
    depth = view.depth[first].double()
    shape = depth.shape
    points = unproject(view.cameras[first].to(torch.float64), depth).reshape(-1, 3)
    uv, z = project(view.cameras[later].to(torch.float64), points)
    places = (uv - 0.5).clamp(-1e4, 1e4).float().reshape(*shape, 2).numpy()
    seen = cv2.remap(view.rgb[later].numpy(), places, None, cv2.INTER_LINEAR)
    inside = ((uv >= 0) & (uv < uv.new_tensor(shape[::-1]))).all(-1) & (z > 0)
    known = (inside & (depth > 0).flatten()).reshape(shape)
    warped = torch.where(known[..., None], unit_rgb(torch.from_numpy(seen)), 0.16)
    difference = (warped - unit_rgb(view.rgb[first])).abs().mean(-1)
    error = torch.where(known, (difference * 3).clamp(0, 1), 0.0)
    sampled = sample(view.depth[later].double(), uv)
    relative = ((z - sampled.depth).abs() / sampled.depth).reshape(shape)
    usable = known & sampled.smooth.reshape(shape)
    return warped, error[..., None].expand(*shape, 3), _traffic_light(relative, usable)


def _traffic_light(relative: Tensor, usable: Tensor) -> Image:
    """Green within 1 %, red from 10 % on."""
    share = ((relative.clamp_min(1e-6).log10() + 2) / 1).clamp(0, 1).float()[..., None]
    good, bad = (torch.tensor(color) / 255 for color in (_GOOD, _BAD))
    return torch.where(usable[..., None], good * (1 - share) + bad * share, 0.16)


def _flows(clip: Clip, frame: int) -> tuple[Image, Image]:
    """Direction as hue, length as brightness, both over the same range."""
    view = clip.views[0]
    given = torch.where(
        view.flow.known[frame][..., None], view.flow.to_next[frame].double(), torch.nan
    )
    expected = torch.full_like(given, torch.nan)
    centers, offset = flow_of_cameras(view, frame)
    column, row = centers.long().unbind(-1)
    expected[row, column] = offset
    longest = float(torch.nan_to_num(given.norm(dim=-1), nan=0.0).quantile(0.95)) or 1.0
    return _flow_colors(given, longest), _flow_colors(expected, longest)


def _flow_colors(flow: Tensor, longest: float) -> Image:
    known = flow.isfinite().all(-1)
    x, y = torch.nan_to_num(flow, nan=0.0, posinf=0.0, neginf=0.0).unbind(-1)
    hue = (torch.atan2(y, x) / (2 * torch.pi) % 1 * 179).to(torch.uint8)
    bright = (torch.hypot(x, y) / longest * 255).clamp(40, 255).to(torch.uint8)
    hsv = torch.stack([hue, torch.full_like(hue, 200), bright], -1).numpy()
    rgb = torch.from_numpy(cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB))
    return torch.where(known[..., None], unit_rgb(rgb), 0.16)


def _draw_tracks(clip: Clip) -> Image:
    """The first image enlarged, so that half a pixel shows."""
    view = clip.views[0]
    scale = max(1, round(1600 / clip.size_px[1]))
    rgb = cv2.resize(view.rgb[0].numpy(), None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    seen = view.track_visible[0].nonzero()[:, 0]
    seen = seen[:: max(1, len(seen) // 60)]
    given = view.track_uv[0][seen].double()
    camera = view.cameras[0].to(torch.float64)
    projected, _ = project(camera, clip.tracks.positions[0][seen].double())
    size = max(4, rgb.shape[1] // 160)
    for ring, dot in zip((given * scale).tolist(), (projected * scale).tolist(), strict=True):
        if all(abs(number) < 1e5 for number in (*ring, *dot)):
            cv2.circle(rgb, [round(n) for n in ring], 2 * size, (255, 255, 255), max(2, size // 3))
            cv2.circle(rgb, [round(n) for n in dot], size, (255, 40, 60), -1)
    return unit_rgb(torch.from_numpy(rgb))
