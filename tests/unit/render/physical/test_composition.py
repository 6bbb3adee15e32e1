"""Lens, aperture, rolling shutter and exposure at once, next to loops over pixels and samples.

The oracle asks the scene for its state at the time of every single ray. Native 4D Gaussians are
exact; others are as near as the tolerance: a Gaussian that is off by e pixels changes a pixel by at
most o e exp(-½) / σ.
"""

import math
from dataclasses import replace

import numpy as np
import oracles_hexplane
import pytest
import torch
from oracles_physical import F64, Ideal, brute_photograph, camera_of, dots, keyed, scene_of

from diff4splat.geometry import quaternion
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.effects import find_effects
from diff4splat.render.physical.sampling import draw
from diff4splat.render.physical.settings import Photograph, PhotoSettings
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene

SIZE, FOCAL = (6, 7), 9.0
SETTINGS = PhotoSettings(
    samples=8, smoothing_px2=0.0, pixel_area=True, seed=5, tolerance_px=0.05,
    trace=TraceSettings(background=(0.1, 0.2, 0.3)),
)  # fmt: skip
FISHEYE = (0.03, -0.01, 0.002, 0.0)
IDEALS = {
    "plane": Ideal(radius=0.15, focus=3.0, readout_s=0.3, exposure_s=0.1),
    "sphere, columns from the right, fisheye, start": Ideal(
        radius=0.15, focus=3.0, sphere=True, readout_s=0.3, direction="right-to-left",
        exposure_s=0.1, starts=True, fisheye=FISHEYE,
    ),
    "rows from below": Ideal(
        radius=0.1, focus=2.0, readout_s=0.2, direction="bottom-to-top", exposure_s=0.2
    ),
}  # fmt: skip


def cloud() -> Gaussians:
    """Seven in the view, elongated, with degree-1 colours."""
    generator = torch.Generator().manual_seed(11)
    numbers = torch.rand(7, 3, generator=generator, dtype=F64)
    depth = 2 + 3 * numbers[:, 2:]
    base = dots([(0, 0, 1)] * 7, dtype=F64)
    return replace(
        base,
        means=torch.cat([0.8 * (numbers[:, :2] - 0.5) * depth, depth], 1),
        quats=torch.randn(7, 4, generator=generator, dtype=F64),
        scales=depth * (0.08 + 0.12 * torch.rand(7, 3, generator=generator, dtype=F64)),
        opacities=0.3 + 0.6 * torch.rand(7, generator=generator, dtype=F64),
        sh=0.6 * torch.randn(7, 4, 3, generator=generator, dtype=F64),
    )


def native() -> Scene:
    generator = torch.Generator().manual_seed(12)
    motion = SpacetimeMotion(
        moving_index=torch.tensor([0, 2, 3, 6]),
        velocities=2 * torch.randn(4, 3, generator=generator, dtype=F64),
        time_centers_s=1.0 + 0.1 * torch.randn(4, generator=generator, dtype=F64),
        time_deviations_s=torch.tensor([0.05, 0.2, 1.0, math.inf], dtype=F64),
        time_range_s=(0.9, 2.0),
    )
    return scene_of(cloud(), motion)


def key_framed() -> Scene:
    generator = torch.Generator().manual_seed(13)
    times = [0.7, 0.95, 1.08, 1.4]
    turns = torch.tensor([1.5, 0, 0, 0]) + 0.4 * torch.randn(4, 7, 4, generator=generator)
    return keyed(
        cloud(), times,
        0.3 * torch.randn(4, 7, 3, generator=generator),
        torch.nn.functional.normalize(turns, dim=-1),
        0.2 * torch.randn(4, 7, 3, generator=generator),
        "cubic",
    )  # fmt: skip


