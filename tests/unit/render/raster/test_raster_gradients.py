"""Gradients of the CPU kernels against autograd through a dense table in float64."""

from dataclasses import dataclass, fields, replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_raster import (
    LENS,
    PARAMETERS,
    Dense,
    assert_gradients_agree,
    cloud,
    dense,
    leaves,
    lens_leaves,
    wide_camera,
)
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.render.api import render
from diff4splat.render.raster.raster_settings import TILE_SIZES_PX
from diff4splat.render.settings import OUTPUTS, RenderOutput, RenderSettings
from diff4splat.scene.gaussians import Gaussians

CAMERA = wide_camera((45, 51))
LATER = CAMERA.with_pose(
    torch.tensor(
        [[1.0, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, -0.1], [0, 0, 0, 1]], dtype=torch.float32
    )
)
COUNT = 90
TOLERANCE = 2e-5
CHANGES = {
    "plain": {},
    "antialias": {"antialias": True},
    "no dilation": {"dilation_px2": 0.0},
    "both": {"dilation_px2": 0.0, "antialias": True},
    "far support": {"alpha_cutoff": 1e-9},
    "clipped": {"alpha_max": 0.3},
    "early end": {"light_cutoff": 0.4},
    "late end": {"light_cutoff": 1e-30},
    "small tiles": {"tile_px": 8},
}


@dataclass
class Inputs:
    """Everything that can have a gradient."""

    gaussians: Gaussians
    camera: Camera
    later: Camera
    features: Tensor
    background: Tensor

    def named(self) -> dict[str, Tensor]:
        own = {name: getattr(self.gaussians, name) for name in PARAMETERS}
        own |= {name: getattr(self.camera, name) for name in LENS}
        own |= {f"later {name}": getattr(self.later, name) for name in LENS}
        return own | {"features": self.features, "background": self.background}


def inputs(gaussians: Gaussians, camera: Camera, dtype: torch.dtype, channels: int = 2) -> Inputs:
    generator = torch.Generator().manual_seed(5)
    features = torch.randn(len(gaussians), channels, generator=generator).to(dtype)
    return Inputs(
        gaussians=leaves(gaussians.to(dtype)),
        camera=lens_leaves(camera, dtype),
        later=lens_leaves(replace(LATER, size_px=camera.size_px), dtype),
        features=features.requires_grad_(),
        background=torch.tensor([0.2, 0.5, 1.0], dtype=dtype).requires_grad_(),
    )


def settings_of(given_inputs: Inputs, **changes: object) -> RenderSettings:
    return RenderSettings(
        flow_camera=given_inputs.later,
        features=given_inputs.features,
        background=given_inputs.background,
        **changes,
    )


def loss(made: RenderOutput | Dense, names: tuple[str, ...], sure: Tensor) -> Tensor:
    """Random weights on the pixels that are sure."""
    generator, total = torch.Generator().manual_seed(3), 0.0
    for name in names:
        image = getattr(made, name)
        weight = torch.randn(image.shape, generator=generator, dtype=torch.float64)
        weight = weight * sure.view(*sure.shape, *[1] * (image.ndim - 2))
        total = total + (image * weight.to(image)).sum()
    return total


def assert_gradients(
    gaussians: Gaussians,
    camera: Camera = CAMERA,
    names: tuple[str, ...] = OUTPUTS,
    tolerance: float = TOLERANCE,
    channels: int = 2,
    **changes: object,
) -> None:
    got = inputs(gaussians, camera, torch.float32, channels)
    want = inputs(gaussians, camera, torch.float64, channels)
    table = dense(want.gaussians, want.camera, settings_of(want, **changes))
    assert table.unsure_share < 0.3
    sure = ~table.median_unsure
    loss(table, names, sure).backward()
    own = settings_of(got, **changes)
    made = render(got.gaussians, got.camera, outputs=names, settings=own, backend="raster")
    loss(made, names, sure).backward()
    for name, leaf in got.named().items():
        exact = want.named()[name].grad
        if exact is None or leaf.grad is None:
            assert exact is None or not exact.any(), name
            assert leaf.grad is None or not leaf.grad.any(), name
        else:
            assert_gradients_agree(leaf.grad, exact, name, tolerance)


@pytest.mark.parametrize("spread_px", [1.0, 6.0])
@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_of_all_images_at_once(changes: dict, spread_px: float) -> None:
    assert_gradients(cloud(COUNT, bands=4, spread_px=spread_px), **changes)


@pytest.mark.parametrize("name", OUTPUTS)
def test_of_one_image(name: str) -> None:
    assert_gradients(cloud(COUNT, bands=4), names=(name,))


@pytest.mark.parametrize("bands", [1, 4, 9, 16])
def test_through_harmonics(bands: int) -> None:
    assert_gradients(cloud(COUNT, bands=bands, spread_px=4.0), names=("rgb",))


@pytest.mark.parametrize("channels", [1, 3, 4, 9])
def test_of_features(channels: int) -> None:
    assert_gradients(cloud(COUNT), names=("features",), channels=channels)


@pytest.mark.parametrize("tile_px", TILE_SIZES_PX)
def test_with_tiles_of_any_size(tile_px: int) -> None:
    assert_gradients(cloud(COUNT, spread_px=6.0), names=("rgb", "alpha"), tile_px=tile_px)


