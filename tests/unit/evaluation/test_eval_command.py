"""``diff4splat eval`` end to end with a model of random weights."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from listed_clips import ListedClips
from oracles_clips import make_clip
from oracles_evaluation import FRAMES, tiny_protocol, wall_and_patch
from PIL import Image
from small_clip import write_clip

from diff4splat.cli.evaluate import Evaluate
from diff4splat.errors import ConfigError, InputError
from diff4splat.evaluation.protocols.protocol_json import (
    LoadedProtocol,
    protocol_json,
    protocol_names,
)
from diff4splat.evaluation.protocols.sample import make_sample
from diff4splat.evaluation.systems.evaluated_system import Generator
from diff4splat.evaluation.systems.network_names import NETWORKS
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings

SIZE = (32, 48)
"""What the smallest model takes."""


@pytest.fixture
def protocol_file(tmp_path: Path) -> Path:
    tiny = tiny_protocol(2)
    protocol = replace(tiny, size_px=SIZE, loop=replace(tiny.loop, size_px=SIZE))
    file = tmp_path / "tiny.json"
    file.write_text(protocol_json(protocol))
    return file


@pytest.fixture(autouse=True)
def clips(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ray-cast clips instead of worlds, which take seconds each."""
    made = [make_clip(FRAMES, SIZE, seed=seed, tracks=64) for seed in range(2)]
    opening = SimpleNamespace(open_clips=lambda loaded: ListedClips(made))
    monkeypatch.setitem(sys.modules, "diff4splat.evaluation.protocols.datasets", opening)


