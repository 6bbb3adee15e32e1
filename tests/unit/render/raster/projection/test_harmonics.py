"""Colours and their gradients against the float64 harmonics of the scene, by autograd."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_raster import assert_gradients_agree
from torch import Tensor

from diff4splat.render.raster.projection.harmonics import colors, colors_backward
from diff4splat.scene import harmonics

BANDS = (1, 4, 9, 16)
POSITION = (0.3, -0.2, 0.1)


def scene(count: int, bands: int, seed: int) -> tuple[Tensor, Tensor]:
    """Means all around the camera, near and far, and coefficients that clamp some colours."""
    generator = torch.Generator().manual_seed(seed)
    direction = torch.randn(count, 3, generator=generator)
    distance = 10 ** (3 * torch.rand(count, 1, generator=generator) - 1)
    sh = torch.randn(count, bands, 3, generator=generator)
    return direction * distance, sh


def exact(means: Tensor, sh: Tensor, position: Tensor) -> Tensor:
    return harmonics.color(sh, torch.nn.functional.normalize(means - position, dim=-1))


def exact_gradients(means: Tensor, sh: Tensor, incoming: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Of coefficients, means and the position; zeros where plain colours have no direction."""
    wide, numbers = means.double().requires_grad_(), sh.double().requires_grad_()
    position = torch.tensor(POSITION, dtype=torch.float64, requires_grad=True)
    loss = (exact(wide, numbers, position) * incoming[:, :3]).sum()
    return torch.autograd.grad(loss, (numbers, wide, position), materialize_grads=True)


def colors_of(means: Tensor, sh: Tensor, order: np.ndarray, channels: int = 3) -> np.ndarray:
    values = np.full((len(means), channels), 7.0, np.float32)
    colors(0, len(order), order, means.numpy(), sh.numpy(), POSITION, values)
    return values


@pytest.mark.parametrize("bands", BANDS)
def test_colors(bands: int) -> None:
    means, sh = scene(200, bands, seed=bands)
    order = np.random.default_rng(0).permutation(200).astype(np.int32)
    want = exact(means.double(), sh.double(), torch.tensor(POSITION, dtype=torch.float64))
    got = colors_of(means, sh, order)
    np.testing.assert_allclose(got, want.numpy(), rtol=1e-6, atol=1e-6)
    assert bool((got == 0).any())


def test_only_listed_rows_and_the_first_columns_are_written() -> None:
    means, sh = scene(6, 4, seed=0)
    values = colors_of(means, sh, np.array([4, 1], np.int32), channels=5)
    assert bool((values[[1, 4], :3] != 7).all())
    assert bool((values[[0, 2, 3, 5]] == 7).all() and (values[:, 3:] == 7).all())


def backward(means: Tensor, sh: Tensor, incoming: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Gradients of coefficients, means and the position, the last two added to ones."""
    order = np.arange(len(means), dtype=np.int32)[::-1].copy()
    sh_grads, mean_grads = np.zeros(sh.shape, np.float32), np.ones(means.shape, np.float32)
    camera = np.ones(3)
    colors_backward(
        0, len(order), order, means.numpy(), sh.numpy(), POSITION, incoming.numpy(), sh_grads,
        mean_grads, camera,
    )  # fmt: skip
    return tuple(map(torch.from_numpy, (sh_grads, mean_grads, camera)))


@pytest.mark.parametrize("bands", BANDS)
def test_gradients(bands: int) -> None:
    means, sh = scene(200, bands, seed=bands)
    incoming = torch.randn(200, 5)
    to_sh, to_mean, to_position = exact_gradients(means, sh, incoming)
    got_sh, got_mean, got_position = backward(means, sh, incoming)
    assert_gradients_agree(got_sh, to_sh, "sh", 1e-6)
    # Exact to the rounding of the ones that were there before.
    torch.testing.assert_close(got_mean.double() - 1, to_mean, rtol=1e-6, atol=1e-6)
    torch.testing.assert_close(got_position - 1, to_position, rtol=1e-6, atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(BANDS))
def test_gradients_of_single_gaussians(seed: int, bands: int) -> None:
    means, sh = scene(1, bands, seed)
    incoming = torch.tensor([[1.0, -2.0, 0.5]])
    to_sh, to_mean, _ = exact_gradients(means, sh, incoming)
    got_sh, got_mean, _ = backward(means, sh, incoming)
    torch.testing.assert_close(got_sh.double(), to_sh, rtol=1e-6, atol=1e-6)
    torch.testing.assert_close(got_mean.double() - 1, to_mean, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("bands", BANDS)
def test_a_mean_in_the_camera_is_finite(bands: int) -> None:
    means, sh = torch.tensor([POSITION]), torch.ones(1, bands, 3)
    position = torch.tensor(POSITION, dtype=torch.float32).tolist()
    values, order = np.zeros((1, 3), np.float32), np.zeros(1, np.int32)
    colors(0, 1, order, means.numpy(), sh.numpy(), tuple(position), values)
    assert np.isfinite(values).all()
    grads, to_mean, camera = np.zeros((1, bands, 3), np.float32), np.zeros((1, 3)), np.zeros(3)
    colors_backward(
        0, 1, order, means.numpy(), sh.numpy(), tuple(position), np.ones((1, 3), np.float32),
        grads, to_mean.astype(np.float32), camera,
    )  # fmt: skip
    assert np.isfinite(grads).all()
    assert not camera.any()


def test_a_colour_at_the_clamp_has_the_gradient_of_the_inside() -> None:
    means, sh = torch.ones(1, 3), torch.full((1, 1, 3), -0.5 / harmonics.DEGREE_ZERO)
    sh[0, 0, 1], sh[0, 0, 2] = sh[0, 0, 0] * 1.001, 0.0
    got, _, _ = backward(means, sh, torch.ones(1, 3))
    exactly_zero = float(0.5 + np.float64(harmonics.DEGREE_ZERO) * sh[0, 0, 0].double()) >= 0
    expected = [harmonics.DEGREE_ZERO if exactly_zero else 0.0, 0.0, harmonics.DEGREE_ZERO]
    np.testing.assert_allclose(got[0, 0], expected, rtol=1e-6)