def test_beyond_the_guard_band() -> None:
    gaussians = cloud(COUNT, spread_px=20.0)
    aside = replace(gaussians, means=gaussians.means * torch.tensor([2.5, 2.5, 1.0]))
    assert_gradients(aside, names=("rgb", "alpha"), alpha_cutoff=1e-6)


@settings(max_examples=20, deadline=None)
@given(
    st.integers(0, 10_000),
    st.tuples(st.integers(2, 40), st.integers(2, 40)),
    st.sampled_from(list(CHANGES.values())),
    st.floats(0.5, 10.0),
)
def test_of_random_scenes(seed: int, size: tuple[int, int], changes: dict, spread: float) -> None:
    gaussians = cloud(30, seed, bands=4, spread_px=spread)
    # Few pixels and few Gaussians: what nearly cancels weighs more. Depth would divide noise by
    # next to no weight.
    assert_gradients(gaussians, wide_camera(size), ("rgb", "alpha", "features"), 2e-4, **changes)


SHAPES = {
    "needles": {"scales": [2.0, 0.02, 0.01]},
    "discs": {"scales": [0.3, 0.3, 1e-4]},
    "dots": {"scales": [1e-4, 3e-4, 2e-4]},
    "walls": {"scales": [30.0, 90.0, 50.0]},
    "opaque": {"opacities": 1.0},
    "beyond opaque": {"opacities": 3.0},
    "faint": {"opacities": 0.01},
    "unnormalised": {"quats": [10.0, -20.0, 5.0, 1.0]},
    "zero quaternions": {"quats": [0.0, 0.0, 0.0, 0.0]},
    "coplanar": {"means_z": 2.0},
}


def shaped(changes: dict) -> Gaussians:
    gaussians, changes = cloud(COUNT, bands=4), dict(changes)
    depth = changes.pop("means_z", None)
    if depth is not None:
        flat = gaussians.means / gaussians.means[:, 2:] * depth
        gaussians = replace(gaussians, means=flat)
    values = {
        name: torch.tensor(value).expand(getattr(gaussians, name).shape)
        for name, value in changes.items()
    }
    return replace(gaussians, **values)


@pytest.mark.parametrize("changes", SHAPES.values(), ids=SHAPES)
def test_of_unusual_shapes_against_the_reference(changes: dict) -> None:
    gaussians, names = shaped(changes), ("rgb", "alpha", "depth")
    own = {"light_cutoff": 1e-30, "alpha_cutoff": 1e-6}
    table = dense(gaussians.to(torch.float64), CAMERA.to(torch.float64), RenderSettings(**own))
    grads = {}
    for dtype, backend in ((torch.float32, "raster"), (torch.float64, "reference")):
        subject, camera = leaves(gaussians.to(dtype)), lens_leaves(CAMERA, dtype)
        made = render(
            subject, camera, outputs=names, settings=RenderSettings(**own), backend=backend
        )
        loss(made, names, ~table.unsure).backward()
        leaf = {f.name: getattr(subject, f.name).grad for f in fields(subject)}
        grads[backend] = leaf | {name: getattr(camera, name).grad for name in LENS}
    for name, want in grads["reference"].items():
        assert_gradients_agree(grads["raster"][name], want, name, TOLERANCE)


@pytest.mark.parametrize("name", [*PARAMETERS, *LENS, "features", "background"])
def test_of_one_input_alone(name: str) -> None:
    names, results = ("rgb", "features"), []
    for alone in (False, True):
        own = inputs(cloud(40, bands=4), CAMERA, torch.float32)
        if alone:
            for other, leaf in own.named().items():
                leaf.requires_grad_(other == name)
        made = render(
            own.gaussians, own.camera, outputs=names, settings=settings_of(own), backend="raster"
        )
        loss(made, names, torch.ones(CAMERA.size_px, dtype=torch.bool)).backward()
        results.append(own.named())
    assert torch.equal(results[0][name].grad, results[1][name].grad)
    assert all(leaf.grad is None for other, leaf in results[1].items() if other != name)


def test_of_what_no_pixel_sees() -> None:
    gaussians = cloud(40)
    hidden = gaussians.means.clone()
    hidden[::2, 2] = -1.0
    own = leaves(replace(gaussians, means=hidden))
    render(own, CAMERA, backend="raster").rgb.sum().backward()
    for name in PARAMETERS:
        grad = getattr(own, name).grad
        assert not grad[::2].any()
        assert bool(grad[1::2].any())


def test_with_any_layout_of_the_incoming_gradient() -> None:
    grads = []
    for layout in ("sum", "ones", "transposed"):
        own = leaves(cloud(40))
        rgb = render(own, CAMERA, backend="raster").rgb
        if layout == "sum":
            rgb.sum().backward()
        elif layout == "ones":
            rgb.backward(torch.ones(rgb.shape))
        else:
            rgb.backward(torch.ones(rgb.shape[::-1]).permute(2, 1, 0))
        grads.append(own.means.grad)
    assert torch.equal(grads[0], grads[1])
    assert torch.equal(grads[0], grads[2])


def test_the_way_back_can_be_taken_twice() -> None:
    own = leaves(cloud(40))
    total = render(own, CAMERA, backend="raster").rgb.square().sum()
    total.backward(retain_graph=True)
    first = own.means.grad.clone()
    own.means.grad = None
    total.backward()
    assert torch.equal(own.means.grad, first)
    with pytest.raises(RuntimeError, match="backward through the graph a second time"):
        total.backward()
