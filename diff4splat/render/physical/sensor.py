"""Rays of a sensor: through any lens, from all over an aperture, each at a time of its own.

Axes: ``p`` pixels (flat indices, row by row), ``s`` samples, ``r`` = p · s rays; ``c``, ``d`` and
``e`` are samples, or 1 where they do not differ. In camera axes a ray d through the middle of the
lens is in focus at p = d f / d_z on a plane, or d f on a sphere. The ray from the point l of the
aperture is l + τ (p − l) / |p − l|.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.geometry.optics import Aperture, Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.sensor_rows import line_count, line_of, line_shares

_LEAST_SLOPE = 1e-3
"""Of a ray to the plane in focus; flatter ones never get there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Draws:
    """Where rays go; None is the middle."""

    in_pixel: Float[Tensor, "p s 2"] | None = None
    """Offsets (x, y) from the middle, in pixels."""
    on_lens: Float[Tensor, "p s 2"] | None = None
    """In the unit disc."""
    in_exposure: Float[Tensor, "p s"] | None = None
    """Shares of the exposure, in [0, 1)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorRays:
    """Rays in world axes, in the order of pixels and then samples."""

    origins: Float[Tensor, "p s 3"]
    directions: Float[Tensor, "p s 3"]
    exists: Bool[Tensor, "p s"]
    offset_s: Float[Tensor, "p s"]
    """Times, less that of the frame."""
    along: Float[Tensor, "p s"]
    """z of the unit directions in camera axes."""


def sensor_rays(
    camera: PhysicalCamera, pixels: Int[Tensor, " p"], draws: Draws, time_s: float, rolls: bool
) -> SensorRays:
    """The rays of ``pixels`` in a frame of ``time_s``; lines differ in time where it ``rolls``."""
    directions, exists = _through_lens(camera, pixels, draws.in_pixel)
    offset_s = _offsets(camera, pixels, draws.in_exposure, rolls)
    count = max(part.shape[1] for part in (directions, offset_s, draws.on_lens) if part is not None)
    lead = (len(pixels), count)
    origins = torch.zeros_like(directions)
    aperture = camera.optics.aperture
    if aperture is not None and draws.on_lens is not None:
        origins, directions, focused = _from_aperture(directions, draws.on_lens, aperture)
        exists = exists & focused
    along = directions[..., 2].expand(lead)
    origins, directions = _to_world(camera, origins, directions, offset_s, time_s)
    return SensorRays(
        origins=origins.expand(*lead, 3),
        directions=directions.expand(*lead, 3),
        exists=exists.expand(lead),
        offset_s=offset_s.expand(lead),
        along=along,
    )


def _through_lens(
    camera: PhysicalCamera, pixels: Int[Tensor, " p"], in_pixel: Float[Tensor, "p s 2"] | None
) -> tuple[Float[Tensor, "p c 3"], Bool[Tensor, "p c"]]:
    """Unit directions in camera axes; one per pixel where samples do not differ."""
    pinhole = camera.camera
    width = pinhole.size_px[1]
    middles = torch.stack([pixels % width, pixels // width], -1)[:, None].to(pinhole.focal_px) + 0.5
    places = middles if in_pixel is None else middles + in_pixel.to(middles)
    return camera.optics.lens.directions((places - pinhole.center_px) / pinhole.focal_px)


def _offsets(
    camera: PhysicalCamera,
    pixels: Int[Tensor, " p"],
    in_exposure: Float[Tensor, "p s"] | None,
    rolls: bool,
) -> Float[Tensor, "p c"]:
    optics, like = camera.optics, camera.camera.focal_px
    offsets = _moment(optics, like, in_exposure, len(pixels))
    if not rolls or optics.shutter is None:
        return offsets + _share_of_middle(optics) * _number(_readout(optics), like)
    size_px, direction = camera.camera.size_px, optics.shutter.direction
    shares = line_shares(line_count(size_px, direction), direction).to(like)
    own = shares[line_of(pixels, size_px, direction).to(shares.device)] - _anchor(optics)
    return offsets + own[:, None] * _number(optics.shutter.readout_s, like)


def _moment(
    optics: Optics, like: Tensor, in_exposure: Float[Tensor, "p s"] | None, count: int
) -> Float[Tensor, "p c"]:
    """Times within the exposure, relative to the frame's."""
    shares = like.new_full((count, 1), 0.5) if in_exposure is None else in_exposure.to(like)
    return (shares - _anchor(optics)) * _number(optics.exposure_s, like)


def _anchor(optics: Optics) -> float:
    return 0.5 if optics.timestamp == "middle" else 0.0


def _share_of_middle(optics: Optics) -> float:
    """Where the middle of the read-out lies, seen from the frame's time."""
    return 0.5 - _anchor(optics)


def _readout(optics: Optics) -> float | Float[Tensor, ""]:
    return 0.0 if optics.shutter is None else optics.shutter.readout_s


def _number(value: float | Float[Tensor, ""], like: Tensor) -> Float[Tensor, ""]:
    return value.to(like) if isinstance(value, Tensor) else like.new_tensor(value)


def _from_aperture(
    directions: Float[Tensor, "p c 3"], on_lens: Float[Tensor, "p s 2"], aperture: Aperture
) -> tuple[Float[Tensor, "p s 3"], Float[Tensor, "p s 3"], Bool[Tensor, "p c"]]:
    """Starts on the lens, unit directions to what is in focus, and whether anything can be."""
    focus = _number(aperture.focus_distance, directions)
    z = directions[..., 2:]
    if aperture.surface == "plane":
        meets = z > _LEAST_SLOPE
        focus = focus / torch.where(meets, z, 1.0)
    else:
        meets = torch.ones_like(z, dtype=torch.bool)
    flat = on_lens.to(directions) * _number(aperture.radius, directions)
    starts = torch.nn.functional.pad(flat, (0, 1))
    ahead = torch.nn.functional.normalize(directions * focus - starts, dim=-1)
    return starts, ahead, meets[..., 0]


def _to_world(
    camera: PhysicalCamera,
    origins: Float[Tensor, "p c 3"],
    directions: Float[Tensor, "p c 3"],
    offset_s: Float[Tensor, "p d"],
    time_s: float,
) -> tuple[Float[Tensor, "p e 3"], Float[Tensor, "p e 3"]]:
    """At the pose of each ray's time, or at the one pose that there is."""
    poses = camera.camera.world_from_camera.to(directions)
    if camera.track is not None:
        times_s = offset_s.double().flatten() + time_s
        if bool((times_s == times_s[:1]).all()) and not times_s.requires_grad:
            poses = camera.track.at(times_s[:1], directions.dtype)[0]
        else:
            each = camera.track.at(times_s, directions.dtype)
            poses = each.unflatten(0, tuple(offset_s.shape))
    turn, place = poses[..., :3, :3], poses[..., :3, 3]
    turned = (turn @ directions[..., None]).squeeze(-1)
    return (turn @ origins[..., None]).squeeze(-1) + place, turned
