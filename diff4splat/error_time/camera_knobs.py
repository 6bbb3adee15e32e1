"""Knobs of physical cameras: what fewer samples, longer chunks and an earlier stop cost.

Axes: ``n`` Gaussians, ``h w`` pixels. A seeded cloud turns around an upright axis, now faster, now
slower, within one frame; its Gaussians turn along. The error is the root mean square difference of
RGB values in [0, 1] from a converged image: one chunk per line, many more samples of another
seed, or rays that never stop.
"""

from dataclasses import dataclass, replace
from functools import cache

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.error_time.knobs import ApproximationSetting
from diff4splat.error_time.render_knobs import half_faint_gaussians
from diff4splat.error_time.scene_knobs import random_gaussians, rmse, truncate_harmonics
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.settings import EXPOSURE_SAMPLES, LENS_SAMPLES, PhotoSettings
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Provenance, Scene

GAUSSIANS = 5_000
SIZE_PX, SMALL_PX = (120, 160), (60, 80)
FRAME_S = 1 / 24
TURN_RAD = 0.25
"""In one frame: what is at the edge of the image goes by 20 pixels or so."""
MIDDLE_DEPTH = 4.0
LENS_RADIUS = 0.15
_ERROR_UNIT = "RMSE of RGB in [0, 1]"
_CONVERGED, _OTHER_SEED = 1024, 1


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeSteps:
    """How the time of an image is split: so many lines to a chunk, or by a tolerance."""

    rows: int | None = None
    tolerance_px: float = 0.1

    @property
    def kind(self) -> str:
        """Who decides."""
        return "rows per chunk" if self.rows else "tolerance"

    @property
    def label(self) -> str:
        """The number alone."""
        return f"{self.rows}" if self.rows else f"{self.tolerance_px:g} px"

    def __str__(self) -> str:
        return f"{self.rows} rows" if self.rows else f"within {self.tolerance_px:g} px"


def chunk_knob() -> ApproximationSetting:
    """How many lines of a rolling shutter see the same straight motion."""
    rows = (SIZE_PX[0], 60, 30, 16, 8, 4, 2, 1)
    tolerances = (3.0, 1.0, 0.3, 0.1)
    return ApproximationSetting(
        name="rows-per-chunk",
        fields=("PhotoSettings.rows_per_chunk", "PhotoSettings.tolerance_px"),
        summary="reading several lines as if what moves went straight and kept its shape",
        error_unit=_ERROR_UNIT,
        settings=(
            *(TimeSteps(rows=count) for count in rows),
            *(TimeSteps(tolerance_px=tolerance) for tolerance in tolerances),
        ),
        default=TimeSteps(tolerance_px=PhotoSettings().tolerance_px),
        reference=TimeSteps(rows=1),
        run=rolling_image,
        error=rmse,
        series=lambda steps: steps.kind,
        label=lambda steps: steps.label,
        label_meaning="lines, or tolerance",
    )


def aperture_knob() -> ApproximationSetting:
    """How many rays of a pixel start from the lens."""
    return _samples_knob(
        "aperture-samples", "averaging a few rays over the aperture", LENS_SAMPLES, blurred_image
    )


def exposure_knob() -> ApproximationSetting:
    """How many times within the exposure a pixel is sampled at."""
    return _samples_knob(
        "exposure-samples", "averaging a few moments", EXPOSURE_SAMPLES, exposed_image
    )


def trace_light_knob() -> ApproximationSetting:
    """When a ray has seen enough layers."""
    return ApproximationSetting(
        name="trace-light-cutoff",
        fields=("TraceSettings.light_cutoff",),
        summary="ending rays where little light comes through from behind",
        error_unit=_ERROR_UNIT,
        settings=tuple(10.0**-power for power in (1, 2, 3, 4, 5, 6, 7)),
        default=TraceSettings().light_cutoff,
        reference=1e-30,
        run=_layered_image,
        error=rmse,
        label=lambda cutoff: f"{cutoff:g}",
        label_meaning="light at which to stop",
    )


