import pytest
import torch

from diff4splat.errors import InputError, ShapeError
from diff4splat.metrics.motion import endpoint_error


def test_a_shift_is_as_long_as_its_vector() -> None:
    reference = torch.rand(2, 3, 4, 2, dtype=torch.float64)
    error = endpoint_error(reference + reference.new_tensor([3.0, -4.0]), reference)
    torch.testing.assert_close(error, torch.full((2,), 5.0, dtype=torch.float64))


def test_only_valid_pixels_count() -> None:
    flow, valid = torch.zeros(1, 2, 2), torch.tensor([[True, False]])
    flow[0, 0, 0], flow[0, 1, 0] = 2.0, float("nan")
    assert float(endpoint_error(flow, torch.zeros(1, 2, 2), valid)) == 2.0


def test_equal_flows_have_a_finite_gradient() -> None:
    flow = torch.zeros(2, 2, 2, requires_grad=True)
    endpoint_error(flow, torch.zeros(2, 2, 2)).backward()
    assert torch.equal(flow.grad, torch.zeros(2, 2, 2))


def test_nothing_valid_is_an_error() -> None:
    with pytest.raises(InputError, match="expected a valid pixel in every image, got none"):
        endpoint_error(
            torch.zeros(1, 1, 2), torch.zeros(1, 1, 2), torch.zeros(1, 1, dtype=torch.bool)
        )


@pytest.mark.usefixtures("as_shipped")
def test_shapes_must_agree() -> None:
    with pytest.raises(ShapeError, match=r"flow: expected \(2, 1, 2\), got \(1, 1, 2\)"):
        endpoint_error(torch.zeros(1, 1, 2), torch.zeros(2, 1, 2))
    with pytest.raises(ShapeError, match=r"valid: expected \(1, 1\), got \(2, 1\)"):
        endpoint_error(
            torch.zeros(1, 1, 2), torch.zeros(1, 1, 2), torch.ones(2, 1, dtype=torch.bool)
        )
