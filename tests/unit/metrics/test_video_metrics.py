import math

import numpy as np
import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.metrics.video import change_error, loop_closure_psnr


def test_a_loop_that_misses_by_a_tenth() -> None:
    video = torch.rand(2, 3, 4, 5, 3, dtype=torch.float64)
    video[:, -1] = video[:, 0]
    video[1, -1] += 0.1
    assert loop_closure_psnr(video).tolist() == [math.inf, pytest.approx(20)]


def test_change_error_against_numpy() -> None:
    video, reference = torch.rand(2, 2, 4, 3, 3, 3, dtype=torch.float64)
    own, true = np.diff(video.numpy(), axis=1), np.diff(reference.numpy(), axis=1)
    expected = np.abs(own - true).reshape(2, -1).mean(1)
    np.testing.assert_allclose(change_error(video, reference), expected)


def test_brightness_is_no_change_and_flicker_is() -> None:
    reference = torch.rand(4, 3, 3, 3, dtype=torch.float64)
    assert float(change_error(reference + 0.2, reference)) == pytest.approx(0, abs=1e-12)
    flicker = 0.1 * torch.tensor([1.0, -1, 1, -1], dtype=torch.float64)[:, None, None, None]
    assert float(change_error(reference + flicker, reference)) == pytest.approx(0.2)


def test_half_precision_is_widened() -> None:
    video = torch.rand(3, 2, 2, 3).half()
    assert change_error(video, video).dtype == torch.float32


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("shape", [(1, 2, 2, 3), (2, 0, 2, 3), (2, 2, 3)])
def test_a_video_has_frames_and_pixels(shape: tuple[int, ...]) -> None:
    for measure in (loop_closure_psnr, lambda video: change_error(video, video)):
        with pytest.raises(ShapeError, match="expected t h w c with two frames and a pixel"):
            measure(torch.zeros(shape))
