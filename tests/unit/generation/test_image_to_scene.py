"""The picture alone, moved as the motion branch says: what runs, what does not, where things go."""

import math
from dataclasses import replace

import pytest
import torch

from diff4splat.errors import ConfigError
from diff4splat.flow.guidance import CallCount, Guidance
from diff4splat.generation import image_to_scene as moved_picture
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.layered_image.rigid_components import MIN_RELATIVE_DISPLACEMENT
from diff4splat.generation.motion_sampling import (
    MotionRequest,
    MotionSample,
    bilateral_smooth,
    sample_motion,
)
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.reconstruction import Canonical
from diff4splat.generation.settings import GenerationSettings, MotionSettings
from diff4splat.geometry.camera import pinhole
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.pretrained import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.motion_unet.motion_field import UNIT
from diff4splat.models.motion_unet.unet import MotionUNet
from diff4splat.models.video_dit.dit import VideoDiT
from diff4splat.progress.run_log import RunLog

SIDE_PX = 32


@pytest.fixture
def model() -> Model:
    config = tiny_size()
    dit = replace(config.dit, draft=True, motion=True, motion_width=8)
    config = replace(config, dit=dit)
    return Model(config=config, networks=create_networks(config))


def picture() -> InputImage:
    torch.manual_seed(0)
    return InputImage(
        rgb=torch.rand(SIDE_PX, SIDE_PX, 3),
        camera=pinhole(40.0, (SIDE_PX, SIDE_PX)),
        focal_source="test",
    )


def says(model: Model, right: float) -> MotionUNet:
    """The branch answers that everything goes to the right by so many units."""
    branch = model.networks.dit.motion_branch
    with torch.no_grad():
        branch.head.bias[0] = right
        branch.moves.bias.fill_(5.0)
    return branch


def left_out(log: RunLog) -> set[str]:
    return {omission.what for omission in log.skipped}


def wish(text: bool = False, seed: int = 0, **changes: object) -> MotionRequest:
    torch.manual_seed(3)
    states = torch.randn(1, 4, tiny_size().text.width) if text else None
    return MotionRequest(
        text=states, seed=seed, settings=GenerationSettings(motion=MotionSettings(**changes))
    )


def test_the_video_is_neither_drafted_nor_sampled(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*given: object) -> None:
        raise AssertionError("called")

    monkeypatch.setattr(VideoDiT, "velocity", never)
    log = RunLog()
    scene = Diff4SplatPipeline(model)(picture(), "arc", "a ball rolls", log=log)
    assert "sampled video" in left_out(log)
    assert len(scene.gaussians) == SIDE_PX**2


def test_the_sampled_video_is_still_to_be_had(model: Model) -> None:
    log = RunLog()
    settings = GenerationSettings(pictures="sampled", steps=2)
    Diff4SplatPipeline(model)(picture(), "arc", settings=settings, log=log)
    assert "sampled video" not in left_out(log)


def test_everything_goes_where_the_branch_says(model: Model) -> None:
    says(model, 3.0)
    scene = Diff4SplatPipeline(model)(picture(), "arc")
    first, last = scene.motion.time_range_s
    way = scene.state_at(last).means - scene.state_at(first).means
    torch.testing.assert_close(way[:, 0], torch.full_like(way[:, 0], 3 * UNIT * PLANE_DEPTH))
    assert float(way[:, 1:].abs().max()) < 1e-4


def test_a_fresh_branch_moves_nothing(model: Model) -> None:
    scene = Diff4SplatPipeline(model)(picture(), "arc")
    first, last = scene.motion.time_range_s
    assert torch.equal(scene.state_at(last).means, scene.state_at(first).means)


def test_what_is_not_likely_to_move_stands(model: Model) -> None:
    branch = says(model, 3.0)
    for likely, moving in ((0.05, 0), (0.3, SIDE_PX**2), (0.9, SIDE_PX**2)):
        with torch.no_grad():
            branch.moves.bias.fill_(math.log(likely / (1 - likely)))
        scene = Diff4SplatPipeline(model)(picture(), "arc")
        assert len(scene.motion.moving_index) == moving


def test_the_likeliest_moves_where_nothing_is_likely() -> None:
    moves = torch.tensor([[0.05, 0.2], [0.3, 0.14]])
    none = torch.zeros(3, 2, 1, 1)
    made = MotionSample(field=none, moves=moves, calls=CallCount())
    assert made.moving(0.5).tolist() == [[False, True], [True, False]]
    assert made.moving(0.1).tolist() == [[False, True], [True, True]]
    assert not MotionSample(field=none, moves=0 * moves, calls=CallCount()).moving(0.3).any()
    sure = MotionSample(field=none, moves=moves + 0.6, calls=CallCount())
    assert sure.moving(0.5).all()


