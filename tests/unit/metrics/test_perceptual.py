import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.metrics.features.load import load_features
from diff4splat.metrics.perceptual import perceptual_distance


def test_layout_and_batch() -> None:
    features = load_features(None)
    image, reference = torch.rand(2, 2, 3, 8, 9, 3)
    distance = perceptual_distance(image, reference, features)
    assert distance.shape == (2, 3)
    one = features.distance(
        image[1, 2].permute(2, 0, 1)[None], reference[1, 2].permute(2, 0, 1)[None]
    )
    torch.testing.assert_close(distance[1, 2], one[0])


def test_one_image_and_none() -> None:
    features = load_features(None)
    assert perceptual_distance(*torch.rand(2, 8, 8, 3), features).shape == ()
    assert perceptual_distance(*torch.rand(2, 0, 8, 8, 3), features).shape == (0,)


@pytest.mark.usefixtures("as_shipped")
def test_shapes() -> None:
    features = load_features(None)
    with pytest.raises(ShapeError, match=r"image: expected \(8, 8, 3\), got \(8, 9, 3\)"):
        perceptual_distance(torch.zeros(8, 9, 3), torch.zeros(8, 8, 3), features)
    with pytest.raises(ShapeError, match=r"expected h w 3 with a pixel, got \(0, 8, 3\)"):
        perceptual_distance(*torch.zeros(2, 0, 8, 3), features)
