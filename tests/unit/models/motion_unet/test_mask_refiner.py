"""The mask refiner: zero when fresh, then features of cells with edges of pixels."""

import torch
from oracles_models import randomised
from torch import Tensor

from diff4splat.models.config.networks import TextConfig
from diff4splat.models.motion_unet.mask_refiner import MaskRefiner
from diff4splat.models.motion_unet.unet import MotionUNet

TEXT = TextConfig(width=8, blocks=1, heads=2, feedforward_width=16)
CHANNELS = 8


def refiner(trained: bool = True) -> MaskRefiner:
    torch.manual_seed(0)
    network = MaskRefiner(4, CHANNELS)
    return randomised(network).double() if trained else network.double()


def inputs() -> tuple[Tensor, Tensor]:
    torch.manual_seed(1)
    return torch.rand(2, 3, 32, 16).double(), torch.randn(2, CHANNELS, 8, 4).double()


def test_a_fresh_one_adds_nothing() -> None:
    torch.manual_seed(0)
    plain = MotionUNet(8, 2, TEXT, frequency_width=16)
    refined = MotionUNet(8, 2, TEXT, frequency_width=16, mask_refiner_width=4)
    refined.load_state_dict(plain.state_dict(), strict=False)
    for network in (plain, refined):
        torch.nn.init.constant_(network.mask_head.weight, 0.1)
    given = torch.rand(1, 3, 32, 16), torch.randn(1, 3, 2, 8, 4), torch.rand(1)
    for before, after in zip(
        plain.predict_motion_and_mask(*given), refined.predict_motion_and_mask(*given), strict=True
    ):
        assert torch.equal(before, after)
    assert not refiner(trained=False)(*inputs()).any()


def test_it_is_added_to_the_mask_of_cells() -> None:
    torch.manual_seed(0)
    network = randomised(MotionUNet(8, 2, TEXT, frequency_width=16, mask_refiner_width=4))
    given = torch.rand(2, 3, 32, 16), torch.randn(2, 3, 2, 8, 4), torch.rand(2)
    features = network.features(*given, None, None).unflatten(0, (2, 2)).mean(1)
    added = network.mask_refiner(given[0], features)
    both = network.predict_motion_and_mask(*given)[1]
    network.mask_refiner = None
    torch.testing.assert_close(both, network.predict_motion_and_mask(*given)[1] + added)


def test_every_pixel_and_every_feature_matters() -> None:
    network, (image, features) = refiner(), inputs()
    plain = network(image, features)
    assert plain.shape == (2, 32, 16)
    for row, column in ((0, 0), (17, 9), (31, 15)):
        other = image.clone()
        other[:, :, row, column] = 1 - other[:, :, row, column]
        assert bool((network(other, features) != plain)[:, row, column].all())
    for channel in range(CHANNELS):
        other = features.clone()
        other[:, channel] += 1
        assert bool((network(image, other) != plain).any())


def test_the_pixels_of_one_cell_may_differ() -> None:
    image, features = inputs()
    logits = refiner()(image, features)[:, :4, :4].flatten(1)
    assert len(logits[0].detach().unique()) == 16


def test_position_matters() -> None:
    image, features = torch.full((1, 3, 64, 64), 0.5).double(), torch.zeros(1, CHANNELS, 16, 16)
    logits = refiner()(image, features.double())[0, 24:40, 24:40]
    assert len(logits.detach().unique()) == logits.numel()


def test_every_weight_has_a_gradient() -> None:
    network = refiner()
    network(*inputs()).square().sum().backward()
    assert all(bool(weight.grad.any()) for weight in network.parameters())


def test_pixels_reach_the_output_without_the_cells() -> None:
    network, (image, features) = refiner(), inputs()
    with torch.no_grad():
        network.up.weight.zero_()
    assert bool((network(1 - image, features) != network(image, features)).all())
    assert torch.equal(network(image, features + 1), network(image, features))
