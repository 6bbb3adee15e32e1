"""Blending of given footprints, and its gradients, against a dense table of pixels in float64."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch
from oracles_raster import (
    as_arrays,
    assert_gradients_agree,
    blend,
    cloud,
    responses,
    shape_gradient,
    weights,
    wide_camera,
)
from torch import Tensor

from diff4splat.render.raster import forward
from diff4splat.render.raster.blending.blend_backward import blend_backward, sum_slots
from diff4splat.render.raster.padded_image import PaddedImage
from diff4splat.render.raster.raster_settings import make_raster_settings, make_view
from diff4splat.render.raster.tables import MOMENTS, Cloud
from diff4splat.render.settings import RenderSettings

CAMERA = wide_camera((45, 51))
COUNT = 70
SHAPE_COLUMNS = 6


@dataclass
class Drawn:
    plan: object
    footprints: forward.Footprints
    filled: forward.Filled
    values: np.ndarray
    image: PaddedImage


def draw(own: RenderSettings, channels: int, spread_px: float = 5.0, opacity: float = 0.0) -> Drawn:
    """Random values on random footprints, all in one region."""
    plan = make_raster_settings(CAMERA, own, colors=False, medians=True)
    gaussians = cloud(COUNT, spread_px=spread_px)
    if opacity:
        gaussians = replace(gaussians, opacities=torch.full((COUNT,), opacity))
    arrays = as_arrays(gaussians)
    view = make_view(plan.grid, CAMERA.world_from_camera, CAMERA.focal_px, CAMERA.center_px)
    found = forward.footprints(Cloud(*arrays[:4]), arrays[4], view, plan)
    values = np.random.default_rng(0).standard_normal((COUNT, channels)).astype(np.float32)
    binned = forward.bin_footprints(found, plan)
    assert len(binned.regions) == 1
    filled = forward.fill_region(found, plan.grid, binned, binned.regions[0])
    image = PaddedImage(plan.grid, channels, medians=True)
    forward.blend_region(plan, filled, found, values, image)
    return Drawn(plan, found, filled, values, image)


def exact(drawn: Drawn, own: RenderSettings) -> tuple[Tensor, ...]:
    """(shape, values, planes, light behind each, unsure), differentiable in the first two."""
    order = drawn.footprints.order
    shape = torch.from_numpy(drawn.footprints.prints[order][:, :SHAPE_COLUMNS]).requires_grad_()
    values = torch.from_numpy(drawn.values[order]).double().requires_grad_()
    weight, light, unsure = weights(responses(shape, CAMERA.size_px), own)
    return shape, values, blend(weight, values), light, unsure


CASES = {
    "plain": ({}, 5.0, 0.0),
    "small tiles": ({"tile_px": 8}, 5.0, 0.0),
    "large tiles": ({"tile_px": 64}, 5.0, 0.0),
    "stops early": ({"light_cutoff": 0.3}, 8.0, 0.0),
    "stops late": ({"light_cutoff": 1e-30}, 20.0, 0.9),
    "clipped": ({"alpha_max": 0.4}, 8.0, 0.95),
    "beyond opaque": ({}, 5.0, 4.0),
    "far support": ({"alpha_cutoff": 1e-6}, 3.0, 0.0),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
@pytest.mark.parametrize("channels", [3, 4, 7])
def test_images_and_gradients(case: tuple, channels: int) -> None:
    changes, spread_px, opacity = case
    own = RenderSettings(**changes)
    drawn = draw(own, channels, spread_px, opacity)
    shape, values, want, light, unsure = exact(drawn, own)
    assert float(unsure.double().mean()) < 0.05
    image = drawn.image
    planes = image.cropped(image.planes).permute(1, 2, 0).double()
    left = image.cropped(image.light)[0].double()
    sure = ~unsure
    scale = float(want.detach().abs().max())
    torch.testing.assert_close(planes[sure], want[sure], rtol=0, atol=2e-6 * scale)
    torch.testing.assert_close(left[sure], light[-1][sure], rtol=2e-3, atol=1e-30)
    incoming = torch.randn(*CAMERA.size_px, channels + 1) * sure[..., None]
    loss = (incoming[..., :-1] * want).sum() + (incoming[..., -1] * light[-1]).sum()
    to_shape, to_values = torch.autograd.grad(loss, (shape, values))
    moments, got_values = backward(drawn, incoming)
    order = drawn.footprints.order
    got_shape = shape_gradient(shape.detach(), moments[order].double())
    for column in range(SHAPE_COLUMNS):
        assert_gradients_agree(got_shape[:, column], to_shape[:, column], f"column {column}", 3e-5)
    assert_gradients_agree(got_values[order], to_values, "values", 3e-5)


def backward(drawn: Drawn, incoming: Tensor) -> tuple[Tensor, Tensor]:
    """Moments of ∂/∂ln α and gradients of values."""
    grid, lists = drawn.plan.grid, drawn.filled.lists
    height, width = CAMERA.size_px
    whole = torch.zeros(incoming.shape[-1], *drawn.image.shape)
    whole[:, :height, :width] = incoming.permute(2, 0, 1)
    padded = whole.flatten().numpy()
    slots = np.full((len(lists.members), MOMENTS + drawn.values.shape[1]), np.nan, np.float32)
    tiles = np.arange(grid.rows * grid.columns)
    blend_backward(
        tiles, grid, lists, drawn.footprints.prints, drawn.values, drawn.plan.rules,
        drawn.image.light, drawn.image.stops, padded.reshape(-1), slots,
    )  # fmt: skip
    # Every slot is written, those of Gaussians that nobody looked at with zeros.
    assert np.isfinite(slots).all()
    moments = np.zeros((COUNT, MOMENTS), np.float32)
    values = np.zeros(drawn.values.shape, np.float32)
    order = drawn.footprints.order
    sum_slots(0, len(order), order, drawn.filled.first_slots, slots, moments, values)
    unseen = np.setdiff1d(np.arange(COUNT), order)
    assert not moments[unseen].any() and not values[unseen].any()
    return torch.from_numpy(moments), torch.from_numpy(values)


@pytest.mark.parametrize("cutoff", [1e-3, 0.3, 0.9])
def test_pixels_stop_where_the_light_runs_out(cutoff: float) -> None:
    own = RenderSettings(light_cutoff=cutoff, tile_px=64)
    drawn = draw(own, 3, spread_px=12.0, opacity=0.7)
    _, _, _, light, unsure = exact(drawn, own)
    dark = (light < cutoff).numpy()
    # The list of the only tile holds the Gaussians that reach it, nearest first.
    rank = {index: position for position, index in enumerate(drawn.footprints.order.tolist())}
    ranks = np.array([rank[index] for index in drawn.filled.lists.members.tolist()])
    positions = np.searchsorted(ranks, dark.argmax(0)) + 1
    stops = drawn.image.cropped(drawn.image.stops)[0].numpy()
    sure = ~unsure.numpy()
    assert dark.any()
    np.testing.assert_array_equal((stops < 1e38)[sure], dark.any(0)[sure])
    stopped = sure & dark.any(0)
    np.testing.assert_array_equal(stops[stopped], positions[stopped])


def test_medians_are_indices_of_gaussians() -> None:
    own = RenderSettings(light_cutoff=0.4)
    drawn = draw(own, 3, spread_px=8.0)
    _, _, _, light, unsure = exact(drawn, own)
    near_half = ((light.detach() - 0.5).abs() < 1e-4).any(0)
    half = (light <= 0.5).numpy()
    want = np.where(half.any(0), drawn.footprints.order[half.argmax(0)], -1)
    got = drawn.image.cropped(drawn.image.medians)[0].numpy()
    sure = ~(unsure | near_half).numpy()
    np.testing.assert_array_equal(got[sure], want[sure])
    assert bool((got == -1).any() and (got >= 0).any())


def test_the_padding_stays_dark() -> None:
    image = draw(RenderSettings(tile_px=64), 3).image
    light = image.light.reshape(image.shape)
    assert not light[45:].any() and not light[:, 51:].any()
    planes = image.planes.reshape(-1, *image.shape)
    assert not planes[:, 45:].any() and not planes[:, :, 51:].any()
