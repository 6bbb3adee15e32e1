"""Reused blocks, graphs of the shipped networks, and the settings of a generation that are new."""

from pathlib import Path

import pytest
import torch
from torch import nn

from diff4splat.error_time.block_caching import CACHINGS, NO_CACHING
from diff4splat.error_time.known_knobs import known_knobs
from diff4splat.error_time.subjects import runtimes, scenes
from diff4splat.error_time.subjects.block_cache import ReusedBlocks
from diff4splat.models.blocks.rope import rope_tables
from diff4splat.models.hub.model import load_model
from diff4splat.models.onnx.manifest import file_entry, read_manifest
from diff4splat.models.video_dit.conditions import DitConditions

ROPE = rope_tables((1, 1, 1), 8, torch.device("cpu"))


class AddOne(nn.Module):
    """A block that counts its runs."""

    def __init__(self) -> None:
        super().__init__()
        self.runs = 0

    def forward(self, tokens, modulation, rope, conditions):
        self.runs += 1
        return tokens + modulation


def reused(largest_change: float) -> tuple[ReusedBlocks, list[AddOne]]:
    blocks = [AddOne(), AddOne()]
    return ReusedBlocks(nn.ModuleList(blocks), largest_change), blocks


def test_without_a_change_that_is_allowed_every_block_runs() -> None:
    rest, blocks = reused(0.0)
    tokens, one, branch = torch.ones(1, 3), torch.ones(1), DitConditions()
    for _ in range(3):
        assert torch.equal(rest(tokens, one, ROPE, branch), tokens + 2)
    assert [block.runs for block in blocks] == [3, 3] and rest.reused == 0


def test_small_changes_add_what_was_added_and_large_ones_run() -> None:
    rest, blocks = reused(0.1)
    tokens, branch, other = torch.ones(1, 4), DitConditions(), DitConditions()
    first = torch.full((1,), 1.0)
    assert torch.equal(rest(tokens, first, ROPE, branch), tokens + 2)
    later = torch.full((1,), 5.0)  # what the blocks would add now
    assert torch.equal(rest(1.05 * tokens, later, ROPE, branch), 1.05 * tokens + 2)
    assert torch.equal(rest(1.5 * tokens, later, ROPE, branch), 1.5 * tokens + 10)
    # Each branch of guidance remembers its own.
    assert torch.equal(rest(tokens, later, ROPE, other), tokens + 10)
    assert [block.runs for block in blocks] == [3, 3] and rest.reused == 1


def test_names_of_reuse_differ() -> None:
    assert NO_CACHING in CACHINGS
    assert len({(one.series, one.label) for one in CACHINGS}) == len(CACHINGS)


@pytest.mark.slow
@pytest.mark.usefixtures("as_shipped")
def test_converted_graphs_are_those_of_the_manifest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onnxscript")
    from diff4splat.models.onnx_export.folder import ExportSettings, export_model

    exported = tmp_path / runtimes.FLOAT32
    settings = ExportSettings(parity=False, parts=("text_encoder",))
    export_model(load_model("test", parts=()), exported, settings)
    monkeypatch.setattr(runtimes, "_graphs", lambda: tmp_path)
    monkeypatch.setattr(runtimes, "PARTS", ("text_encoder",))
    runtimes.graph_model.cache_clear()
    model = runtimes.graph_model("int8")
    runtimes.graph_model.cache_clear()
    assert model.loaded == {"text_encoder"} and model.runtime == "onnx"
    manifest = read_manifest(tmp_path / "int8")
    assert manifest.precision == "int8"
    assert [entry.part for entry in manifest.graphs] == ["text_encoder"]
    for entry in manifest.graphs:
        assert entry.files == (file_entry(tmp_path / "int8" / entry.files[0].name),)


def test_the_settings_are_in_the_report() -> None:
    names = {knob.name: knob for knob in known_knobs()}
    assert {"key-times", "fill-stride", "runtime", "block-caching"} <= set(names)
    assert names["runtime"].repeats == 1  # the first run exports


@pytest.mark.usefixtures("as_shipped")
def test_views_of_a_scene_are_rendered_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rendered = []
    monkeypatch.setattr(scenes, "_rendered", lambda scene: rendered.append(scene) or views)
    monkeypatch.setattr(scenes, "_seen", {})
    monkeypatch.setattr(scenes, "KEPT", 2)
    zero = torch.zeros(1)
    views = scenes.Views(rgb=zero, depth=zero, flow_px=zero)
    for scene in ("a", "b", "a", "c", "a", "b"):
        assert scenes.views(scene) is views
    assert rendered == ["a", "b", "c", "b"], "the one that was not asked for longest goes"
