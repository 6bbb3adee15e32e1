"""Every network that a generation runs changes the scene; the others are neither read nor run."""

import json
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path

import pytest
import torch
from PIL import Image
from weight_folders import (
    Change,
    copied_folder,
    with_garbage,
    with_nan,
    with_noise,
    without_file,
)

from diff4splat.cli.main import run
from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.plan import WORSE_FILL, RequestFacts, plan_generation
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry.camera import pinhole
from diff4splat.models.config.model import Fill
from diff4splat.models.hub.weight_files import weights_sha256
from diff4splat.models.image_classifier import network as classifier
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Scene

SIDE_PX = 64
PROMPT = "the red box slides to the left"
OF_MOTION = frozenset({"motion_unet", "object_mask", "image_classifier", "object_shadow"})
PRIORS = OF_MOTION | {"text_encoder", "monocular_depth"}
VIDEO = frozenset({"vae", "dit", "ldrm", "deformation"})
SEES_NO_SMALL_IMAGE = "image_inpainting"
"""It runs for photographs alone: a test of its own."""
PARTS = sorted(PRIORS | VIDEO)
ALL_PARTS = sorted((*PARTS, SEES_NO_SMALL_IMAGE))


@dataclass(frozen=True, kw_only=True)
class Case:
    """A request, and the networks that it runs."""

    prompt: str | None
    parts: frozenset[str]
    fill: Fill | None = None
    still: bool = False
    path: str = "left:0.3"
    enlargement: int = 1
    """Of the image: above the copies that networks see it is a photograph."""
    without: tuple[str, ...] = ()

    @property
    def idle(self) -> frozenset[str]:
        return frozenset(ALL_PARTS) - self.parts


CASES = {
    "prompt": Case(prompt=PROMPT, parts=PRIORS),
    "no prompt": Case(prompt=None, parts=frozenset({"monocular_depth"})),
    "still": Case(prompt=PROMPT, parts=frozenset({"monocular_depth"}), still=True),
    "video": Case(prompt=PROMPT, parts=PRIORS | VIDEO, fill="video"),
    "video, no prompt": Case(
        prompt=None, parts=(VIDEO | {"monocular_depth"}) - {"deformation"}, fill="video"
    ),
    "video, still": Case(
        prompt=PROMPT,
        parts=(PRIORS | VIDEO) - OF_MOTION - {"deformation"},
        fill="video",
        still=True,
    ),
}
SEES_NO_BOX = "image_classifier"
"""It runs, but does not take a drawn box for one: a test of its own."""
RUNS = [
    (name, part)
    for name in ("prompt", "no prompt")
    for part in sorted(CASES[name].parts - {SEES_NO_BOX})
]
RUNS += [pytest.param("video", part, marks=pytest.mark.slow) for part in sorted(VIDEO)]
UNREAD = [(name, with_nan) for name in ("prompt", "no prompt", "still")]
UNREAD += [("no prompt", with_garbage), ("no prompt", without_file)]
UNREAD += [
    pytest.param(name, change, marks=pytest.mark.slow)
    for name, change in (
        ("prompt", with_garbage),
        ("prompt", without_file),
        *((name, with_nan) for name in CASES if CASES[name].fill and CASES[name].idle),
    )
]
AND_VIDEO = ["prompt", pytest.param("video", marks=pytest.mark.slow)]


def image(enlargement: int = 1) -> InputImage:
    """A red box in front of a gradient, with a shadow to its right."""
    y, x = torch.meshgrid(*(torch.linspace(0, 1, SIDE_PX),) * 2, indexing="ij")
    rgb = torch.stack([0.3 + 0.4 * x, 0.6 - 0.3 * y, 0.4 + 0.2 * x * y], -1)
    rgb[46:55, 30:60] *= 0.7  # Its shadow.
    rgb[36:52, 20:40] = torch.tensor([0.85, 0.15, 0.1])
    rgb[36:40, 20:40] = torch.tensor([0.95, 0.35, 0.3])
    rgb = rgb.repeat_interleave(enlargement, 0).repeat_interleave(enlargement, 1)
    camera = pinhole(float(len(rgb)), rgb.shape[:2])
    return InputImage(rgb=rgb, camera=camera, focal_source="test")


