"""Nothing moves, everything moves, half turns, and states far outside of the times of a scene.

Axes: ``n`` Gaussians, ``k`` key times, ``t h w`` displacement maps.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.layered_image.build import build_layered_image
from diff4splat.generation.layered_image.gaussians import image_gaussians
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.rigid_components import rigid_component_offsets
from diff4splat.geometry import quaternion
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.compare import all_finite, finite_gradients, relative_error
from diff4splat.stability.plots import Thumbnail
from diff4splat.stability.subjects.cloud import COUNT, cloud
from diff4splat.stability.subjects.drawn_images import objects
from diff4splat.stability.subjects.generated_scenes import as_file

GROUP = "motion"
LIMIT = 1e-4
ANGLES_DEG = (0.0, 1e-4, 90.0, 179.999, 180.0, 360.0)
BORDER_CELLS = 4


def motion_checks() -> Iterator[Check]:
    """States of motions, interpolated rotations, and layered images that move."""
    for share in (0.0, 1.0):
        moves = "nothing moves" if share == 0 else "everything moves"
        yield _check(f"layered image, {moves}", partial(measure_layers, share), quick=True)
        yield _check(f"key frames, {moves}", partial(measure_state, partial(_keyed, share), 0.3))
    for angle_deg in ANGLES_DEG:
        run = partial(measure_slerp, angle_deg)
        yield _check(f"rotation by {angle_deg:g}°", run, "radians", angle_deg == 180)
    for name, deviation_s, velocity, time_s in (
        ("velocity 1e6", 0.1, 1e6, 0.5),
        ("duration 1e-6 s", 1e-6, 1.0, 0.5),
        ("unlimited duration", math.inf, 1.0, 0.5),
        ("1e6 s after the end", 0.1, 1.0, 1e6),
    ):
        motion = partial(_native, deviation_s, velocity)
        yield _check(f"native 4D, {name}", partial(measure_state, motion, time_s))


def _check(
    name: str, run: Callable[[], Outcome], unit: str = "relative", quick: bool = False
) -> Check:
    return Check(group=GROUP, name=name, run=run, limit=LIMIT, error_unit=unit, quick=quick)


def measure_state(motion: Callable[[torch.dtype], Motion], time_s: float) -> Outcome:
    """All parameters at a time, in float32 and float64."""
    exact = motion(torch.float64).state_at(cloud().to(torch.float64), time_s)
    canonical = cloud()
    values = {field.name: getattr(canonical, field.name) for field in fields(canonical)}
    leaves = {name: value.clone().requires_grad_() for name, value in values.items()}
    got = motion(torch.float32).state_at(replace(canonical, **leaves), time_s)
    pairs = [(getattr(got, name), getattr(exact, name)) for name in leaves]
    return Outcome(
        error=max(relative_error(part, want) for part, want in pairs),
        value_finite=all_finite(part for part, _ in pairs),
        gradient_finite=finite_gradients([part for part, _ in pairs], leaves),
    )


def measure_slerp(angle_deg: float) -> Outcome:
    """How far interpolated rotations are from a constant speed, about random axes."""
    generator = torch.Generator().manual_seed(2)
    axis = torch.randn(64, 3, generator=generator, dtype=torch.float64)
    angle = torch.full((64,), math.radians(angle_deg), dtype=torch.float64)
    start = torch.randn(64, 4, generator=generator, dtype=torch.float64)
    stop = quaternion.multiply(start, quaternion.from_axis_angle(axis, angle))
    # A turn of 180 degrees may go either way round; the shorter arc of 360 is none at all.
    arc = math.radians(min(angle_deg, 360 - angle_deg))
    leaves = {"start": start.float().requires_grad_(), "stop": stop.float().requires_grad_()}
    errors, outputs = [], []
    for weight in (0.0, 1e-6, 0.25, 0.5, 1.0):
        got = quaternion.slerp(**leaves, weight=torch.full((64,), weight))
        outputs.append(got)
        errors.append((_angle_between(start, got.double()) - weight * arc).abs().max())
    return Outcome(
        error=float(torch.stack(errors).max()),
        value_finite=all_finite(outputs),
        gradient_finite=finite_gradients(outputs, leaves),
    )


def _angle_between(start: Float[Tensor, "n 4"], stop: Float[Tensor, "n 4"]) -> Float[Tensor, " n"]:
    """Angle of the rotation that leads from one to the other."""
    turn = quaternion.multiply(quaternion.conjugate(quaternion.normalize(start)), stop.detach())
    return 2 * torch.atan2(turn[:, 1:].norm(dim=1), turn[:, 0].abs())


def measure_layers(share: float) -> Outcome:
    """A layered image of which no pixel moves, or every one."""
    exact, got = (_layered(share, dtype) for dtype in (torch.float64, torch.float32))
    same = len(exact) == len(got)
    view = render(got, as_file(objects()).camera, settings=RenderSettings(dilation_px2=0.0)).rgb
    return Outcome(
        error=relative_error(got.means, exact.means) if same else math.inf,
        value_finite=all_finite([got.means, got.scales, view]),
        note=f"{len(got):,} Gaussians" + ("" if same else f", {len(exact):,} in float64"),
        plots=(Thumbnail(caption="at the end", rgb=view),),
    )


def _layered(share: float, dtype: torch.dtype) -> Gaussians:
    """At the end of a motion to the right."""
    image = as_file(objects())
    image = replace(image, rgb=image.rgb.to(dtype), camera=image.camera.to(dtype))
    height, width = image.camera.size_px
    depth = torch.full((height, width), 4.0, dtype=dtype)
    field = torch.zeros(3, 3, height // 4, width // 4, dtype=dtype)
    field[0] = torch.linspace(0, 4, 3, dtype=dtype)[:, None, None]
    moving = torch.full((height, width), share == 1)
    displacement = rigid_component_offsets(field, moving, depth)
    maps = ImageMaps(depth=depth, displacement=displacement if share else None)
    layered = build_layered_image(image, image, maps, BORDER_CELLS)
    found = image_gaussians(layered, torch.linspace(0, 1, 3, dtype=dtype))
    return found.motion.state_at(found.gaussians, 1.0)


def _keyed(share: float, dtype: torch.dtype) -> KeyframeMotion:
    """Key frames with large offsets, turns by 180 degrees and growth by a factor of 20."""
    count = round(share * COUNT)
    generator = torch.Generator().manual_seed(4)
    rotations = torch.randn(3, count, 4, generator=generator)
    rotations[1] = quaternion.multiply(
        quaternion.normalize(rotations[0]), torch.tensor([0.0, 1.0, 0.0, 0.0]).expand(count, 4)
    )
    return KeyframeMotion(
        key_times_s=torch.tensor([0.0, 0.5, 1.0]),
        moving_index=torch.arange(count),
        offsets=100 * torch.randn(3, count, 3, generator=generator),
        rotations=rotations,
        log_scale_offsets=3 * torch.randn(3, count, 3, generator=generator),
    ).to(dtype)


def _native(deviation_s: float, velocity: float, dtype: torch.dtype) -> SpacetimeMotion:
    """Native 4D Gaussians whose time centres are in the middle."""
    generator = torch.Generator().manual_seed(4)
    return SpacetimeMotion(
        moving_index=torch.arange(COUNT),
        velocities=velocity * torch.randn(COUNT, 3, generator=generator),
        time_centers_s=torch.full((COUNT,), 0.5),
        time_deviations_s=torch.full((COUNT,), deviation_s),
        time_range_s=(0.0, 1.0),
    ).to(dtype)
