import pytest
import torch
from oracles_models import packed_frames, randomised

from diff4splat.errors import ShapeError
from diff4splat.models.video_dit.camera_adapter import CameraAdapter


def adapter() -> CameraAdapter:
    return CameraAdapter(width=12, hidden_width=5, space_stride=8)


@pytest.mark.parametrize("frames", [1, 5, 49])
def test_shapes(frames: int) -> None:
    assert adapter()(torch.randn(2, 6, frames, 16, 48)).shape == (2, 1 + frames // 4, 1, 3, 12)


def test_fresh_adapter_is_exactly_zero() -> None:
    assert not adapter()(torch.randn(1, 6, 5, 16, 16)).any()


def test_every_ray_matters_after_training() -> None:
    trained = randomised(adapter())
    camera = torch.randn(1, 6, 5, 16, 16, requires_grad=True)
    trained(camera).square().sum().backward()
    assert (camera.grad.abs() > 0).all()


def test_matches_a_loop_over_tokens() -> None:
    trained = randomised(adapter()).double()
    camera = torch.randn(1, 6, 5, 16, 32, dtype=torch.float64)
    packs = packed_frames(camera)
    hidden = torch.zeros(2, 5, 1, 2, dtype=torch.float64)
    for t in range(2):
        for j in range(2):
            for out in range(5):
                weight = trained.conv_in.weight[
                    out
                ]  # (24 * 64, 2, 2): cell (a, b), sub-pixel (i, k)
                tile = (
                    packs[0, :, t, :, 16 * j : 16 * (j + 1)]
                    .unflatten(1, (2, 8))
                    .unflatten(3, (2, 8))
                )
                kernel = weight.reshape(24, 8, 8, 2, 2).permute(0, 3, 1, 4, 2)
                hidden[t, out, 0, j] = (tile * kernel).sum() + trained.conv_in.bias[out]
    residual = trained.conv_2(torch.relu(trained.conv_1(hidden)))
    want = trained.to_tokens((hidden + residual).movedim(1, -1))
    torch.testing.assert_close(trained(camera)[0], want)


def test_a_token_sees_its_own_frames_only() -> None:
    trained = randomised(adapter()).requires_grad_(False)
    camera = torch.randn(1, 6, 9, 16, 16)
    other = camera.clone()
    other[:, :, 5] += 1
    moved = (trained(camera) - trained(other)).abs().amax((0, 2, 3, 4)) > 0
    assert moved.tolist() == [False, False, True]


def test_wrong_frame_count_is_refused() -> None:
    with pytest.raises(ShapeError, match=r"expected 1 \+ 4 k, got 4"):
        adapter()(torch.zeros(1, 6, 4, 16, 16))
