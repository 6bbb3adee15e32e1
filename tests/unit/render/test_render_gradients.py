"""Analytic against numeric gradients, far from the cutoff, where the image is continuous."""

from dataclasses import replace

import pytest
import torch
from oracles_render import random_gaussians, small_camera
from torch import Tensor
from torch.autograd import gradcheck

from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings

CONTINUOUS = RenderSettings(alpha_cutoff=1e-12, background=(0.3, 0.2, 0.1))
SMALL = (4, 5)


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "sh"])
def test_gaussian_parameters(name: str) -> None:
    gaussians, camera = random_gaussians(4), small_camera(SMALL)

    def images(value: Tensor) -> Tensor:
        made = render(
            replace(gaussians, **{name: value}),
            camera,
            outputs=("rgb", "depth"),
            settings=CONTINUOUS,
        )
        return torch.cat([made.rgb, made.depth[..., None]], -1)

    assert gradcheck(images, getattr(gaussians, name).requires_grad_(), fast_mode=True)


@pytest.mark.parametrize("name", ["world_from_camera", "focal_px", "center_px"])
def test_camera_parameters(name: str) -> None:
    gaussians, camera = random_gaussians(4), small_camera(SMALL)

    def images(value: Tensor) -> Tensor:
        made = render(
            gaussians,
            replace(camera, **{name: value}),
            outputs=("rgb", "alpha"),
            settings=CONTINUOUS,
        )
        return torch.cat([made.rgb, made.alpha[..., None]], -1)

    assert gradcheck(images, getattr(camera, name).requires_grad_(), fast_mode=True)


@pytest.mark.parametrize(
    "settings", [replace(CONTINUOUS, antialias=True), replace(CONTINUOUS, dilation_px2=0.0)]
)
def test_dilation_and_its_compensation(settings: RenderSettings) -> None:
    gaussians, camera = random_gaussians(3), small_camera(SMALL)

    def images(scales: Tensor) -> Tensor:
        return render(replace(gaussians, scales=scales), camera, settings=settings).rgb

    assert gradcheck(images, gaussians.scales.requires_grad_(), fast_mode=True)


def test_beyond_the_guard_band() -> None:
    gaussians, camera = random_gaussians(3), small_camera(SMALL)
    aside = gaussians.means + torch.tensor([2.0, 0.0, 0.0])

    def images(means: Tensor) -> Tensor:
        return render(
            replace(gaussians, means=means, scales=gaussians.scales * 4),
            camera,
            settings=CONTINUOUS,
        ).rgb

    assert gradcheck(images, aside.requires_grad_(), fast_mode=True)


def test_flow() -> None:
    gaussians, camera = random_gaussians(3), small_camera(SMALL)
    pose = camera.world_from_camera.clone()
    pose[:3, 3] += torch.tensor([0.1, 0.05, 0.2])
    settings = replace(CONTINUOUS, flow_camera=camera.with_pose(pose))

    def images(means: Tensor) -> Tensor:
        return render(
            replace(gaussians, means=means), camera, outputs=("flow",), settings=settings
        ).flow

    assert gradcheck(images, gaussians.means.requires_grad_(), fast_mode=True)
