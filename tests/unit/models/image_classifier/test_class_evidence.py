"""Evidence of classes against its formula."""

import math

import pytest
import torch

from diff4splat.models.image_classifier.class_evidence import LEAST_SHARE, class_evidence

CLASSES = 7


def rows(*named: tuple[int, ...]) -> torch.Tensor:
    classes = torch.zeros(1, len(named), CLASSES, dtype=torch.bool)
    for row, numbers in zip(classes[0], named, strict=True):
        row[list(numbers)] = True
    return classes


@pytest.mark.parametrize("offset", [-1e4, 0.0, 1e4])
def test_it_is_the_formula(offset: float) -> None:
    generator = torch.Generator().manual_seed(0)
    logits = 3 * torch.randn(1, CLASSES, 2, 3, generator=generator, dtype=torch.float64) + offset
    found = class_evidence(logits, rows((1, 4), (2,)))
    for row, numbers in enumerate([[1, 4], [2]]):
        together = torch.logsumexp(logits[0, numbers], 0)
        torch.testing.assert_close(found[0, row, 0], together - logits[0].mean(0))
        torch.testing.assert_close(found[0, row, 1], together - torch.logsumexp(logits[0], 0))


def test_all_classes_are_certain() -> None:
    found = class_evidence(torch.randn(1, CLASSES, 2, 2), rows(tuple(range(CLASSES))))
    torch.testing.assert_close(found[0, 0, 1], torch.zeros(2, 2), atol=1e-5, rtol=0)


def test_a_prompt_without_classes_has_none() -> None:
    found = class_evidence(torch.full((1, CLASSES, 2, 2), 1e30), rows(()))
    assert not found.any()


@pytest.mark.parametrize("height", [0.0, 1e3, 1e30])
def test_extreme_logits_stay_finite(height: float) -> None:
    logits = torch.zeros(1, CLASSES, 1, 1)
    logits[0, 0] = height
    found = class_evidence(logits, rows((0,), (1,)))
    assert torch.isfinite(found).all()
    floor = max(-height, math.log(LEAST_SHARE)) - math.log1p((CLASSES - 1) * math.exp(-height))
    assert float(found[0, 1, 1]) == pytest.approx(floor, rel=0.05, abs=2.0)


@pytest.mark.parametrize("dtype", [torch.bfloat16, torch.float16])
def test_half_precision_stays_finite(dtype: torch.dtype) -> None:
    logits = torch.tensor([40.0, *[-40.0] * (CLASSES - 1)], dtype=dtype)[None, :, None, None]
    with torch.autocast("cpu", dtype):
        found = class_evidence(logits, rows((1,)))
    assert found.dtype == torch.float32
    assert torch.isfinite(found).all()
