"""The stand-in against what gsplat itself ships in PyTorch, where that is installed."""

import inspect
from types import ModuleType

import fake_gsplat
import pytest
import torch
from oracles_gsplat import random_view

GAUSSIANS, CAMERA = random_view(edge_px=24, count=40)


@pytest.fixture(scope="module")
def gsplat() -> ModuleType:
    """The installed library; importing it compiles nothing."""
    found = pytest.importorskip("gsplat", exc_type=ImportError)
    if not found.__version__.startswith("1.5."):
        pytest.skip(f"the stand-in is of gsplat 1.5, got {found.__version__}")
    return found


def test_parameters_have_the_same_names_order_and_defaults(gsplat: ModuleType) -> None:
    real = inspect.signature(gsplat.rasterization).parameters
    stand_in = inspect.signature(fake_gsplat.rasterization).parameters
    # Versions before 1.5.3 lack some that are not used.
    assert [name for name in stand_in if name in real] == list(real)
    for name in set(real) - {"rolling_shutter"}:
        assert real[name].default == stand_in[name].default, name


def test_footprints_are_the_same(gsplat: ModuleType) -> None:
    del gsplat
    from gsplat.cuda._torch_impl import _fully_fused_projection, _quat_scale_to_covar_preci

    view = CAMERA.camera_from_world
    k = torch.eye(3)
    k[[0, 1], [0, 1]], k[:2, 2] = CAMERA.focal_px, CAMERA.center_px
    height, width = CAMERA.size_px
    covariances, _ = _quat_scale_to_covar_preci(
        GAUSSIANS.quats, GAUSSIANS.scales, compute_preci=False
    )
    radii, centers, _, conics, factors = _fully_fused_projection(
        GAUSSIANS.means, covariances, view[None], k[None], width, height, calc_compensations=True
    )
    local = GAUSSIANS.means @ view[:3, :3].mT + view[:3, 3]
    own_centers, own = fake_gsplat._project(
        local,
        fake_gsplat._covariances(GAUSSIANS.quats, GAUSSIANS.scales, view),
        k,
        (width, height),
    )
    blurred, determinants, own_factors = fake_gsplat._blur(own, 0.3)
    own_conics = blurred[:, [2, 1, 0]] * torch.tensor([1.0, -1.0, 1.0]) / determinants[:, None]
    assert bool((radii > 0).any())
    torch.testing.assert_close(own_centers, centers[0])
    torch.testing.assert_close(own_conics, conics[0], rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(own_factors, factors[0], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_colours_are_the_same(gsplat: ModuleType, degree: int) -> None:
    del gsplat
    from gsplat.cuda._torch_impl import _spherical_harmonics

    directions = torch.nn.functional.normalize(GAUSSIANS.means, dim=-1)
    real = torch.clamp_min(_spherical_harmonics(degree, directions, GAUSSIANS.sh) + 0.5, 0)
    own = fake_gsplat._channels(GAUSSIANS.sh, GAUSSIANS.means, torch.eye(4), degree)
    torch.testing.assert_close(own, real)
