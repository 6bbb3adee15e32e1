from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles_render import footprint, random_gaussians, small_camera

from diff4splat.geometry.camera import project
from diff4splat.render.projection import camera_space, footprints, to_pixels
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

COUNT = 40


def spread_gaussians() -> Gaussians:
    """Some on the image, some beyond the guard band."""
    gaussians = random_gaussians(COUNT)
    return replace(gaussians, means=gaussians.means * torch.tensor([2.0, 2.0, 1.0]))


@pytest.mark.parametrize("dilation", [0.0, 0.3])
def test_the_ellipse_is_that_of_the_projected_covariance(dilation: float) -> None:
    gaussians, camera = spread_gaussians(), small_camera()
    prints = footprints(gaussians, camera, RenderSettings(dilation_px2=dilation))
    delta = torch.randn(2, dtype=torch.float64)
    inverse_x, slope, inverse_y = prints.whitening.unbind(1)
    q = (delta[0] * inverse_x) ** 2 + ((delta[1] - slope * delta[0]) * inverse_y) ** 2
    for index in range(COUNT):
        mean, quat, scale = (
            getattr(gaussians, n)[index].numpy() for n in ("means", "quats", "scales")
        )
        pixel, z, _, covariance = footprint(mean, quat, scale, camera, dilation)
        np.testing.assert_allclose(prints.center_px[index], pixel, rtol=1e-12)
        np.testing.assert_allclose(prints.depth[index], z, rtol=1e-12)
        np.testing.assert_allclose(prints.sigma_px[index] ** 2, np.diag(covariance), rtol=1e-11)
        want = delta.numpy() @ np.linalg.inv(covariance) @ delta.numpy()
        np.testing.assert_allclose(q[index], want, rtol=1e-9)


def test_some_of_them_lie_beyond_the_guard_band() -> None:
    # Otherwise the test above would not see the clamp.
    pixels, _ = project(small_camera(), spread_gaussians().means)
    beyond = (pixels[:, 0] < -0.15 * 17) | (pixels[:, 0] > 1.15 * 17)
    assert 0 < int(beyond.sum()) < COUNT


def test_points_project_as_the_geometry_says() -> None:
    camera, points = small_camera(), random_gaussians(COUNT).means
    local = camera_space(camera, points)
    pixels, z = project(camera, points)
    torch.testing.assert_close(to_pixels(camera, local), pixels)
    torch.testing.assert_close(local[:, 2], z)


def test_compensation_is_the_root_of_the_ratio_of_areas() -> None:
    gaussians, camera = random_gaussians(COUNT), small_camera()
    plain = footprints(gaussians, camera, RenderSettings(dilation_px2=0.7))
    kept = footprints(gaussians, camera, RenderSettings(dilation_px2=0.7, antialias=True))
    assert torch.equal(plain.opacities, gaussians.opacities)
    mean, quat, scale = (getattr(gaussians, n)[5].numpy() for n in ("means", "quats", "scales"))
    _, _, bare, covariance = footprint(mean, quat, scale, camera, 0.7)
    factor = np.sqrt(np.linalg.det(bare) / np.linalg.det(covariance))
    np.testing.assert_allclose(kept.opacities[5] / gaussians.opacities[5], factor, rtol=1e-10)
