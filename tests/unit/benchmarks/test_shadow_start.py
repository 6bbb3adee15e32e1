"""An object shadow that starts from a depth prior."""

import torch

from benchmarks.object_shadow.start import start_from_depth
from diff4splat.models.monocular_depth.network import MonocularDepthNet
from diff4splat.models.object_shadow.network import ObjectShadowNet, object_coordinates


def test_it_has_the_features_of_the_depth_prior_whatever_the_mask() -> None:
    torch.manual_seed(0)
    depth, shadow = MonocularDepthNet(4), ObjectShadowNet(4)
    start_from_depth(shadow, depth)
    image, masks = torch.rand(2, 3, 32, 48), torch.rand(2, 32, 48)
    inputs = torch.cat([image, masks[:, None], object_coordinates(masks)], 1)
    torch.testing.assert_close(shadow.features(inputs), depth.features(image))
    assert not shadow(image, masks).any()
