"""A true video with its cameras to a scene."""

from dataclasses import replace

import pytest
import torch
from image_layers import FOCAL_PX, sliding_path

from diff4splat.errors import InputError, ShapeError
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.photometric_steps import Frames, video_error
from diff4splat.generation.video.video_to_gaussians import VideoLatent, posed_video
from diff4splat.generation.video.video_to_scene import scene_from_video
from diff4splat.geometry.camera import pinhole
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.hub.model import Model, with_parts
from diff4splat.models.networks import reconstruction_parts
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.static import StaticMotion

SIDE_PX, FRAMES = 32, 5
EVERYTHING = GenerationSettings(min_opacity=0.0)


def video(frames: int = FRAMES) -> torch.Tensor:
    return torch.rand(frames, SIDE_PX, SIDE_PX, 3)


def path(frames: int = FRAMES) -> CameraPath:
    return sliding_path(pinhole(FOCAL_PX, (SIDE_PX, SIDE_PX)), frames, (0.1, 0.0, 0.0))


def model(name: str = "test") -> Model:
    return Model(config=size_by_name(name))


@pytest.mark.parametrize("name", ["test", "small"])
def test_a_fresh_model_shows_the_video_on_planes_and_is_static(name: str) -> None:
    scene = scene_from_video(model(name), video(), path(), EVERYTHING)
    assert isinstance(scene.motion, StaticMotion)
    assert scene.provenance.untrained and scene.provenance.weights_sha256 == "none"
    assert scene.path.times_s.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert bool(scene.gaussians.means.isfinite().all())
    if name == "test":
        assert len(scene.gaussians) == FRAMES * SIDE_PX**2


def test_only_what_reconstructs_is_loaded_and_the_video_model_is_not() -> None:
    log = RunLog()
    whole = model()
    scene_from_video(whole, video(), path(), EVERYTHING, log)
    assert whole.loaded == frozenset()
    assert "sample video" not in log.phases.seconds
    trained = replace(whole, trained=frozenset({"vae", "ldrm", "deformation"}))
    assert not scene_from_video(trained, video(), path(), EVERYTHING).provenance.untrained


def test_a_true_video_is_not_decoded() -> None:
    log, shown = RunLog(), video()
    known = with_parts(model("small"), reconstruction_parts(model("small").config))
    scene_from_video(known, shown, path(), EVERYTHING, log)
    assert "video decoder" in {record.what for record in log.skipped}
    cameras, frames = path().cameras, known.config.latent_grid(FRAMES, (SIDE_PX, SIDE_PX))
    first = InputImage(rgb=shown[0], camera=cameras[0], focal_source="video")
    latent = torch.zeros(1, known.config.vae.latent_channels, *frames)
    given = VideoLatent(latent=latent, first_frame=first, cameras=cameras, frames=shown)
    assert torch.equal(posed_video(known, given).rgb[0].movedim(0, -1), shown)
    generated = posed_video(known, replace(given, frames=None)).rgb[0].movedim(0, -1)
    assert torch.equal(generated[0], shown[0]) and not torch.equal(generated[1:], shown[1:])


def test_equal_videos_give_equal_scenes() -> None:
    shown = video()
    left, right = (scene_from_video(model(), shown, path(), EVERYTHING) for _ in range(2))
    assert torch.equal(left.gaussians.sh, right.gaussians.sh)
    other = scene_from_video(model(), 1 - shown, path(), EVERYTHING)
    assert not torch.equal(left.gaussians.sh, other.gaussians.sh)


@pytest.mark.parametrize("name", ["test", "small"])
def test_photometric_steps_bring_the_scene_nearer_to_the_video(name: str) -> None:
    """Of frames that look alike; the cameras count from the first one, wherever that is."""
    shown = video()[:1].expand(FRAMES, -1, -1, -1)
    turned = path()
    moved = turned.cameras.world_from_camera.clone()
    moved[:, 1, 3] += 3.0
    turned = replace(turned, cameras=turned.cameras.with_pose(moved))
    errors = []
    for steps in (0, 10):
        settings = replace(EVERYTHING, photometric_steps=steps)
        scene = scene_from_video(model(name), shown, turned, settings)
        frames = Frames(rgb=shown, path=path())
        errors.append(video_error(scene, frames))
    assert errors[1] < 0.9 * errors[0]


def test_frames_and_cameras_must_fit() -> None:
    with pytest.raises(ShapeError, match="expected 5 cameras"):
        scene_from_video(model(), video(), path(4))
    with pytest.raises(InputError, match="1 \\+ 4 k"):
        scene_from_video(model(), video(4), path(4))
