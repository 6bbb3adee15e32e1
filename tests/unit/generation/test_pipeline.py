"""The pipeline with random weights at ``test`` size: seeds, prompts, motion, saving, paths."""

from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch

from diff4splat.errors import CheckpointError, ConfigError, InputError
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video_sampling import Conditions, initial_noise
from diff4splat.geometry.camera import pinhole
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

QUICK = GenerationSettings(steps=2)


@pytest.fixture
def picture() -> InputImage:
    return InputImage(
        rgb=torch.rand(32, 32, 3), camera=pinhole(30.0, (32, 32)), focal_source="test"
    )


@pytest.fixture
def pipeline() -> Diff4SplatPipeline:
    return Diff4SplatPipeline.from_pretrained("test")


def randomize(pipeline: Diff4SplatPipeline, part: str, scale: float = 0.3) -> None:
    """Give the zero-initialised layers of a network random weights, as training would."""
    generator = torch.Generator().manual_seed(5)
    for parameter in getattr(pipeline.model.networks, part).parameters():
        if not bool(parameter.any()):
            parameter.data = scale * torch.randn(parameter.shape, generator=generator)


def assert_same_scene(left: Scene, right: Scene) -> None:
    for field in fields(Gaussians):
        assert torch.equal(
            getattr(left.gaussians, field.name), getattr(right.gaussians, field.name)
        )
    assert type(left.motion) is type(right.motion)
    for time_s in (0.0, 0.4, 1.3):
        assert torch.equal(left.state_at(time_s).means, right.state_at(time_s).means)


def test_an_untrained_scene_says_so_and_stands_still(
    pipeline: Diff4SplatPipeline, picture: InputImage
) -> None:
    scene = pipeline(picture, "spiral", settings=QUICK)
    assert scene.provenance.untrained
    assert scene.provenance.model == "test"
    assert isinstance(scene.motion, StaticMotion)
    assert len(scene.gaussians) == 32 * 32
    assert torch.equal(scene.path.cameras.world_from_camera[0], torch.eye(4))


def test_equal_seeds_give_equal_bits_and_other_seeds_do_not(
    pipeline: Diff4SplatPipeline, picture: InputImage
) -> None:
    for part in ("dit", "ldrm", "deformation"):
        randomize(pipeline, part)
    torch.rand(3)
    first = pipeline(picture, "arc", seed=1, settings=QUICK)
    torch.rand(7)
    assert_same_scene(first, pipeline(picture, "arc", seed=1, settings=QUICK))
    other = pipeline(picture, "arc", seed=2, settings=QUICK)
    assert len(other.gaussians) != len(first.gaussians) or not torch.equal(
        other.gaussians.means, first.gaussians.means
    )


def test_random_heads_move_and_the_file_keeps_the_motion(
    pipeline: Diff4SplatPipeline, picture: InputImage, tmp_path: Path
) -> None:
    randomize(pipeline, "deformation", 0.05)
    scene = pipeline(picture, "forward", settings=QUICK)
    assert isinstance(scene.motion, KeyframeMotion)
    assert len(scene.motion.moving_index) > 100
    assert scene.motion.time_range_s == (0.0, 2.0)
    moved = scene.state_at(1.0).means - scene.gaussians.means
    assert float(moved.abs().max()) > 0.01
    save_scene(scene, tmp_path / "scene.safetensors")
    assert_same_scene(scene, load_scene(tmp_path / "scene.safetensors"))


def test_gaussians_that_hardly_move_store_no_keys(
    pipeline: Diff4SplatPipeline, picture: InputImage
) -> None:
    randomize(pipeline, "deformation", 0.05)
    log = RunLog()
    generous = replace(QUICK, still_px=50.0)
    trimmed = pipeline(picture, "forward", settings=generous, log=log)
    strict = pipeline(picture, "forward", settings=replace(QUICK, still_px=0.0))
    assert len(trimmed.motion.moving_index) < len(strict.motion.moving_index)
    assert "key times of still Gaussians" in {omission.what for omission in log.skipped}


def test_a_prompt_changes_the_scene_and_builds_the_text_encoder(
    pipeline: Diff4SplatPipeline, picture: InputImage
) -> None:
    for part in ("dit", "ldrm"):
        randomize(pipeline, part)
    plain_log, log = RunLog(), RunLog()
    plain = pipeline(picture, "arc", settings=QUICK, log=plain_log)
    told = pipeline(picture, "arc", "a red ball rolls", settings=QUICK, log=log)
    assert not torch.equal(plain.gaussians.sh[:50], told.gaussians.sh[:50])
    assert "text encoder" in {omission.what for omission in plain_log.skipped}
    assert "text encoder" not in {omission.what for omission in log.skipped}
    assert told.provenance.prompt == "a red ball rolls"


