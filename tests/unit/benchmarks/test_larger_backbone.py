"""The start of a network on a larger backbone."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from benchmarks.larger_backbone import ensemble
from benchmarks.larger_backbone.__main__ import main
from benchmarks.larger_backbone.fitted_start import fit, start_from
from diff4splat.models.config.priors import BackboneSize, MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model, save_model
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


def model_with_mask(size: BackboneSize, seed: int) -> Model:
    mask = ObjectMaskConfig(width=4, image_backbone=True, backbone_size=size, instance_channels=3)
    motion = MotionUNetConfig(width=8, heads=1)
    config = replace(tiny_size(), motion_unet=motion, object_mask=mask)
    return Model(config=config, networks=create_networks(config, seed=seed))


@torch.no_grad()
def test_an_ensemble_has_the_masks_of_both_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    models = [model_with_mask("lite0", 1), model_with_mask("lite2", 2)]
    folders = [tmp_path / name for name in ("first", "second", "both")]
    for model, folder in zip(models, folders, strict=False):
        save_model(model, folder)
    monkeypatch.setattr("sys.argv", ["ensemble", *map(str, folders[:2]), "--out", str(folders[2])])
    ensemble.main()
    both = load_model(str(folders[2]))
    assert both.config.object_mask.backbone_sizes == ("lite0", "lite2")
    inputs = torch.rand(1, 3, 32, 32), torch.rand(1, 4, both.config.text.width)
    maps = [one.networks.object_mask.predict_mask_and_instances(*inputs) for one in models]
    logits, vectors = both.networks.object_mask.predict_mask_and_instances(*inputs)
    torch.testing.assert_close(logits, (maps[0][0] + maps[1][0]) / 2)
    torch.testing.assert_close(vectors, maps[1][1])
    words = [one.networks.text_encoder.state_dict() for one in (both, models[0])]
    assert all(torch.equal(words[0][name], words[1][name]) for name in words[0])


def test_an_ensemble_of_an_ensemble_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    first = model_with_mask("lite0", 1)
    save_model(ensemble.ensemble(first, model_with_mask("lite2", 2)), tmp_path / "both")
    save_model(first, tmp_path / "first")
    names = [str(tmp_path / name) for name in ("first", "both", "new")]
    monkeypatch.setattr("sys.argv", ["ensemble", *names[:2], "--out", names[2]])
    with pytest.raises(SystemExit) as stop:
        ensemble.main()
    assert stop.value.code == 2
    assert "SECOND: expected one object mask on an image backbone" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
    arguments = ["--part", "object_mask", "--model", names[1], "--out", names[2]]
    monkeypatch.setattr("sys.argv", ["larger_backbone", *arguments])
    with pytest.raises(SystemExit):
        main()
    assert "got an ensemble" in capsys.readouterr().err
