"""Measures of videos with known features, and their distances in the report."""

from dataclasses import dataclass, replace

import pytest
import torch
from oracles_evaluation import Fixed, filmed, tiny_protocol, wall_and_patch
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.evaluation.columns import SYSTEM, TRUTH
from diff4splat.evaluation.measure_item import Setup, measure_item
from diff4splat.evaluation.measures.videos import VideoNetworks, frame_consistency
from diff4splat.evaluation.records import read_item
from diff4splat.evaluation.report.distributions import distribution_distances
from diff4splat.evaluation.report.report_writer import to_markdown
from diff4splat.evaluation.report.summary import summarize
from diff4splat.evaluation.runner import Outcome
from diff4splat.evaluation.systems.baselines import NEAREST
from diff4splat.metrics.features.fixed_features import FixedFeatures
from diff4splat.scene.scene import Scene

SHIFT = (0.9, 0.0, 0.0)


@dataclass(frozen=True)
class Colours:
    """Mean colour as the feature of an image; texts are red or grey."""

    name: str = "mean colours"

    def embed_images(self, images: Tensor) -> Tensor:
        return torch.nn.functional.normalize(images.mean((-2, -1)), dim=-1)

    def embed_texts(self, texts: list[str]) -> Tensor:
        red = torch.tensor([[1.0, 0.0, 0.0]])
        return torch.cat([red if "patch" in text else -red for text in texts])


def setup(scene: Scene) -> Setup:
    networks = VideoNetworks(distribution=FixedFeatures(), frames=Colours(), text=Colours())
    return Setup(protocol=tiny_protocol(), task="generation", system=Fixed(scene), videos=networks)


def clip(number: int) -> Clip:
    return filmed(wall_and_patch((0.3 * number, 0.0, 0.0)), f"clip-{number}", still=not number)


def outcome(scene: Scene, count: int = 3) -> Outcome:
    run = setup(scene)
    items = tuple(measure_item(number, clip(number), run) for number in range(count))
    return Outcome(setup=run, items=items, failures=(), requested=count, resumed=0)


def test_frames_that_do_not_change_are_consistent() -> None:
    one = torch.rand(1, 5).double()
    assert frame_consistency(one.expand(4, 5)) == pytest.approx(1)
    turn = torch.tensor([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]).double()
    assert frame_consistency(turn) == pytest.approx((0 + 0 + 1 + 0) / 4)


def test_the_score_of_text_is_a_cosine_of_frames_and_caption() -> None:
    run = setup(wall_and_patch(SHIFT))
    known = measure_item(0, clip(1), run)
    frames = [clip(1).views[0].rgb[frame].float().mean((0, 1)) for frame in (2, 4)]
    wanted = 100 * sum(float(c[0] / c.norm()) for c in frames) / 2
    assert known.value(SYSTEM, "clip_score") == pytest.approx(wanted, rel=0.05)
    away = replace(clip(1), note=replace(clip(1).note, caption="nothing moves"))
    assert measure_item(0, away, run).value(SYSTEM, "clip_score") == 0
    silent = replace(clip(1), note=replace(clip(1).note, caption=""))
    skips = measure_item(0, silent, run).skips
    assert any(skip.key == "clip_score" and "no caption" in skip.why for skip in skips)


def test_embeddings_are_stored_and_read() -> None:
    item = measure_item(0, clip(1), setup(wall_and_patch(SHIFT)))
    assert len(item.embedding(TRUTH)) == len(item.embedding(SYSTEM)) > 100
    assert item.embedding("zero motion") is None
    assert read_item(item.to_json(), "here") == item


def test_a_system_that_shows_the_truth_is_nearer_than_one_that_does_not_move() -> None:
    run = outcome(wall_and_patch((0.3, 0.0, 0.0)))
    found = {(one.row, one.distance): one.mean for one in distribution_distances(run)}
    system = found[SYSTEM, "Fréchet distance"]
    assert 0 <= system.value < found[NEAREST, "Fréchet distance"].value
    assert system.low < system.value < system.high
    page = to_markdown(run, summarize(run))
    assert "## Distribution of videos" in page
    assert "not I3D or CLIP" in page
    assert "CLIP score: mean colours." in page


def test_one_video_has_no_distribution() -> None:
    assert distribution_distances(outcome(wall_and_patch(SHIFT), count=1)) == ()
