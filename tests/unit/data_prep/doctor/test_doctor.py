"""The doctor calls sound copies sound, and names the mistake of a wrong reader."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from toy_datasets import TOYS

from diff4splat.data.clip import View
from diff4splat.data_prep.doctor import causes, examination
from diff4splat.data_prep.doctor.examination import DoctorJob, Findings, examine, table, verdict
from diff4splat.data_prep.doctor.overview import draw_examined
from diff4splat.errors import InputError
from diff4splat.geometry import rigid
from diff4splat.progress.phases import Phases

MISTAKES = [
    ("dynamic_replica", causes._posed(causes._opengl), "OpenGL cameras"),
    ("dynamic_replica", causes._posed(rigid.invert), "poses are inverted"),
    ("dynamic_replica", causes._posed(causes._transposed), "rotations are transposed"),
    ("dynamic_replica", causes._scaled(100.0), "depth is 100 times too large"),
    ("dynamic_replica", causes._scaled(0.001), "depth is 1000 times too small"),
    ("dynamic_replica", causes._shifted(-0.5), "half a pixel too far left and up"),
    ("dynamic_replica", causes._late(1), "one frame late"),
    ("dynamic_replica", causes._flowed(lambda flow: flow.flip(-1)), "y stands before x"),
    ("spring", causes._flowed(lambda flow: 2 * flow), "flow is twice as long"),
    ("spring", causes._flowed(lambda flow: -flow), "flow is backwards"),
    ("realestate10k", causes._posed(rigid.invert), "poses are inverted"),
    ("multicam_video", causes._posed(causes._opengl), "OpenGL cameras"),
]


@pytest.fixture(scope="module")
def copies(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("copies")
    for name, toy in TOYS.items():
        toy.write(toy.truth(), root / name)
    return root


def examined(name: str, copies: Path) -> Findings:
    return examine(DoctorJob(root=copies / name, dataset=TOYS[name].dataset), Phases())


@pytest.mark.parametrize("name", TOYS)
def test_sound_copies_are_sound(name: str, copies: Path) -> None:
    findings = examined(name, copies)
    assert findings.is_sound, table(findings)
    assert "| ok |" in table(findings)
    assert "WRONG" not in table(findings)


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize(("name", "mistake", "says"), MISTAKES, ids=[m[2] for m in MISTAKES])
def test_the_mistake_is_named(
    name: str,
    mistake: Callable[[View], View],
    says: str,
    copies: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    as_read = examination._in_its_world

    def wrongly(clip, listed):
        clip = as_read(clip, listed)
        return replace(clip, views=tuple(mistake(view) for view in clip.views))

    monkeypatch.setattr(examination, "_in_its_world", wrongly)
    findings = examined(name, copies)
    assert not findings.is_sound
    text = table(findings)
    assert f"likely cause: {says}" in text or says in findings.worst.cause.text, text
    assert "WRONG" in text and "with it undone" in text
    assert verdict(findings).startswith("wrong: ")


def test_the_picture_changes_with_what_is_wrong(
    copies: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sound = examined("dynamic_replica", copies)
    good = draw_examined(sound.worst, verdict(sound))
    as_read = examination._in_its_world
    flipped = causes._posed(causes._opengl)
    monkeypatch.setattr(
        examination,
        "_in_its_world",
        lambda clip, listed: replace(
            (read := as_read(clip, listed)), views=tuple(flipped(view) for view in read.views)
        ),
    )
    wrong = examined("dynamic_replica", copies)
    bad = draw_examined(wrong.worst, verdict(wrong))
    assert good.shape == bad.shape and good.shape[1] == 1400
    red = torch.tensor([255.0, 112, 96]) / 255
    share = [float(((image - red).abs().amax(-1) < 0.02).float().mean()) for image in (good, bad)]
    assert share[1] > 5 * share[0]


@pytest.mark.parametrize("name", ["multicam_video", "stereo4d", "matrixcity half"])
def test_pictures_of_what_lacks_depth_flow_or_tracks(name: str, copies: Path) -> None:
    findings = examined(name, copies)
    assert bool(draw_examined(findings.worst, verdict(findings)).isfinite().all())


def test_what_cannot_be_read_is_in_the_table(tmp_path: Path) -> None:
    toy = TOYS["spring"]
    toy.write(toy.truth(), tmp_path)
    next(tmp_path.rglob("disp1_left_0002.dsp5")).write_bytes(b"no")
    findings = examine(DoctorJob(root=tmp_path, dataset="spring"), Phases())
    assert not findings.is_sound
    assert "not readable: " in table(findings) and "disp1_left_0002.dsp5" in table(findings)
    assert verdict(findings) == "not readable: no sequence could be examined"


def test_no_such_copy(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a copy of Spring, got no such folder"):
        examine(DoctorJob(root=tmp_path / "gone", dataset="spring"), Phases())


def test_a_camera_that_stands_still_proves_little(tmp_path: Path) -> None:
    toy = TOYS["realestate10k"]
    truth = toy.truth()
    still = replace(truth.left, poses=truth.left.poses[[0, 0, 0, 0]])
    toy.write(replace(truth, eyes=(still,)), tmp_path)
    findings = examine(DoctorJob(root=tmp_path, dataset="realestate10k"), Phases())
    assert "the camera hardly moves: wrong poses would not show" in table(findings)
