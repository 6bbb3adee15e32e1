"""Two object masks as one: means of their logits, and the vectors of the last."""

from dataclasses import replace

import pytest
import torch
from oracles_models import randomised
from torch import Tensor

from diff4splat.models.config.priors import MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size
from diff4splat.models.factory import create_networks, parameter_counts
from diff4splat.models.motion_unet.text_tokens import text_tokens
from diff4splat.models.object_mask.backbone_network import BackboneObjectMaskNet
from diff4splat.models.object_mask.ensemble import ObjectMaskEnsemble
from diff4splat.models.object_mask.mask_heads import HeadShape

TEXT_WIDTH, VECTOR = 8, 3
SHAPE = HeadShape(width=4, text_width=TEXT_WIDTH, instance_channels=VECTOR)


@pytest.fixture(scope="module")
def network() -> ObjectMaskEnsemble:
    torch.manual_seed(0)
    return randomised(ObjectMaskEnsemble(SHAPE, ("lite0", "lite2"))).eval()


@pytest.fixture(scope="module")
def inputs() -> tuple[Tensor, Tensor]:
    torch.manual_seed(1)
    return torch.rand(2, 3, 32, 48), torch.randn(2, 5, TEXT_WIDTH)


@torch.no_grad()
def test_logits_are_the_mean_of_the_members(
    network: ObjectMaskEnsemble, inputs: tuple[Tensor, Tensor]
) -> None:
    single = [member(*inputs) for member in network.members]
    assert not torch.allclose(*single)
    torch.testing.assert_close(network(*inputs), sum(single) / 2)


@torch.no_grad()
def test_every_member_reads_its_own_features(
    network: ObjectMaskEnsemble, inputs: tuple[Tensor, Tensor]
) -> None:
    image, text = inputs
    features = [member.features(image) for member in network.members]
    torch.testing.assert_close(network.features(image), torch.cat(features, 1))
    texts = text_tokens(torch.cat([text, text]), None)
    found = network.logits(network.features(image), texts)
    assert found.shape == (2, 2, 32, 48)
    names = [
        member.name_logits(part) for member, part in zip(network.members, features, strict=True)
    ]
    for index, mean in enumerate(network.name_logits(network.features(image))):
        torch.testing.assert_close(mean, sum(one[index] for one in names) / 2)


@torch.no_grad()
def test_instance_vectors_are_those_of_the_last_member(
    network: ObjectMaskEnsemble, inputs: tuple[Tensor, Tensor]
) -> None:
    logits, vectors = network.predict_mask_and_instances(*inputs)
    torch.testing.assert_close(logits, network(*inputs))
    first, last = network.members
    assert first.instances is None
    torch.testing.assert_close(vectors, last.instances(last.features(inputs[0])))
    torch.testing.assert_close(vectors, network.instances(network.features(inputs[0])))


@torch.no_grad()
def test_an_ensemble_may_have_no_vectors(inputs: tuple[Tensor, Tensor]) -> None:
    plain = ObjectMaskEnsemble(replace(SHAPE, instance_channels=0), ("lite0", "lite0"))
    assert plain.predict_mask_and_instances(*inputs)[1] is None


def test_gradients_reach_every_member(inputs: tuple[Tensor, Tensor]) -> None:
    torch.manual_seed(2)
    network = randomised(ObjectMaskEnsemble(SHAPE, ("lite0", "lite2")))
    network(*inputs).square().mean().backward()
    for member in network.members:
        assert float(member.embedding.weight.grad.abs().sum()) > 0
        assert float(member.backbone.stem.weight.grad.abs().sum()) > 0


def test_the_configuration_decides_the_members() -> None:
    mask = ObjectMaskConfig(width=4, image_backbone=True, instance_channels=VECTOR)
    assert mask.backbone_sizes == ("lite0",)
    both = replace(mask, second_backbone="lite2")
    assert both.backbone_sizes == ("lite0", "lite2")
    base = replace(test_size(), motion_unet=MotionUNetConfig(width=8))
    configs = [replace(base, object_mask=one) for one in (mask, both)]
    networks = [create_networks(one, parts=["object_mask"]).object_mask for one in configs]
    assert isinstance(networks[0], BackboneObjectMaskNet)
    assert [member.backbone.size for member in networks[1].members] == ["lite0", "lite2"]
    counts = [parameter_counts(one)["object_mask"] for one in configs]
    assert counts[1] > 2 * counts[0]
