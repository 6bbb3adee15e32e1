"""The object mask: one pass over an image serves many prompts, and padding changes nothing."""

import pytest
import torch
from oracles_models import randomised
from torch import Tensor

from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.motion_unet.text_tokens import text_tokens
from diff4splat.models.object_mask.mask_heads import START_LOGIT, HeadShape
from diff4splat.models.object_mask.network import ObjectMaskNet
from diff4splat.models.object_mask.text_queries import QUERIES

WIDTH, TEXT_WIDTH = 4, 8


def network() -> ObjectMaskNet:
    torch.manual_seed(0)
    return randomised(ObjectMaskNet(HeadShape(width=WIDTH, text_width=TEXT_WIDTH))).double()


def image(count: int = 2) -> Tensor:
    torch.manual_seed(1)
    return torch.rand(count, 3, 32, 16).double()


def text(count: int = 2, tokens: int = 7) -> Tensor:
    torch.manual_seed(2)
    return torch.randn(count, tokens, TEXT_WIDTH).double()


def test_prompts_of_one_image_do_not_touch_each_other() -> None:
    net, images, texts = network(), image(), text(6)
    together = net.logits(net.features(images), text_tokens(texts, None))
    assert together.shape == (2, 3, 32, 16)
    for index in range(6):
        own = net(images[index // 3][None], texts[index][None])
        torch.testing.assert_close(together[index // 3, index % 3], own[0])


@torch.no_grad()
def test_logits_are_products_of_queries_and_embedding() -> None:
    net, images, texts = network(), image(1), text(1)
    shuffled = torch.nn.functional.pixel_shuffle
    embedding = shuffled(net.embedding(net.features(images)), FOLDED_PX)
    queries, biases = net.queries(text_tokens(texts, None))
    scale = net.embedding_width**0.5
    row, column = 17, 5
    products = [
        float(queries[0, index] @ embedding[0, :, row, column]) / scale + float(biases[0, index])
        for index in range(QUERIES)
    ]
    expected = torch.tensor(products).double().exp().sum().log() + START_LOGIT
    assert float(net(images, texts)[0, row, column]) == pytest.approx(float(expected), abs=1e-5)


@torch.no_grad()
def test_names_are_read_from_the_first_pixel_of_every_cell() -> None:
    net, images = network(), image(1)
    features = net.features(images)
    embedding = torch.nn.functional.pixel_shuffle(net.embedding(features), FOLDED_PX)
    expected = net.names(embedding[:, :, ::FOLDED_PX, ::FOLDED_PX])
    torch.testing.assert_close(torch.cat(net.name_logits(features), 1), expected)


def test_padding_changes_nothing() -> None:
    net, images, texts = network(), image(), text()
    mask = torch.ones(2, 7, dtype=torch.bool)
    mask[1, 4:] = False
    padded = torch.cat([texts, torch.full((2, 9, TEXT_WIDTH), 7.0).double()], 1)
    longer = torch.cat([mask, torch.zeros(2, 9, dtype=torch.bool)], 1)
    torch.testing.assert_close(net(images, texts, mask), net(images, padded, longer))
    short = net(images[1:], texts[1:, :4])
    torch.testing.assert_close(net(images, texts, mask)[1:], short)


def test_a_prompt_without_tokens_has_queries_of_its_own() -> None:
    net, images, texts = network(), image(), text()
    mask = torch.ones(2, 7, dtype=torch.bool)
    mask[1] = False
    first = net(images, texts, mask)
    second = net(images, texts.flip(1), mask)
    torch.testing.assert_close(first[1], second[1])
    assert bool((first[0] != second[0]).any())


@pytest.mark.parametrize("scale", [0.0, 1e4, -1e4])
def test_value_and_gradient_stay_finite(scale: float) -> None:
    net = network().float()
    images = torch.full((1, 3, 16, 16), 0.5, requires_grad=True)
    texts = torch.full((1, 3, TEXT_WIDTH), scale, requires_grad=True)
    logits = net(images, texts)
    logits.sigmoid().mean().backward()
    found = (logits, images.grad, texts.grad, *(p.grad for p in net.parameters()))
    assert all(bool(one.isfinite().all()) for one in found if one is not None)


def test_every_pixel_matters() -> None:
    net, images, texts = network(), image(1), text(1)
    plain = net(images, texts)
    for row, column in ((0, 0), (17, 9), (31, 15)):
        other = images.clone()
        other[:, :, row, column] = 1 - other[:, :, row, column]
        assert bool(net(other, texts)[0, row, column] != plain[0, row, column])
