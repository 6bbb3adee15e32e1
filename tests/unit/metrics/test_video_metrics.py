import math

import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.metrics.video import loop_closure_psnr


def test_a_loop_that_misses_by_a_tenth() -> None:
    video = torch.rand(2, 3, 4, 5, 3, dtype=torch.float64)
    video[:, -1] = video[:, 0]
    video[1, -1] += 0.1
    assert loop_closure_psnr(video).tolist() == [math.inf, pytest.approx(20)]


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("shape", [(1, 2, 2, 3), (2, 0, 2, 3), (2, 2, 3)])
def test_a_video_has_frames_and_pixels(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match="expected t h w c with two frames and a pixel"):
        loop_closure_psnr(torch.zeros(shape))