def _samples_knob(name: str, summary: str, default: int, run) -> ApproximationSetting:
    return ApproximationSetting(
        name=name,
        fields=("PhotoSettings.samples",),
        summary=summary,
        error_unit=_ERROR_UNIT,
        settings=(1, 2, 4, 8, 16, 32, 64, 128, 256),
        default=default,
        reference=_CONVERGED,
        run=run,
        error=rmse,
        label_meaning="samples per pixel",
    )


def rolling_image(steps: TimeSteps) -> Float[Tensor, "h w 3"]:
    """Read out over the whole frame."""
    settings = PhotoSettings(rows_per_chunk=steps.rows, tolerance_px=steps.tolerance_px)
    return _taken(SIZE_PX, Optics(shutter=Shutter(readout_s=FRAME_S)), settings)


def blurred_image(samples: int) -> Float[Tensor, "h w 3"]:
    """A wide aperture, focused in the middle of the cloud."""
    aperture = Aperture(radius=LENS_RADIUS, focus_distance=MIDDLE_DEPTH)
    return _taken(SMALL_PX, Optics(aperture=aperture), _sampled(samples))


def exposed_image(samples: int) -> Float[Tensor, "h w 3"]:
    """Open for the whole frame."""
    return _taken(SMALL_PX, Optics(exposure_s=FRAME_S), _sampled(samples))


def _sampled(samples: int) -> PhotoSettings:
    return PhotoSettings(samples=samples, seed=_OTHER_SEED if samples == _CONVERGED else 0)


def _layered_image(light_cutoff: float) -> Float[Tensor, "h w 3"]:
    """Half of it saturated, half haze."""
    settings = PhotoSettings(trace=TraceSettings(light_cutoff=light_cutoff))
    camera = PhysicalCamera(camera=pinhole(float(SIZE_PX[1]), SIZE_PX))
    cloud = half_faint_gaussians(GAUSSIANS)
    return photograph(cloud, camera, settings=settings, backend="trace").rgb


def _taken(size_px: tuple[int, int], optics: Optics, settings: PhotoSettings) -> Tensor:
    camera = PhysicalCamera(camera=pinhole(float(size_px[1]), size_px), optics=optics)
    return photograph(turning_scene(GAUSSIANS), camera, settings=settings, backend="trace").rgb


@cache
def turning_scene(count: int) -> Scene:
    """The cloud, around the axis through its middle; fastest in the middle of the frame."""
    cloud = truncate_harmonics(random_gaussians(seed=1, count=count), 0)
    cloud = replace(cloud, opacities=cloud.opacities.sqrt())
    times_s = torch.linspace(-0.5, 0.5, 5) * FRAME_S
    share = (times_s / FRAME_S + 0.5).clamp(0, 1)
    angles = TURN_RAD * (share * share * (3 - 2 * share) - 0.5)
    states = [_turned(cloud, float(angle)) for angle in angles]
    motion = KeyframeMotion(
        key_times_s=times_s,
        moving_index=torch.arange(count),
        offsets=torch.stack([state.means - cloud.means for state in states]),
        rotations=torch.stack([_relative(cloud, state) for state in states]),
        log_scale_offsets=torch.zeros(len(times_s), count, 3),
        interpolation="cubic",
    )
    still = pinhole(float(SIZE_PX[1]), SIZE_PX).with_pose(torch.eye(4)[None])
    path = CameraPath(cameras=still, times_s=torch.zeros(1))
    return Scene(
        gaussians=cloud, motion=motion, path=path, provenance=Provenance(generator="diff4splat")
    )


def _turned(cloud: Gaussians, angle: float) -> Gaussians:
    turn = quaternion.from_axis_angle(torch.tensor([0.0, 1.0, 0.0]), torch.tensor(angle))
    middle = torch.tensor([0.0, 0.0, MIDDLE_DEPTH])
    around = turn.expand(len(cloud), 4)
    means = quaternion.rotate(around, cloud.means - middle) + middle
    return replace(cloud, means=means, quats=quaternion.multiply(around, cloud.quats))


def _relative(cloud: Gaussians, turned: Gaussians) -> Float[Tensor, "n 4"]:
    return quaternion.multiply(quaternion.conjugate(cloud.quats), turned.quats)