@pytest.mark.parametrize(("second", "goes"), [(0.39, False), (0.41, True)])
def test_a_thing_moves_where_some_of_it_is_likely_to(second: float, goes: bool) -> None:
    moves = torch.full((6, 9), 0.2)
    moves[1:3, 1:4] = torch.tensor([[0.4, 0.5, 0.35], [0.4, 0.95, 0.4]])
    moves[2:5, 6:8] = torch.tensor([[0.35, 0.31], [0.38, second], [0.29, 0.35]])
    made = MotionSample(field=torch.zeros(3, 2, 1, 1), moves=moves, calls=CallCount())
    wanted = moves > 0.3
    wanted[:, 5:] &= goes
    assert torch.equal(made.moving(0.3), wanted)


def test_alone_the_likeliest_thing_moves_whole() -> None:
    moves = torch.zeros(6, 9)
    moves[1:3, 1:4], moves[1, 1], moves[4:, 6:] = 0.32, 0.38, 0.36
    made = MotionSample(field=torch.zeros(3, 2, 1, 1), moves=moves, calls=CallCount())
    wanted = torch.zeros(6, 9, dtype=torch.bool)
    wanted[1:3, 1:4] = True
    assert torch.equal(made.moving(0.3), wanted)


def test_motion_begins_at_nothing_and_ends_at_the_answer(model: Model) -> None:
    made = sample_motion(says(model, 2.0), picture(), 3, wish())
    field = made.field
    assert field.shape == (3, 3, SIDE_PX // 4, SIDE_PX // 4)
    assert not field[:, 0].any()
    torch.testing.assert_close(field[0, 1:], torch.full_like(field[0, 1:], 2.0))
    assert made.moves.shape == (SIDE_PX, SIDE_PX)
    assert float(made.moves.detach().min()) > 0.99
    assert made.calls.conditional == 0 < made.calls.unconditional


def test_seeds_decide_and_repeat(model: Model) -> None:
    branch = model.networks.dit.motion_branch
    torch.nn.init.normal_(branch.head.weight)
    made = [sample_motion(branch, picture(), 2, wish(seed=seed)).field for seed in (0, 1, 0)]
    assert torch.equal(made[0], made[2])
    assert not torch.allclose(made[0], made[1])


@pytest.mark.parametrize(("weight", "passes"), [(1.0, (8, 0)), (3.0, (8, 8)), (0.0, (0, 8))])
def test_guidance_asks_the_branches_that_it_needs(
    model: Model, weight: float, passes: tuple[int, int]
) -> None:
    asked = wish(text=True, guidance=Guidance(weight=weight), steps=8)
    calls = sample_motion(model.networks.dit.motion_branch, picture(), 2, asked).calls
    assert (calls.conditional, calls.unconditional) == passes


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"steps": 0}, "--steps: expected 1 to 1000, got 0"),
        ({"shift": 0.0}, "shift"),
        ({"moves_above": 1.5}, "moves_above: expected 0 to 1, got 1.5"),
        ({"moves_above": float("nan")}, "moves_above: expected 0 to 1"),
    ],
)
def test_settings_that_cannot_be(changes: dict, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        MotionSettings(**changes)


def test_likelihoods_are_shared_within_a_colour_and_not_across() -> None:
    rgb = torch.zeros(1, 3, SIDE_PX, SIDE_PX)
    rgb[..., 16:] = 1.0
    moves = torch.zeros(1, SIDE_PX, SIDE_PX)
    moves[:, :, 12:16] = 1.0
    shared = bilateral_smooth(moves, rgb)
    assert float(shared[0, 16, 10]) > 0.1
    assert float(shared[0, :, 16:].max()) < 1e-3
    flat = torch.full((1, SIDE_PX, SIDE_PX), 0.4)
    torch.testing.assert_close(bilateral_smooth(flat, torch.rand(1, 3, SIDE_PX, SIDE_PX)), flat)


def test_what_stands_behind_what_goes_is_part_of_the_scene(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    says(model, right=2.0)
    asked: list[torch.Tensor] = []

    def faint(canonical: Canonical, moving: torch.Tensor, seen: InputImage) -> Canonical:
        asked.append(moving)
        assert seen.camera.size_px == moving.shape
        half = torch.full_like(canonical.gaussians.opacities, 0.5)
        return replace(canonical, gaussians=replace(canonical.gaussians, opacities=half))

    monkeypatch.setattr(moved_picture, "inpaint_disoccluded", faint)
    scene = Diff4SplatPipeline(model)(picture(), "arc", "a ball rolls")
    assert len(asked) == 1 and bool(asked[0].all())
    assert bool((scene.gaussians.opacities == 0.5).all())


def test_nothing_is_uncovered_by_what_hardly_goes(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []

    def note(canonical: Canonical, goes: torch.Tensor, seen: InputImage) -> Canonical:
        del seen
        asked.append(bool(goes.any()))
        return canonical

    monkeypatch.setattr(moved_picture, "inpaint_disoccluded", note)
    for way in (0.9 * MIN_RELATIVE_DISPLACEMENT, 1.1 * MIN_RELATIVE_DISPLACEMENT):
        says(model, right=way / UNIT)
        scene = Diff4SplatPipeline(model)(picture(), "arc", "a ball rolls")
        assert bool(len(scene.motion.moving_index)) is asked[-1]
    assert asked == [False, True]
