"""Gradients of a photograph: all four effects at once, by finite differences and in float32."""

from dataclasses import replace

import pytest
import torch
from oracles_physical import F32, F64, camera_of, dots, keyed, scene_of
from oracles_raster import assert_gradients_agree
from torch import Tensor

from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.motion.spacetime import SpacetimeMotion

SETTINGS = PhotoSettings(
    samples=2, smoothing_px2=0.0, trace=TraceSettings(alpha_cutoff=1e-4, near_distance=0.1)
)
OF_THE_CAMERA = ("radius", "focus", "lens", "readout_s", "exposure_s", "focal", "center", "pose")
OF_THE_SCENE = (
    "means",
    "quats",
    "scales",
    "opacities",
    "sh",
    "velocities",
    "centers",
    "deviations",
)


def inputs(count: int = 2, dtype: torch.dtype = F64, size: float = 0.35) -> dict[str, Tensor]:
    """Everything that is learned, by name."""
    generator = torch.Generator().manual_seed(2)

    def normal(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator, dtype=F64)

    spread = 0.5 * normal(count, 3)
    values = {
        "radius": torch.tensor(0.1),
        "focus": torch.tensor(2.0),
        "lens": torch.tensor([0.02, -0.01, 0.003, 0.001]),
        "readout_s": torch.tensor(0.2),
        "exposure_s": torch.tensor(0.1),
        "focal": torch.tensor([4.0, 4.5]),
        "center": torch.tensor([1.9, 1.6]),
        "pose": torch.eye(4) + 0.02 * normal(4, 4),
        "means": spread + torch.tensor([0.0, 0.0, 3.0]),
        "quats": normal(count, 4),
        "scales": size * (1 + 0.3 * normal(count, 3)).abs().clamp_min(0.3),
        "opacities": 0.3 + 0.5 * normal(count).sigmoid(),
        "sh": 0.3 * normal(count, 4, 3) + 0.2,
        "velocities": normal(count, 3),
        "centers": 0.1 * normal(count),
        "deviations": 0.3 + 0.2 * normal(count).sigmoid(),
    }
    values["pose"][3] = torch.tensor([0.0, 0.0, 0.0, 1.0])
    return {name: value.to(dtype).requires_grad_() for name, value in values.items()}


def camera(own: dict[str, Tensor], size_px: tuple[int, int] = (3, 3)) -> PhysicalCamera:
    optics = Optics(
        lens=OpenCVFisheye(coefficients=own["lens"]),
        aperture=Aperture(radius=own["radius"], focus_distance=own["focus"]),
        shutter=Shutter(readout_s=own["readout_s"]),
        exposure_s=own["exposure_s"],
    )
    made = replace(
        camera_of(size_px, dtype=own["focal"].dtype),
        focal_px=own["focal"],
        center_px=own["center"],
        world_from_camera=own["pose"],
    )
    return PhysicalCamera(camera=made, optics=optics)


def taken(own: dict[str, Tensor], size_px: tuple[int, int] = (3, 3)) -> Tensor:
    base = dots([(0, 0, 1)] * len(own["means"]), dtype=own["means"].dtype)
    names = ("means", "quats", "scales", "opacities", "sh")
    motion = SpacetimeMotion(
        moving_index=torch.arange(len(base)),
        velocities=own["velocities"],
        time_centers_s=own["centers"],
        time_deviations_s=own["deviations"],
        time_range_s=(-5.0, 5.0),
    )
    scene = scene_of(replace(base, **{name: own[name] for name in names}), motion)
    return photograph(scene, camera(own, size_px), 0.02, settings=SETTINGS).rgb


@pytest.mark.parametrize("name", [*OF_THE_CAMERA, *OF_THE_SCENE])
def test_they_are_those_of_finite_differences(name: str) -> None:
    own = inputs()
    others = {other: value.detach() for other, value in own.items()}

    def rgb(value: Tensor) -> Tensor:
        return taken(others | {name: value})

    assert float(rgb(own[name]).detach().max()) > 0.3
    # One random direction of the input against one of the image, not every pair.
    assert torch.autograd.gradcheck(rgb, (own[name],), atol=2e-6, fast_mode=True)


def test_everything_that_is_learned_gets_some() -> None:
    own = inputs()
    taken(own).square().sum().backward()
    for name, value in own.items():
        assert bool(value.grad.any()), name


def test_a_track_gets_some() -> None:
    own = {name: value.detach() for name, value in inputs().items()}
    base = dots([(0, 0, 3), (0.5, 0.2, 2)], 0.4, dtype=F64)
    places = torch.tensor([[0.1, 0.0, 0.0], [-0.2, 0.1, 0.1]], dtype=F64, requires_grad=True)
    readout_s = torch.tensor(0.2, dtype=F64, requires_grad=True)

    def rgb(places: Tensor, readout_s: Tensor) -> Tensor:
        column = torch.nn.functional.pad(places, (0, 1), value=1.0)[..., None]
        poses = torch.cat([torch.eye(4, dtype=F64)[:, :3].expand(2, 4, 3), column], -1)
        times_s = torch.tensor([-0.3, 0.3], dtype=F64)
        still = camera(own | {"readout_s": readout_s})
        track = PoseTrack(times_s=times_s, world_from_camera=poses)
        return photograph(base, replace(still, track=track), settings=SETTINGS).rgb

    assert torch.autograd.gradcheck(rgb, (places, readout_s), atol=2e-6, fast_mode=True)


def test_key_framed_offsets_get_some() -> None:
    own = {name: value.detach() for name, value in inputs().items()}
    base = dots([(0, 0, 3)], 0.4, dtype=F64)
    offsets = 0.3 * torch.randn(3, 1, 3, dtype=F64)

    def rgb(offsets: Tensor) -> Tensor:
        scene = keyed(base, [-0.4, 0.05, 0.4], offsets)
        return photograph(scene, camera(own), settings=SETTINGS).rgb

    assert torch.autograd.gradcheck(rgb, (offsets.requires_grad_(),), atol=2e-6, fast_mode=True)


def test_compiled_in_float32_they_are_those_of_float64() -> None:
    size_px, grads = (12, 14), {}
    weights = torch.randn(*size_px, 3, dtype=F64)
    for dtype in (F64, F32):
        own = inputs(12, dtype, 0.2)
        with torch.no_grad():
            own["focal"] *= 3
            own["center"] *= 4
        (taken(own, size_px) * weights.to(dtype)).sum().backward()
        grads[dtype] = {name: value.grad for name, value in own.items()}
    for name, want in grads[F64].items():
        assert_gradients_agree(grads[F32][name], want, name)
