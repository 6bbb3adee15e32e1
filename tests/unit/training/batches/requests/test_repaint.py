"""Repainted objects: the colour they are named by, shading, and parts of a second colour."""

import numpy as np
import pytest
import torch

from diff4splat.captions.colors import COLOR_NAMES, color_name
from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.srgb import linear_from_srgb
from diff4splat.training.batches.requests import repaint
from diff4splat.training.batches.requests.object_image import ObjectImage
from diff4splat.training.batches.requests.present import PresentObject

SIDE = 32


def object_image(pixels: torch.Tensor | None = None) -> ObjectImage:
    """A red box, its left half in shadow, on black."""
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[4:28, 4:28] = True
    image = torch.zeros(SIDE, SIDE, 3, dtype=torch.uint8)
    image[mask] = torch.tensor([190, 60, 50], dtype=torch.uint8)
    image[:, :16] //= 2
    box = PresentObject(named=NamedObject("red", "box"), mask=mask, moves=False)
    return ObjectImage(image=image if pixels is None else pixels, objects=[box])


def repainted(
    monkeypatch: pytest.MonkeyPatch, whole: float, part: float, seed: int, given: ObjectImage
) -> ObjectImage:
    monkeypatch.setattr(repaint, "REPAINTED_SHARE", whole)
    monkeypatch.setattr(repaint, "TWO_COLORED_SHARE", part)
    return repaint.repaint(given, torch.Generator().manual_seed(seed))


def test_objects_have_the_colour_that_names_them(monkeypatch: pytest.MonkeyPatch) -> None:
    right, names = [], set()
    for seed in range(60):
        found = repainted(monkeypatch, 1.0, 0.0, seed, object_image())
        one = found.objects[0]
        pixels = linear_from_srgb(found.image[one.mask].numpy() / 255)
        names.add(one.named.color)
        right.append(color_name(pixels.mean(0)) == one.named.color)
    # light and shade move some colours to the next name
    assert sum(right) > 40 and len(names) > 9
    assert names <= set(COLOR_NAMES)


def test_shading_and_all_else_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    before = object_image()
    found = repainted(monkeypatch, 1.0, 0.0, 3, before)
    mask = before.objects[0].mask
    assert torch.equal(found.image[~mask], before.image[~mask])
    assert torch.equal(found.objects[0].mask, mask)
    light = linear_from_srgb(found.image.numpy() / 255)
    old = linear_from_srgb(before.image.numpy() / 255)
    ratio = (light[10, 8] / light[10, 20]) / (old[10, 8] / old[10, 20])
    np.testing.assert_allclose(ratio, 1.0, atol=0.25)


def test_the_second_colour_covers_less_than_half(monkeypatch: pytest.MonkeyPatch) -> None:
    shares = []
    for seed in range(40):
        before = object_image()
        found = repainted(monkeypatch, 0.0, 1.0, seed, before)
        changed = (found.image != before.image).any(-1)
        assert not bool(changed[~before.objects[0].mask].any())
        assert found.objects[0].named == before.objects[0].named
        shares.append(float(changed.sum() / before.objects[0].mask.sum()))
    assert max(shares) < 0.55 and min(shares) > 0.04
    assert len({round(share, 2) for share in shares}) > 10


def test_what_is_given_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    before, same = object_image(), object_image()
    repainted(monkeypatch, 1.0, 1.0, 0, before)
    assert torch.equal(before.image, same.image)


@pytest.mark.parametrize("value", [0, 255])
def test_black_and_white_objects_can_be_painted(
    monkeypatch: pytest.MonkeyPatch, value: int
) -> None:
    flat = torch.full((SIDE, SIDE, 3), value, dtype=torch.uint8)
    for seed in range(10):
        found = repainted(monkeypatch, 1.0, 1.0, seed, object_image(flat))
        # nothing multiplies black to a colour; white takes any
        assert bool((found.image != flat).any()) == (value == 255)


def test_one_pixel_and_no_object(monkeypatch: pytest.MonkeyPatch) -> None:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[0, 0] = True
    dot = PresentObject(named=NamedObject("red", "box"), mask=mask, moves=False)
    image = object_image().image
    repainted(monkeypatch, 1.0, 1.0, 0, ObjectImage(image=image, objects=[dot]))
    empty = repainted(monkeypatch, 1.0, 1.0, 0, ObjectImage(image=image, objects=[]))
    assert torch.equal(empty.image, image)