def generate(model: Path | str, case: Case, log: RunLog | None = None) -> Scene:
    settings = GenerationSettings(steps=2, fill=case.fill, still=case.still, without=case.without)
    pipeline = Diff4SplatPipeline.from_pretrained(model)
    return pipeline(image(case.enlargement), case.path, case.prompt, settings=settings, log=log)


@cache
def logged(case: Case) -> tuple[Scene, RunLog]:
    """With the weights as they are bundled."""
    log = RunLog()
    return generate("small", case, log), log


def expected(case: Case) -> Scene:
    return logged(case)[0]


def tensors(scene: Scene) -> list[torch.Tensor]:
    """Everything that a renderer reads of a scene."""
    gaussians = [getattr(scene.gaussians, field.name) for field in fields(Gaussians)]
    motion = scene.motion
    if not isinstance(motion, KeyframeMotion):
        return [*gaussians, torch.tensor(motion.time_range_s)]
    keys = (motion.key_times_s, motion.moving_index, motion.offsets)
    return [*gaussians, *keys, motion.rotations, motion.log_scale_offsets]


def same(left: Scene, right: Scene) -> bool:
    """Bit for bit."""
    pair = tensors(left), tensors(right)
    return len(pair[0]) == len(pair[1]) and all(map(torch.equal, *pair))


@pytest.mark.slow
def test_noise_in_the_image_classifier_changes_what_it_corrects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(classifier, "LEAST_PROBABILITY", 1e-9)
    folder = copied_folder(tmp_path / "model", [(SEES_NO_BOX, with_noise)])
    assert not same(generate(folder, CASES["prompt"]), generate("small", CASES["prompt"]))


def test_the_image_inpainting_fills_a_photograph(tmp_path: Path) -> None:
    case = Case(prompt=None, parts=frozenset(), enlargement=3)
    plain, log = logged(case)
    assert SEES_NO_SMALL_IMAGE in log.networks
    folder = copied_folder(tmp_path / "model", [(SEES_NO_SMALL_IMAGE, with_noise)])
    others = (
        generate(folder, case),
        generate("small", replace(case, without=(SEES_NO_SMALL_IMAGE,))),
    )
    for other in others:
        # What the image shows is as before; what it hides has other colours in the same places.
        assert torch.equal(other.gaussians.means, plain.gaussians.means)
        assert not same(other, plain)
        assert all(bool(value.isfinite().all()) for value in tensors(other))


@pytest.mark.parametrize(("name", "part"), RUNS)
def test_noise_in_any_network_that_runs_changes_the_scene(
    name: str, part: str, tmp_path: Path
) -> None:
    folder = copied_folder(tmp_path / "model", [(part, with_noise)])
    changed = generate(folder, CASES[name])
    assert not same(changed, expected(CASES[name]))
    assert changed.provenance.weights_sha256 != expected(CASES[name]).provenance.weights_sha256


@pytest.mark.parametrize(
    "part",
    [
        *sorted(PRIORS - {SEES_NO_BOX}),
        *(pytest.param(part, marks=pytest.mark.slow) for part in sorted(VIDEO)),
    ],
)
def test_any_network_can_be_left_out_and_changes_the_scene(part: str) -> None:
    whole = CASES["prompt" if part in PRIORS else "video"]
    log = RunLog()
    scene = generate("small", replace(whole, without=(part,)), log)
    assert part not in log.networks
    assert not same(scene, expected(whole))
    assert all(bool(value.isfinite().all()) for value in tensors(scene))


@pytest.mark.parametrize(("name", "change"), UNREAD)
def test_networks_that_do_not_run_are_not_read(name: str, change: Change, tmp_path: Path) -> None:
    case = CASES[name]
    folder = copied_folder(tmp_path / "model", [(part, change) for part in case.idle])
    scene = generate(folder, case)
    assert same(scene, expected(case))
    assert scene.provenance == expected(case).provenance
    assert scene.provenance.weights_sha256 == weights_sha256(folder, case.parts)


@pytest.mark.parametrize(
    "change",
    [
        with_nan,
        *(pytest.param(one, marks=pytest.mark.slow) for one in (with_garbage, without_file)),
    ],
)
@pytest.mark.parametrize("part", PARTS)
def test_networks_that_run_are_read(part: str, change: Change, tmp_path: Path) -> None:
    folder = copied_folder(tmp_path / "model", [(part, change)])
    with pytest.raises((CheckpointError, FileFormatError), match=part):
        generate(folder, CASES["video"])


