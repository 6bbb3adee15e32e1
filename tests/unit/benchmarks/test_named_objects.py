"""Requests of the benchmark of named objects, and what it measures of a mask."""

import json
import math
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from oracles_clips import make_clip

from benchmarks.named_objects.__main__ import auc, collect, means, measure
from benchmarks.named_objects.requests import asked_image
from diff4splat.captions.vocabulary import UNSEEN_NOUNS
from diff4splat.generation.motion.motion_mask import MotionProbability
from diff4splat.training.batches.requests.present import TRAINING_NOUNS


def sample(probability: torch.Tensor) -> MotionProbability:
    return MotionProbability(probability=probability)


def test_a_mask_is_compared_with_the_object_or_with_nothing() -> None:
    truth = torch.zeros(4, 4, dtype=torch.bool)
    truth[:2, :2] = True
    probability = torch.zeros(4, 4)
    probability[0, :3] = torch.tensor([0.9, 0.8, 0.8])
    assert measure(sample(probability), truth) == {"overlap": 2 / 5, "found": 1.0, "whole": 0.0}
    assert measure(sample(probability), truth & False) == {"still": 0.0}
    assert measure(sample(0 * probability), truth & False) == {"still": 1.0}


@pytest.mark.parametrize("unknown", [False, True])
def test_equal_clips_give_equal_requests(unknown: bool) -> None:
    first, again = (asked_image(make_clip(), unknown_nouns=unknown) for _ in range(2))
    assert [text for text, _ in first.requests] == [text for text, _ in again.requests]
    assert first.requests and not bool(first.requests[-1][1].any())


def test_unknown_nouns_stand_beside_the_colour_of_one_object() -> None:
    for text, truth in asked_image(make_clip(), unknown_nouns=True).requests:
        known = set(TRAINING_NOUNS) & set(text.split())
        assert not known and any(noun in text for noun in UNSEEN_NOUNS)
        assert truth.dtype == torch.bool


def test_auc_is_the_share_of_pairs_in_the_right_order() -> None:
    assert auc([0.9, 0.4], [0.5, 0.1]) == 0.75
    assert auc([0.5], [0.5]) == 0.5
    assert math.isnan(auc([], [0.5]))


def test_every_object_can_be_asked_for() -> None:
    few, all_ = (asked_image(make_clip(), most_objects=most) for most in (1, 99))
    assert sum(bool(truth.any()) for _, truth in few.requests) == 1
    assert len(all_.requests) > len(few.requests)


@pytest.mark.parametrize("table", ["OUTLINES", "OPENCV_OUTLINES"])
def test_outlines_of_photographs_are_shares_and_names_are_of_one_object(table: str) -> None:
    pytest.importorskip("skimage", reason="pip install scikit-image")
    from benchmarks.named_objects import photographs

    outlines, outlined = getattr(photographs, table), photographs.outlined
    for content in json.loads(outlines.read_text(encoding="utf-8")).values():
        names = [name for one in content["objects"].values() for name in one["names"]]
        names += content["absent"]
        assert len(set(names)) == len(names)
        for one in content["objects"].values():
            assert all(0 <= share <= 1 for corner in one["outline"] for share in corner)
            mask = outlined(one["outline"], torch.zeros(128, 192, 3))
            assert 0.002 < float(mask.double().mean()) < 0.8


def test_photographs_of_a_folder_are_asked_about(tmp_path: Path) -> None:
    pytest.importorskip("skimage", reason="pip install scikit-image")
    from benchmarks.named_objects.photographs import OPENCV_OUTLINES, all_asked

    content = json.loads(OPENCV_OUTLINES.read_text(encoding="utf-8"))
    for photograph in content:
        cv2.imwrite(str(tmp_path / photograph), np.full((130, 200, 3), 128, np.uint8))
    asked = all_asked(tmp_path)
    assert {one.photograph for one in asked} == set(content)
    assert all(one.rgb.shape == (128, 192, 3) for one in asked)
    assert all(float((one.rgb - 128 / 255).abs().max()) < 0.01 for one in asked)
    assert sum(not bool(one.truth.any()) for one in asked) == 3 * len(content)


def test_a_folder_without_the_photographs_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    pytest.importorskip("skimage", reason="pip install scikit-image")
    from benchmarks.named_objects import photographs

    monkeypatch.setattr("sys.argv", ["photographs", "small", "--opencv", str(tmp_path)])
    with pytest.raises(SystemExit) as stop:
        photographs.main()
    assert stop.value.code == 2
    assert "messi5.jpg" in capsys.readouterr().err


def test_means_have_every_column() -> None:
    values: dict[str, list[float]] = defaultdict(list)
    truth = torch.zeros(4, 4, dtype=torch.bool)
    collect(values, sample(torch.full((4, 4), 0.2)), truth)
    truth[:2, :2] = True
    collect(values, sample(torch.where(truth, 0.9, 0.0)), truth)
    table = means(values)
    assert all(table[column] == 1.0 for column in ("overlap", "found", "whole", "auc"))