def test_the_image_latent_survives_sampling_unchanged(
    pipeline: Diff4SplatPipeline, picture: InputImage
) -> None:
    from diff4splat.generation.video_sampling import sample_video

    randomize(pipeline, "dit")
    image = torch.randn(1, 4, 1, 4, 4)
    conditions = Conditions(image_latent=image, plucker=torch.randn(1, 6, 5, 32, 32), text=None)
    with torch.no_grad():
        video = sample_video(pipeline.model.networks.dit, conditions, QUICK, seed=0)
    torch.testing.assert_close(video.latent[:, :, :1], image)
    start = initial_noise(conditions, 0)
    assert not torch.allclose(video.latent[:, :, 1:], start[:, :, 1:])


def test_saved_and_loaded_pipelines_agree(
    pipeline: Diff4SplatPipeline, picture: InputImage, tmp_path: Path
) -> None:
    for part in ("dit", "ldrm"):
        randomize(pipeline, part)
    pipeline.save_pretrained(tmp_path / "model")
    again = Diff4SplatPipeline.from_pretrained(tmp_path / "model")
    assert again.model.untrained
    assert len(again.model.weights_sha256) == 64
    prompt = "waves"
    expected = pipeline(picture, "arc", prompt, settings=QUICK)
    assert_same_scene(expected, again(picture, "arc", prompt, settings=QUICK))


def test_a_model_folder_without_provenance_counts_as_untrained(
    pipeline: Diff4SplatPipeline, tmp_path: Path
) -> None:
    pipeline.save_pretrained(tmp_path)
    (tmp_path / "provenance.json").write_text("{")
    with pytest.raises(CheckpointError, match="untrained"):
        Diff4SplatPipeline.from_pretrained(tmp_path)
    (tmp_path / "provenance.json").unlink()
    assert Diff4SplatPipeline.from_pretrained(tmp_path).model.untrained


def test_models_that_cannot_be_had_are_refused() -> None:
    with pytest.raises(ConfigError, match="expected test, small, paper"):
        Diff4SplatPipeline.from_pretrained("huge")
    with pytest.raises(ConfigError, match="GiB"):
        Diff4SplatPipeline.from_pretrained("paper")


def test_a_single_camera_and_a_file_name_are_enough(
    pipeline: Diff4SplatPipeline, picture: InputImage, tmp_path: Path
) -> None:
    from diff4splat.io.photos.images import write_png

    write_png(torch.rand(40, 60, 3), tmp_path / "photo.png")
    scene = pipeline(tmp_path / "photo.png", "static", settings=QUICK)
    assert scene.path.cameras.size_px == (16, 32)
    one = replace(scene.path, cameras=scene.path.cameras[:1], times_s=scene.path.times_s[:1])
    assert len(pipeline(picture, one, settings=QUICK).path) == 1


def test_bad_prompts_are_refused(pipeline: Diff4SplatPipeline, picture: InputImage) -> None:
    with pytest.raises(InputError, match="prompt"):
        pipeline(picture, "static", "", settings=QUICK)


def test_double_precision_is_taken_and_wrong_sizes_are_named(
    pipeline: Diff4SplatPipeline, picture: InputImage
) -> None:
    exact = replace(picture, rgb=picture.rgb.double(), camera=picture.camera.to(torch.float64))
    expected = pipeline(picture, "arc", settings=QUICK)
    assert_same_scene(pipeline(exact, expected.path.to(torch.float64), settings=QUICK), expected)
    odd = InputImage(rgb=torch.rand(24, 24, 3), camera=pinhole(30.0, (24, 24)), focal_source="test")
    with pytest.raises(InputError, match="multiples of 16"):
        pipeline(odd, "arc", settings=QUICK)


def test_a_path_that_starts_later_is_shown_moving(
    pipeline: Diff4SplatPipeline, picture: InputImage
) -> None:
    randomize(pipeline, "deformation", 0.05)
    path = pipeline(picture, "arc", settings=QUICK).path
    later = replace(path, times_s=path.times_s + 5)
    scene = pipeline(picture, later, settings=QUICK)
    assert float(scene.path.times_s[0]) == 0
    assert scene.motion.time_range_s == pytest.approx((0.0, float(scene.path.times_s[-1])))


def test_the_text_encoder_is_built_alone_and_the_same_as_with_the_others(
    pipeline: Diff4SplatPipeline,
) -> None:
    from diff4splat.models.factory import create_networks, create_text_encoder

    config = pipeline.model.config
    alone = create_text_encoder(config).state_dict()
    together = create_networks(config, with_text=True).text_encoder.state_dict()
    assert all(torch.equal(alone[key], together[key]) for key in together)
