"""Tokens of a render condition: zero when fresh, equal to loops, neutral where all is valid."""

import pytest
import torch
from oracles_models import packed_frames, patches, randomised
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.models.video_dit.conditions import RenderCondition
from diff4splat.models.video_dit.render_condition import RenderConditionEmbedding

CHANNELS, WIDTH = 3, 5
SIDE_PX = 4
"""Pixels per latent pixel side."""


def embedding(fresh: bool = False) -> RenderConditionEmbedding:
    torch.manual_seed(0)
    network = RenderConditionEmbedding(CHANNELS, WIDTH)
    return network.double() if fresh else randomised(network).double()


def condition(frames: int = 9, rows: int = 4, columns: int = 2) -> RenderCondition:
    torch.manual_seed(1)
    packs, size = 1 + frames // 4, (rows * SIDE_PX, columns * SIDE_PX)
    return RenderCondition(
        latent=torch.randn(2, CHANNELS, packs, rows, columns, dtype=torch.float64),
        validity=torch.rand(2, 1, frames, *size, dtype=torch.float64),
    )


def cell_means(maps: Tensor) -> Tensor:
    """Mean over the pixels of each latent pixel, one at a time."""
    batch, channels, frames, height, width = maps.shape
    result = maps.new_zeros(batch, channels, frames, height // SIDE_PX, width // SIDE_PX)
    for i in range(height // SIDE_PX):
        for j in range(width // SIDE_PX):
            rows = slice(i * SIDE_PX, (i + 1) * SIDE_PX)
            columns = slice(j * SIDE_PX, (j + 1) * SIDE_PX)
            result[..., i, j] = maps[..., rows, columns].mean((-2, -1))
    return result


@pytest.mark.parametrize("frames", [1, 5, 9])
def test_shapes(frames: int) -> None:
    assert embedding()(condition(frames)).shape == (2, 1 + frames // 4, 2, 1, WIDTH)


def test_a_fresh_embedding_is_exactly_zero() -> None:
    assert not embedding(fresh=True)(condition()).any()


def test_it_is_two_linear_maps_of_patches() -> None:
    network, given = embedding(), condition()
    hidden = packed_frames(1 - cell_means(given.validity))
    # A token lists the four frames of each latent pixel together, as it lists channels.
    rows = hidden.unflatten(1, (1, 4)).transpose(2, 3).flatten(2, 3)
    want = patches(given.latent, (1, 2, 2)) @ network.latent.weight.T + network.latent.bias
    want = want + patches(rows, (4, 2, 2)) @ network.validity.weight.T
    torch.testing.assert_close(network(given), want)


def test_where_every_pixel_is_valid_the_mask_changes_nothing() -> None:
    network, given = embedding(), condition()
    valid = RenderCondition(latent=given.latent, validity=torch.ones_like(given.validity))
    before = network(valid)
    assert not torch.equal(network(given), before)
    torch.nn.init.zeros_(network.validity.weight)
    assert torch.equal(network(valid), before)


def test_validity_of_one_frame_changes_its_latent_frame_alone() -> None:
    network, given = embedding(), condition()
    for frame in range(9):
        validity = given.validity.clone()
        validity[:, :, frame] = 1 - validity[:, :, frame]
        changed = network(RenderCondition(latent=given.latent, validity=validity)) - network(given)
        moved = changed.abs().amax((0, 2, 3, 4)) > 0
        assert moved.nonzero().flatten().tolist() == [-(-frame // 4)]


def test_gradcheck() -> None:
    network, given = embedding(), condition(frames=5)

    def tokens(latent: Tensor, validity: Tensor) -> Tensor:
        return network(RenderCondition(latent=latent, validity=validity))

    inputs = (given.latent.requires_grad_(), given.validity.requires_grad_())
    assert torch.autograd.gradcheck(tokens, inputs)


@pytest.mark.parametrize("scale", [0.0, 1e6])
def test_extremes_stay_finite(scale: float) -> None:
    given = condition()
    latent = (given.latent * scale).requires_grad_()
    tokens = embedding()(RenderCondition(latent=latent, validity=given.validity.round()))
    tokens.sum().backward()
    assert bool(tokens.isfinite().all()) and bool(latent.grad.isfinite().all())


def test_a_wrong_number_of_frames_is_refused() -> None:
    given = condition()
    with pytest.raises(ShapeError, match=r"expected 1 \+ 4 k, got 8"):
        embedding()(RenderCondition(latent=given.latent, validity=given.validity[:, :, :8]))
