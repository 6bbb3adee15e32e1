import math

import numpy as np
import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.metrics.tracks import track_endpoint_error

F64 = torch.float64


@pytest.mark.parametrize("dimensions", [2, 3])
def test_endpoint_error_against_numpy(dimensions: int) -> None:
    predicted, truth = torch.randn(2, 2, 7, dimensions, dtype=F64)
    valid = torch.rand(2, 7) < 0.6
    predicted[~valid] = math.nan
    apart = np.sqrt(((predicted - truth).numpy() ** 2).sum(-1))
    expected = [apart[b][valid[b].numpy()].mean() for b in range(2)]
    np.testing.assert_allclose(track_endpoint_error(predicted, truth, valid), expected, rtol=1e-12)


@pytest.mark.parametrize("points", [0, 3])
def test_nothing_to_measure_is_nan(points: int) -> None:
    some, none = torch.ones(2, points, 3), torch.zeros(2, points, dtype=torch.bool)
    assert track_endpoint_error(some, some, none).isnan().all()


def test_the_error_is_differentiable_where_points_agree() -> None:
    predicted, valid = torch.zeros(2, 3, 3, requires_grad=True), torch.ones(2, 3, dtype=torch.bool)
    track_endpoint_error(predicted, torch.zeros(2, 3, 3), valid).sum().backward()
    assert not predicted.grad.any()


@pytest.mark.usefixtures("as_shipped")
def test_settings_and_shapes() -> None:
    points, valid = torch.zeros(2, 3), torch.ones(2, dtype=torch.bool)
    with pytest.raises(ShapeError, match=r"predicted: expected \(2, 3\), got \(2, 2\)"):
        track_endpoint_error(points[:, :2], points, valid)
    with pytest.raises(ShapeError, match=r"valid: expected \(2,\) bool, got \(1,\) bool"):
        track_endpoint_error(points, points, valid[:1])
