"""Public weights of the image backbone as the start of a stage."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from clip_shards import reading, write_shards
from depth_stages import depth_recipe

from diff4splat.errors import ConfigError
from diff4splat.models.config.priors import BackboneSize, MonocularDepthConfig
from diff4splat.models.image_backbone.efficientnet_lite import EfficientNetLite
from diff4splat.models.monocular_depth.backbone_network import BackboneDepthNet
from diff4splat.models.monocular_depth.network import MonocularDepthNet
from diff4splat.models.networks import Networks
from diff4splat.models.object_mask.backbone_network import BackboneObjectMaskNet
from diff4splat.models.object_mask.mask_heads import HeadShape
from diff4splat.training import backbone_init
from diff4splat.training.prerequisites import last_checkpoint
from diff4splat.training.train_stage import StageRequest, train_stage
from diff4splat.training.trainer.checkpoints.export import load_parts


@pytest.mark.parametrize("size", ["lite0", "lite2"])
def test_only_the_backbone_takes_public_weights(
    size: BackboneSize, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch.manual_seed(1)
    public = EfficientNetLite(size=size).state_dict()
    monkeypatch.setattr(backbone_init, "public_backbone_weights", {size: public}.__getitem__)
    network = BackboneDepthNet(4, size=size)
    before = {key: value.clone() for key, value in network.state_dict().items()}
    networks = Networks(monocular_depth=network)
    backbone_init.start_from_public_backbones(networks, ["monocular_depth"])
    for key, value in network.state_dict().items():
        name = key.removeprefix("backbone.")
        want = public[name] if key.startswith("backbone.") else before[key]
        torch.testing.assert_close(value, want)


def test_a_shorter_backbone_takes_the_weights_that_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(1)
    public = EfficientNetLite().state_dict()
    monkeypatch.setattr(backbone_init, "public_backbone_weights", lambda size: public)
    network = BackboneObjectMaskNet(HeadShape(width=4, text_width=8))
    backbone_init.start_from_public_backbones(Networks(object_mask=network), ["object_mask"])
    taken = network.backbone.state_dict()
    assert len(taken) < len(public)
    for name, value in taken.items():
        torch.testing.assert_close(value, public[name])


def test_a_part_without_a_backbone_is_refused() -> None:
    networks = Networks(monocular_depth=MonocularDepthNet(4))
    with pytest.raises(ConfigError, match=r"monocular_depth.*image_backbone"):
        backbone_init.start_from_public_backbones(networks, ["monocular_depth"])
    backbone_init.start_from_public_backbones(networks, [])


@pytest.mark.slow
@pytest.mark.usefixtures("as_shipped")
def test_a_stage_starts_from_public_weights_also_after_a_start_without_a_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch.manual_seed(1)
    public = EfficientNetLite().state_dict()
    monkeypatch.setattr(backbone_init, "public_backbone_weights", lambda size: public)
    recipe = reading(write_shards(tmp_path / "shards"))
    prior = MonocularDepthConfig(channels=4, image_backbone=True)
    like = depth_recipe()
    stage = replace(
        like,
        steps=1,
        data=replace(recipe.stage("dynamic").data, keyframe_stride=4),
        optimizer=replace(like.optimizer, learning_rate=1e-9),
        public_backbone=True,
    )
    model = replace(recipe.model, monocular_depth=prior)
    recipe = replace(recipe, model=model, stages=(stage,))
    run = tmp_path / "run"
    for _ in range(2):
        train_stage(StageRequest(recipe=recipe, stage=stage.name, folder=run))
        stored = load_parts(last_checkpoint(run / stage.name))["monocular_depth"]
        torch.testing.assert_close(stored["backbone.stem.weight"], public["stem.weight"])
        shutil.rmtree(run / stage.name / "checkpoints")
        (run / stage.name / "result.json").unlink()
        assert (run / stage.name / "recipe.json").is_file()
