"""Systems with one thing changed: which networks run, and a bypass that shows as 0."""

from dataclasses import replace

import pytest
import torch
from oracles_evaluation import SIZE, filmed, tiny_protocol, wall_and_patch

from diff4splat.errors import ConfigError
from diff4splat.evaluation.columns import SYSTEM
from diff4splat.evaluation.measure_item import Setup, measure_item
from diff4splat.evaluation.records import ItemResult
from diff4splat.evaluation.report.comparison_tables import ablation_section, hidden_section
from diff4splat.evaluation.report.summary import FILLS, summarize
from diff4splat.evaluation.runner import Outcome
from diff4splat.evaluation.systems.evaluated_system import Generator
from diff4splat.evaluation.systems.inpainting import METHODS, inpainted
from diff4splat.evaluation.systems.network_names import NETWORKS
from diff4splat.evaluation.systems.variants import (
    ABLATION_ROWS,
    EXTENSION,
    ablations,
    border_extension,
    unfilled,
)
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.scene.scene import Scene

SHIFT = (0.9, 0.0, 0.0)
PATCH_SIDE_PX = 8


def generator(**settings: object) -> Generator:
    """Plans need the configuration of a model, not its weights."""
    pipeline = Diff4SplatPipeline.from_pretrained("small")
    return Generator(pipeline=pipeline, settings=GenerationSettings(**settings))


OF_MOTION = {"object_mask", "image_classifier", "object_shadow"}
"""What only a motion prior asks for."""


def by_row(full: Generator) -> dict[str, Generator | None]:
    """The changed system of every ablation; None where nothing changes."""
    variants = ablations(full, NETWORKS)
    return {v.row: None if v.same else v.system for v in variants}


def test_a_network_that_does_not_run_changes_nothing() -> None:
    rows = by_row(generator(fill="none"))
    idle = {row for row, system in rows.items() if system is None}
    assert idle == {ABLATION_ROWS[name] for name in ("video", "ldrm", "deformation")}
    assert border_extension(generator(fill="none")).same


def test_a_network_that_runs_is_left_out() -> None:
    full = generator(fill="video")
    rows = by_row(full)
    assert set(rows) == set(ABLATION_ROWS.values())
    assert None not in rows.values()
    gone = {row: full.parts - system.parts for row, system in rows.items()}
    video = {"vae", "dit", "ldrm", "deformation"}
    assert gone == {
        "without depth prior": {"monocular_depth"},
        "without motion prior": {"motion_unet", *OF_MOTION},
        "without object mask": {"object_mask", "image_classifier"},
        "without image classifier": {"image_classifier"},
        "without image inpainting": {"image_inpainting"},
        "without object shadow": {"object_shadow"},
        "without text encoder": {"text_encoder", "motion_unet", *OF_MOTION},
        "without video model": {"dit"},
        "without VAE and LDRM": video,
        "without deformation": {"deformation"},
    }
    assert not border_extension(full).same
    assert full.parts - border_extension(full).system.parts == video


def test_rows_come_in_the_order_of_the_table() -> None:
    rows = [variant.row for variant in ablations(generator(), ["text", "depth"])]
    assert rows == ["without depth prior", "without text encoder"]


def test_only_networks_can_be_left_out() -> None:
    with pytest.raises(ConfigError, match="expected names of networks"):
        GenerationSettings(without=("sky",))


def measured(monkeypatch: pytest.MonkeyPatch, full: Generator, truth: Scene) -> Outcome:
    """Two items by a pipeline that is right unless its depth prior is left out."""

    def generate(
        self: object, *request: object, settings: GenerationSettings, **_: object
    ) -> Scene:
        if not settings.extended_layers:
            return wall_and_patch(SHIFT)
        return wall_and_patch() if "monocular_depth" in settings.without else truth

    monkeypatch.setattr(Diff4SplatPipeline, "__call__", generate)
    setup = Setup(
        protocol=tiny_protocol(),
        task="generation",
        system=full,
        variants=ablations(full, NETWORKS),
    )
    items = tuple(measure_item(index, filmed(truth), setup) for index in range(2))
    return Outcome(setup=setup, items=items, failures=(), requested=2, resumed=0)


def test_ablations_show_what_helps_and_a_bypass_as_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    run = measured(monkeypatch, generator(fill="none"), wall_and_patch(SHIFT))
    summary = summarize(run)
    for name in ("video", "ldrm", "deformation"):
        assert summary.comparison(ABLATION_ROWS[name], "psnr").value == 0
        assert summary.comparison(ABLATION_ROWS[name], "hidden_psnr").value == 0
    assert summary.comparison("without depth prior", "psnr").value > 5
    assert summary.comparison("without depth prior", "track_error").value > 0.1
    # A motion prior that the scene ignores is measured, and does nothing either.
    assert summary.comparison("without motion prior", "psnr").value == 0
    assert summary.comparison(EXTENSION, "hidden_psnr").value == 0
    table = ablation_section(run, summary)
    assert any(line.startswith("| without video model | 0 | 0 |") for line in table)


def test_the_truth_beats_every_fill_on_hidden_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    run = measured(monkeypatch, generator(fill="none"), wall_and_patch(SHIFT))
    item: ItemResult = run.items[0]
    for region in ("hidden", "disoccluded_by_motion", "outside"):
        assert item.value(SYSTEM, f"{region}_psnr") > 45
    assert item.value("best plane (oracle)", "disoccluded_by_motion_psnr") < 25
    text = "\n".join(hidden_section(run, summarize(run)))
    assert all(row in text for row in FILLS)
    assert "Of the target pixels: hidden" in text


def test_what_is_not_filled_stays_out() -> None:
    settings = unfilled(generator(fill="video")).settings
    assert (settings.fill, settings.extended_layers) == ("none", False)


@pytest.mark.parametrize("method", METHODS.values())
def test_inpainting_continues_colours_and_keeps_the_rest(method: int) -> None:
    rgb = torch.rand(*SIZE, 3, generator=torch.Generator().manual_seed(0))
    rgb[4:20, 4:30] = torch.tensor([0.2, 0.6, 0.4])
    hole = torch.zeros(SIZE, dtype=torch.bool)
    hole[8:16, 8 : 8 + PATCH_SIDE_PX] = True
    broken = torch.where(hole[..., None], 0.0, rgb)
    filled = inpainted(broken, hole, method)
    assert torch.equal(filled[~hole], rgb[~hole])
    assert torch.allclose(filled[hole], rgb[hole], atol=0.01)


@pytest.mark.parametrize("method", METHODS.values())
def test_inpainting_of_nothing_and_of_everything(method: int) -> None:
    rgb = torch.rand(6, 5, 3)
    none, every = torch.zeros(6, 5, dtype=torch.bool), torch.ones(6, 5, dtype=torch.bool)
    assert torch.equal(inpainted(rgb, none, method), rgb)
    assert torch.equal(inpainted(rgb, every, method), torch.full((6, 5, 3), 0.5))


def test_settings_of_an_ablation_are_part_of_its_identity() -> None:
    full = generator(fill="none")
    without = replace(full, settings=replace(full.settings, without=("monocular_depth",)))
    assert without.identity != full.identity
