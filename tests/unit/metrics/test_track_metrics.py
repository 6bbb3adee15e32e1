import math

import numpy as np
import pytest
import torch

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.metrics.tracks import share_moving, sign_agreement, track_endpoint_error

F64 = torch.float64


@pytest.mark.parametrize("dimensions", [2, 3])
def test_endpoint_error_against_numpy(dimensions: int) -> None:
    predicted, truth = torch.randn(2, 2, 7, dimensions, dtype=F64)
    valid = torch.rand(2, 7) < 0.6
    predicted[~valid] = math.nan
    apart = np.sqrt(((predicted - truth).numpy() ** 2).sum(-1))
    expected = [apart[b][valid[b].numpy()].mean() for b in range(2)]
    np.testing.assert_allclose(track_endpoint_error(predicted, truth, valid), expected, rtol=1e-12)


def test_share_moving_counts_by_length() -> None:
    displacement = torch.tensor([[3.0, 4.0], [0.0, 0.0], [0.3, 0.4], [math.nan, 0.0]])
    valid = torch.tensor([True, True, True, False])
    assert float(share_moving(displacement, valid, 0.4)) == pytest.approx(2 / 3)
    assert float(share_moving(displacement, valid, 0.0)) == pytest.approx(2 / 3)
    assert float(share_moving(displacement, valid, 5.0)) == 0


def test_sign_agreement_asks_only_where_something_moves() -> None:
    truth = torch.tensor([[2.0, 0.0], [-2.0, 5.0], [1.0, 0.0], [0.01, 9.0], [3.0, 0.0]])
    predicted = torch.tensor([[0.1, 9.0], [-7.0, 0.0], [-1.0, 0.0], [-5.0, 0.0], [0.0, 0.0]])
    valid = torch.ones(5, dtype=torch.bool)
    right = torch.tensor([10.0, 0.0])
    assert float(sign_agreement(predicted, truth, valid, right, 0.1)) == 0.5
    assert float(sign_agreement(predicted, truth, valid, -right, 0.1)) == 0.5
    assert float(sign_agreement(predicted, truth, valid, right)) == pytest.approx(0.4)
    assert float(sign_agreement(truth, truth, valid, right)) == 1


@pytest.mark.parametrize("points", [0, 3])
def test_nothing_to_measure_is_nan(points: int) -> None:
    some, none = torch.ones(2, points, 3), torch.zeros(2, points, dtype=torch.bool)
    assert track_endpoint_error(some, some, none).isnan().all()
    assert share_moving(some, none, 0.0).isnan().all()
    assert sign_agreement(some, some, none, torch.ones(3)).isnan().all()


def test_nobody_moves_so_no_direction_can_agree() -> None:
    still, valid = torch.zeros(4, 3), torch.ones(4, dtype=torch.bool)
    assert sign_agreement(still, still, valid, torch.ones(3)).isnan()
    assert float(share_moving(still, valid, 0.0)) == 0


def test_the_error_is_differentiable_where_points_agree() -> None:
    predicted, valid = torch.zeros(2, 3, 3, requires_grad=True), torch.ones(2, 3, dtype=torch.bool)
    track_endpoint_error(predicted, torch.zeros(2, 3, 3), valid).sum().backward()
    assert not predicted.grad.any()


@pytest.mark.usefixtures("as_shipped")
def test_settings_and_shapes() -> None:
    points, valid = torch.zeros(2, 3), torch.ones(2, dtype=torch.bool)
    with pytest.raises(ConfigError, match=r"threshold: expected 0 or more, got -1\.0"):
        share_moving(points, valid, -1.0)
    with pytest.raises(ConfigError, match=r"direction: expected a length above 0, got 0\.0"):
        sign_agreement(points, points, valid, torch.zeros(3))
    with pytest.raises(ShapeError, match=r"direction: expected \(3,\), got \(2,\)"):
        sign_agreement(points, points, valid, torch.ones(2))
    with pytest.raises(ShapeError, match=r"predicted: expected \(2, 3\), got \(2, 2\)"):
        track_endpoint_error(points[:, :2], points, valid)
    with pytest.raises(ShapeError, match=r"valid: expected \(2,\) bool, got \(1,\) bool"):
        share_moving(points, valid[:1], 0.0)
