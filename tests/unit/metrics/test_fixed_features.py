"""The fixed features: equal for equal videos, and farther for what looks more different."""

import pytest
import torch

from diff4splat.metrics.distribution import frechet_distance, kernel_distance
from diff4splat.metrics.features.fixed_features import FixedFeatures
from diff4splat.metrics.features.protocol import ImageFeatures, VideoFeatures

FEATURES = FixedFeatures()


def moving_squares(count: int, step_px: int, seed: int, frames: int = 5) -> torch.Tensor:
    """Textured videos whose square moves by ``step_px`` per frame."""
    generator = torch.Generator().manual_seed(seed)
    videos = torch.rand(count, 1, 3, 8, 8, generator=generator)
    videos = torch.nn.functional.interpolate(videos[:, 0], (32, 32), mode="bilinear")
    videos = videos[:, None].repeat(1, frames, 1, 1, 1)
    for frame in range(frames):
        left = 4 + frame * step_px
        videos[:, frame, :, 10:20, left : left + 8] = torch.tensor([0.9, 0.1, 0.1])[:, None, None]
    return videos


def test_it_is_features_of_both_kinds_and_says_what_it_is_not() -> None:
    assert isinstance(FEATURES, VideoFeatures)
    assert isinstance(FEATURES, ImageFeatures)
    assert "not I3D" in FEATURES.name


def test_shapes_and_repeats() -> None:
    videos = moving_squares(3, 1, 0)
    found = FEATURES.embed_videos(videos)
    assert found.shape == (3, 294)
    assert torch.equal(found, FEATURES.embed_videos(videos))
    assert FEATURES.embed_images(videos[:, 0]).shape == (3, 198)
    one_by_one = torch.cat([FEATURES.embed_videos(video[None]) for video in videos])
    assert torch.allclose(found, one_by_one, atol=1e-5)


def test_long_videos_go_in_batches() -> None:
    video = moving_squares(1, 0, 1, frames=40)
    assert torch.allclose(
        FEATURES.embed_videos(video), FEATURES.embed_videos(video[:, :17]), atol=1e-4
    )


def test_motion_shows() -> None:
    still = FEATURES.embed_videos(moving_squares(6, 0, 2))
    slow = FEATURES.embed_videos(moving_squares(6, 2, 2))
    assert not bool(still[:, 198:].any())
    assert bool((slow[:, 198:].sum(1) > 0).all())


def test_blur_is_farther_than_another_draw() -> None:
    truth, other = moving_squares(12, 2, 3), moving_squares(12, 2, 4)
    blurred = torch.nn.functional.avg_pool2d(truth.flatten(0, 1), 5, stride=1, padding=2)
    features = [FEATURES.embed_videos(v) for v in (truth, other, blurred.view_as(truth))]
    # The Fréchet distance of twelve samples is too large for equal distributions, too.
    for distance, factor in ((frechet_distance, 1.5), (kernel_distance, 3.0)):
        near, far = (distance(features[0], side) for side in features[1:])
        assert far > factor * abs(near)


@pytest.mark.parametrize("size", [(1, 1, 1), (1, 3, 5), (2, 64, 48)])
def test_any_size_is_finite(size: tuple[int, int, int]) -> None:
    frames, height, width = size
    for value in (0.0, 1.0):
        videos = torch.full((1, frames, 3, height, width), value)
        assert bool(FEATURES.embed_videos(videos).isfinite().all())
