"""Camera steps recovered from images of a scene, along a known path."""

from dataclasses import replace

import pytest
import torch
from oracles_evaluation import SIZE, as_scene, slab, wall_and_patch

from diff4splat.evaluation.measures.camera_poses import (
    path_errors,
    pose_entries,
    recover_step,
    rendered_frames,
    step_errors,
)
from diff4splat.geometry.camera import pinhole
from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.settings import PathFrame, PathSettings
from diff4splat.render.api import render_video
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return wall_and_patch(step=0.12)


def path(text: str, frames: int = 4) -> CameraPath:
    camera = pinhole(40.0, SIZE).resized((128, 160))
    view = PathFrame(camera=camera, near_depth=4.0, focus_depth=4.0)
    return build_path(text, view, PathSettings(frames=frames, fps=3.0, easing="linear"))


@pytest.mark.parametrize("text", ["right:0.1", "forward:0.15", "arc:0.15", "roll:0.03"])
def test_a_textured_scene_gives_its_path_back(scene: Scene, text: str) -> None:
    errors = step_errors(rendered_frames(scene, path(text)), path(text))
    assert errors.failed == 0
    assert min(errors.matches) >= 12
    assert max(errors.translation) < 0.08
    assert max(errors.rotation_deg) < 1.2


def test_a_camera_that_stands_is_found_standing(scene: Scene) -> None:
    errors = step_errors(rendered_frames(scene, path("static", 3)), path("static", 3))
    assert errors.failed == 0
    assert max(errors.translation) < 1e-3
    assert max(errors.rotation_deg) < 1e-2


def test_the_recovered_step_is_the_true_one_and_not_its_inverse(scene: Scene) -> None:
    along = path("right:0.1", 3)
    frames = list(render_video(scene, along, outputs=("rgb", "depth")))
    step = recover_step(frames[0], frames[1], (along.cameras[0], along.cameras[1]))
    # The second camera is 0.2 to the right, so points move to its left.
    assert torch.allclose(step.pose[:3, 3], torch.tensor([-0.2, 0, 0]).double(), atol=0.03)


def test_images_that_do_not_follow_their_cameras_show_an_error(scene: Scene) -> None:
    walked, claimed = path("right:0.1"), path("left:0.1")
    frames = list(render_video(scene, walked, outputs=("rgb", "depth")))
    pair = (claimed.cameras[0], claimed.cameras[1])
    step = recover_step(frames[0], frames[1], pair)
    true = pair[1].camera_from_world.double() @ pair[0].world_from_camera.double()
    assert float((step.pose[:3, 3] - true[:3, 3]).norm()) == pytest.approx(0.8 / 3, abs=0.03)


def test_blank_images_fail_and_are_counted(scene: Scene) -> None:
    grey = slab(4.0, (4.0, 3.2), 0.16, 1)
    grey = replace(grey, sh=torch.zeros_like(grey.sh))
    blank = as_scene(grey, StaticMotion())
    errors = step_errors(rendered_frames(blank, path("right:0.1")), path("right:0.1"))
    assert (errors.failed, errors.matches) == (3, (0, 0, 0))
    entries = {entry.key: entry for entry in pose_entries("row", blank, path("right:0.1"))}
    assert entries["pose_failed"].value == 1
    assert entries["pose_translation"].why
    assert entries["camera_failed"].value == 1


@pytest.mark.parametrize("text", ["right:0.1", "arc:0.15"])
def test_every_frame_stands_where_the_path_asked_for_it(scene: Scene, text: str) -> None:
    errors = path_errors(rendered_frames(scene, path(text)), path(text))
    assert errors.failed == 0
    # An arc ends where it starts.
    assert len(errors.relative) == (2 if text.startswith("arc") else 3)
    assert max(errors.relative) < 0.15
    assert max(errors.rotation_deg) < 1.5


def test_images_of_half_the_path_are_half_of_it_wrong(scene: Scene) -> None:
    frames = rendered_frames(scene, path("right:0.05"))
    errors = path_errors(frames, path("right:0.1"))
    assert sum(errors.relative) / 3 == pytest.approx(0.5, abs=0.08)


def test_a_camera_that_stands_has_no_relative_translation(scene: Scene) -> None:
    assert path_errors(rendered_frames(scene, path("static", 3)), path("static", 3)).relative == ()


def test_a_path_of_which_only_its_return_is_recovered_has_no_relative_error(scene: Scene) -> None:
    along = path("arc:0.15")
    frames = rendered_frames(scene, along)
    grey = replace(frames[1], rgb=torch.full_like(frames[1].rgb, 0.5))
    errors = path_errors([frames[0], grey, grey, frames[3]], along)
    assert (errors.failed, errors.relative) == (2, ())