def field() -> Scene:
    torch.manual_seed(14)
    size = oracles_hexplane.HexPlaneSize(space=(4, 4, 4), time=12, channels=16)
    planes = oracles_hexplane.random_planes(
        size, F64, torch.tensor([[-2.0, -2, 1], [2, 2, 6]], dtype=F64)
    )
    planes = replace(planes, time_range_s=(0.0, 2.0))
    heads = ("position", "rotation", "scale", "opacity", "color")
    size = oracles_hexplane.DecoderSize(width=8, depth=2, heads=heads, coefficients=4)
    decoder = oracles_hexplane.make_decoder(planes.feature_count, size, zero_heads=False).to(F64)
    motion = oracles_hexplane.HexPlaneMotion(
        planes=planes, decoder=decoder, moving_index=torch.arange(7)
    )
    return scene_of(cloud(), motion)


def own_camera(ideal: Ideal) -> PhysicalCamera:
    lens = Pinhole()
    if ideal.fisheye is not None:
        lens = OpenCVFisheye(coefficients=torch.tensor(ideal.fisheye, dtype=F64))
    optics = Optics(
        lens=lens,
        aperture=Aperture(
            radius=ideal.radius,
            focus_distance=ideal.focus,
            surface="sphere" if ideal.sphere else "plane",
        ),
        shutter=Shutter(readout_s=ideal.readout_s, direction=ideal.direction),
        exposure_s=ideal.exposure_s,
        timestamp="start" if ideal.starts else "middle",
    )
    pose = torch.eye(4, dtype=F64)
    pose[:3, :3] = quaternion.to_matrix(torch.tensor([1.0, 0.03, -0.04, 0.1], dtype=F64))
    pose[:3, 3] = torch.tensor([0.1, -0.1, 0.2], dtype=F64)
    camera = camera_of(SIZE, FOCAL, F64).with_pose(pose)
    return PhysicalCamera(camera=camera, optics=optics)


def both(
    scene: Scene, ideal: Ideal, dtype: torch.dtype = F64, samples: int = 8
) -> tuple[Photograph, np.ndarray, np.ndarray]:
    """A photograph, and (rgb, where it is sure) by loops."""
    camera, time_s = own_camera(ideal), 1.0
    settings = replace(SETTINGS, samples=samples)
    made = photograph(scene.to(dtype), camera, time_s, settings=settings)
    effects = find_effects(scene, camera, time_s, settings)
    drawn = draw(effects, torch.arange(SIZE[0] * SIZE[1]), settings.seed)
    draws = {
        "lens": drawn.on_lens.numpy(),
        "pixel": drawn.in_pixel.numpy(),
        "exposure": drawn.in_exposure.numpy(),
    }
    want, sure = brute_photograph(scene, camera.camera, ideal, draws, time_s, settings)
    assert sure.mean() > 0.9
    assert want.max() > 0.5
    assert want.std() > 0.05
    assert made.skipped_effects == ()
    assert made.samples == samples
    return made, want, sure


@pytest.mark.parametrize("name", IDEALS)
def test_native_gaussians_are_exact(name: str) -> None:
    made, want, sure = both(native(), IDEALS[name])
    assert made.intervals == 1
    np.testing.assert_allclose(made.rgb.numpy()[sure], want[sure], rtol=0, atol=1e-7)


def test_compiled_native_gaussians_are_those_of_brute_force() -> None:
    made, want, sure = both(native(), IDEALS["plane"], torch.float32)
    np.testing.assert_allclose(made.rgb.numpy()[sure], want[sure], rtol=0, atol=1e-4)


@pytest.mark.parametrize("kind", ["key frames", "field"])
def test_other_motions_are_as_near_as_the_tolerance(kind: str) -> None:
    made, want, sure = both(
        {"key frames": key_framed, "field": field}[kind](), IDEALS["plane"], samples=3
    )
    assert made.intervals > 2
    assert made.interval_error_px <= 0.05
    # Deviations are at least 0.8 px, and at most seven Gaussians are one over another.
    bound = 7 * 0.05 * math.exp(-0.5) / 0.8
    off = np.abs(made.rgb.numpy() - want)[sure]
    assert off.max() < bound
    assert off.mean() < bound / 20
