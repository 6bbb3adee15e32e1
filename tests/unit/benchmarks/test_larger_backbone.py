"""The start of a network on a larger backbone."""

import pytest
import torch

from benchmarks.larger_backbone.__main__ import main
from benchmarks.larger_backbone.fitted_start import fit, start_from
from diff4splat.models.image_backbone.efficientnet_lite import EfficientNetLite
from diff4splat.models.image_backbone.unet import BackboneUNet
from diff4splat.models.monocular_depth.backbone_network import BackboneDepthNet
from diff4splat.models.object_mask.backbone_network import BackboneObjectMaskNet
from diff4splat.models.object_mask.mask_heads import HeadShape
from diff4splat.training import backbone_init

SHAPE = HeadShape(width=4, text_width=8)


def test_least_squares_find_a_convolution_again() -> None:
    torch.manual_seed(0)
    wanted, found = (torch.nn.Conv2d(5, 3, 1) for _ in range(2))
    features = torch.randn(4, 5, 6, 7) + 2
    with torch.no_grad():
        left = fit(found, features, wanted(features))
    torch.testing.assert_close(found.weight, wanted.weight, atol=3e-3, rtol=0)
    torch.testing.assert_close(found.bias, wanted.bias, atol=2e-2, rtol=0)
    assert left < 1e-4


def test_what_the_image_does_not_show_is_left() -> None:
    torch.manual_seed(0)
    conv, features = torch.nn.Conv2d(2, 1, 1), torch.randn(1, 2, 32, 32)
    with torch.no_grad():
        left = fit(conv, features, features.sum(1, keepdim=True) + torch.randn(1, 1, 32, 32))
    assert left == pytest.approx(1 / 3, abs=0.05)


@pytest.mark.parametrize(
    ("network", "other"),
    [
        (BackboneDepthNet(4), BackboneDepthNet(4, size="lite2")),
        (
            BackboneDepthNet(4, uncertainty=True),
            BackboneDepthNet(4, size="lite2", uncertainty=True),
        ),
        (BackboneObjectMaskNet(SHAPE), BackboneObjectMaskNet(SHAPE, "lite2")),
    ],
    ids=["depth", "depth and uncertainty", "object mask"],
)
def test_all_but_the_backbone_and_what_joins_it_is_kept(
    network: BackboneUNet, other: BackboneUNet, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch.manual_seed(0)
    public = EfficientNetLite(size="lite2").state_dict()
    monkeypatch.setattr(backbone_init, "public_backbone_weights", lambda size: public)
    left = start_from(network, other, torch.rand(6, 3, 64, 64))
    assert len(left) == len(other.lateral) and all(0 <= share <= 1 for share in left)
    before = network.state_dict()
    for name, value in other.state_dict().items():
        if name.startswith("backbone."):
            assert torch.equal(value, public[name.removeprefix("backbone.")])
        elif not name.startswith("lateral."):
            assert torch.equal(value, before[name])
    assert all(bool(value.isfinite().all()) for value in other.state_dict().values())


def test_the_backbone_that_a_part_has_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr("sys.argv", ["larger_backbone", "--model", "small", "--out", "nowhere"])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    assert "expected another backbone than lite2" in capsys.readouterr().err