def test_an_untrained_model_is_measured_and_marked(
    protocol_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    Evaluate(model="test", protocol=str(protocol_file), out=out, items=1, steps=2).run()
    printed = capsys.readouterr().out
    assert "test (untrained)" in printed
    assert "stand-in" in printed
    assert "**subset**" in printed
    table = json.loads((out / "results.json").read_text())["table"]
    rows = {(cell["row"], cell["key"]) for cell in table}
    assert {
        ("system", "psnr"),
        ("nearest frame", "perceptual"),
        ("zero motion", "track_error"),
    } <= rows
    with Image.open(out / "items.png") as page:
        # Input, truth, answer, two depths and the best baseline side by side.
        assert page.size[0] == 60 + 6 * 232
    Evaluate(model="test", protocol=str(protocol_file), out=out, steps=2).run()
    assert "1 items were measured before" in capsys.readouterr().err


def test_text_is_asked_of_the_same_model(protocol_file: Path, tmp_path: Path) -> None:
    Evaluate(
        model="test", protocol=str(protocol_file), task="text", out=tmp_path / "out", steps=2
    ).run()
    stored = json.loads((tmp_path / "out" / "results.json").read_text())
    keys = {"text_right", "text_both", "text_still", "text_free", "text_absent"}
    # A random model moves nothing, so nothing can be torn.
    assert {cell["key"] for cell in stored["table"]} == keys | {"object_iou", "text_object"}


def test_the_newest_protocol_of_all_tasks_is_the_default() -> None:
    whole = [name for name in protocol_names() if name.startswith("held_out")]
    assert Evaluate().protocol == whole[-1]


@pytest.mark.parametrize("asked", [None, pytest.param(0, marks=pytest.mark.slow), 3])
def test_reconstruction_sees_the_whole_input_video(
    asked: int | None, protocol_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def reconstruct_clip(model: object, clip: object, settings: GenerationSettings) -> object:
        seen.append((clip.frames, len(clip.views), settings.photometric_steps))
        return wall_and_patch()

    monkeypatch.setattr(
        "diff4splat.evaluation.systems.evaluated_system.reconstruct_clip", reconstruct_clip
    )
    Evaluate(
        model="test",
        protocol=str(protocol_file),
        task="reconstruction",
        photometric_steps=asked,
        out=tmp_path / "out",
    ).run()
    steps = GenerationSettings().photometric_steps if asked is None else asked
    assert set(seen) == {(FRAMES, 1, steps)}


def test_another_size_is_asked_of_the_clips_too(
    protocol_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def clips(loaded: LoadedProtocol) -> ListedClips:
        asked.append(loaded.protocol.size_px)
        return ListedClips([make_clip(FRAMES, (16, 16), seed=s, tracks=64) for s in range(2)])

    opening = SimpleNamespace(open_clips=clips)
    monkeypatch.setitem(sys.modules, "diff4splat.evaluation.protocols.datasets", opening)
    out = tmp_path / "out"
    wanted = Evaluate(model="test", protocol=str(protocol_file), size=16, out=out, items=1, steps=1)
    wanted.run()
    assert asked == [(16, 16)]
    assert "tiny at 16 px" in (out / "results.md").read_text()


@pytest.mark.parametrize(
    ("change", "kind", "says"),
    [
        ({"protocol": "other"}, ConfigError, "expected held_out_v1"),
        ({"model": "huge"}, ConfigError, "expected test, small, paper, got 'huge'"),
        ({"items": 9}, InputError, "--items: expected 1 to 2"),
        ({"features": "squeeze"}, ConfigError, "perceptual features"),
        ({"steps": 0}, ConfigError, "--steps: expected 1"),
    ],
)
def test_bad_options_are_refused_in_one_line(
    protocol_file: Path, tmp_path: Path, change: dict[str, object], kind: type, says: str
) -> None:
    given = {"model": "test", "protocol": str(protocol_file), "out": tmp_path / "out"} | change
    with pytest.raises(kind, match=says):
        Evaluate(**given).run()
    assert not (tmp_path / "out").exists()


def test_the_generator_follows_the_clips_cameras_and_caption(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told: list[tuple[object, ...]] = []

    def listen(self: object, image: object, path: object, prompt: object, **rest: object) -> object:
        told.append((image, path, prompt, rest["seed"]))
        return wall_and_patch()

    monkeypatch.setattr(Diff4SplatPipeline, "__call__", listen)
    pipeline = Diff4SplatPipeline.from_pretrained("test")
    tiny = tiny_protocol(2)
    case = make_sample(make_clip(FRAMES, SIZE), replace(tiny, size_px=SIZE), "generation")
    Generator(pipeline=pipeline, settings=GenerationSettings(steps=2)).predict(case, 7)
    image, path, prompt, seed = told[0]
    assert (prompt, seed) == ("a box and a ball before a wall", 7)
    assert image.rgb.shape == (*SIZE, 3)
    truth = case.input_view.cameras.world_from_camera.float()
    assert path.cameras.world_from_camera.equal(truth)
    assert path.times_s.tolist() == pytest.approx(case.clip.times_s.tolist())


def test_settings_tell_results_apart() -> None:
    pipeline = Diff4SplatPipeline.from_pretrained("test")
    two, also_two, three = (
        Generator(pipeline=pipeline, settings=GenerationSettings(steps=steps)).identity
        for steps in (2, 2, 3)
    )
    assert two == also_two
    assert two != three
    assert two.untrained


def test_networks_of_a_user_and_rows_without_a_network(protocol_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    Evaluate(
        model="test",
        protocol=str(protocol_file),
        out=out,
        items=1,
        steps=1,
        seeds=2,
        clip=write_clip(tmp_path / "clip"),
        without=("video", "text"),
    ).run()
    stored = json.loads((out / "results.json").read_text())
    assert stored["videos"]["text"].startswith("CLIP (weights")
    keys = {cell["key"] for cell in stored["table"] if cell["row"] == "system"}
    assert {"clip_score", "frame_consistency", "diversity", "hidden_psnr"} <= keys
    page = (out / "results.md").read_text()
    assert page.index("| without text encoder |") < page.index("| without video model |")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"aesthetic": Path("head.pt")}, "--aesthetic: expected --clip"),
        ({"task": "reconstruction", "without": ("depth",)}, "--without: expected without --task"),
        ({"photometric_steps": 5}, "--photometric-steps: expected with --task reconstruction"),
    ],
)
def test_options_that_need_others_are_refused(change: dict[str, object], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        Evaluate(**change).check()


def test_the_command_line_reads_the_options() -> None:
    from diff4splat.cli.common.parser import parse

    command = parse(["eval", "--without", *NETWORKS, "all", "--seeds", "3"])
    assert (command.without, command.seeds) == ((*NETWORKS, "all"), 3)