@pytest.mark.parametrize(
    "name",
    [
        *(name for name in CASES if not CASES[name].fill or name == "video"),
        pytest.param("video, no prompt", marks=pytest.mark.slow),
        pytest.param("video, still", marks=pytest.mark.slow),
    ],
)
def test_scenes_are_finite(name: str) -> None:
    assert all(bool(value.isfinite().all()) for value in tensors(expected(CASES[name])))


@pytest.mark.parametrize("name", AND_VIDEO)
def test_scenes_repeat_bit_for_bit(name: str) -> None:
    assert same(generate("small", CASES[name]), expected(CASES[name]))


def test_the_prompt_moves_the_scene() -> None:
    assert isinstance(expected(CASES["prompt"]).motion, KeyframeMotion)
    for still in ("no prompt", "still"):
        assert not isinstance(expected(CASES[still]).motion, KeyframeMotion)
        assert not same(expected(CASES["prompt"]), expected(CASES[still]))


@pytest.mark.parametrize("name", AND_VIDEO)
def test_two_prompts_give_two_scenes_and_two_fills(name: str) -> None:
    case = CASES[name]
    other = replace(case, prompt="the red box rises and the camera stays")
    assert not same(expected(other), expected(case))


def fill_of(case: Case) -> torch.Tensor:
    """What the fill adds: Gaussians whose means are not those of the layered image."""
    layered = Case(prompt=case.prompt, parts=case.parts - VIDEO, path=case.path)
    known = {tuple(mean) for mean in expected(layered).gaussians.means.tolist()}
    means = expected(case).gaussians.means
    added = torch.tensor([tuple(mean) not in known for mean in means.tolist()])
    return means[added]


@pytest.mark.slow
def test_the_fill_follows_the_camera_path_and_the_prompt() -> None:
    case = CASES["video"]
    paths = [
        Case(prompt=PROMPT, parts=case.parts, fill="video", path=p) for p in ("right:0.3", "up:0.3")
    ]
    fills = [fill_of(one) for one in (case, *paths, CASES["video, no prompt"])]
    assert all(len(fill) > 0 for fill in fills)
    for index, fill in enumerate(fills):
        for other in fills[:index]:
            assert not torch.equal(fill, other)


def test_without_a_fill_the_path_changes_no_gaussian() -> None:
    case = CASES["prompt"]
    other = expected(Case(prompt=PROMPT, parts=case.parts, path="right:0.3"))
    for field in fields(Gaussians):
        left, right = (getattr(scene.gaussians, field.name) for scene in (other, expected(case)))
        assert torch.equal(left, right)


@pytest.mark.parametrize("name", CASES)
def test_the_log_lists_exactly_the_networks_that_were_left_out(name: str) -> None:
    case = CASES[name]
    skipped = [entry for entry in logged(case)[1].skipped if entry.what in ALL_PARTS]
    assert sorted(entry.what for entry in skipped) == sorted(case.idle)
    would_differ = case.idle & VIDEO if case.fill is None else frozenset()
    assert {entry.what for entry in skipped if entry.error is None} == would_differ
    assert {entry.error for entry in skipped if entry.what not in would_differ} <= {0.0}


def test_the_card_lists_them_too(tmp_path: Path) -> None:
    file, out = tmp_path / "image.png", tmp_path / "scene"
    Image.fromarray((image().rgb * 255).byte().numpy()).save(file)
    arguments = ["generate", str(file), "--out", str(out), "--resolution", str(SIDE_PX)]
    assert run([*arguments, "--camera", "arc:0.4", "--frames", "2", "--skip-depth"]) == 0
    card = json.loads((out / "card.json").read_text())
    facts = RequestFacts(prompt=False)
    pipeline = Diff4SplatPipeline.from_pretrained("small")
    plan = plan_generation(pipeline.model.config, pipeline.model.trained, facts)
    listed = {entry["what"]: entry for entry in card["left_out"] if entry["what"] in ALL_PARTS}
    assert {part: entry["why"] for part, entry in listed.items()} == {
        skipped.part: skipped.why for skipped in plan.skipped
    }
    assert {part for part, entry in listed.items() if entry["error"] is None} == VIDEO
    assert {entry["why"] for part, entry in listed.items() if part in VIDEO} == {WORSE_FILL}
    assert not card["untrained"]
