"""The pipeline with random weights at ``test`` size: seeds, prompts, motion, saving, paths."""

from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch

from diff4splat.errors import CheckpointError, ConfigError, InputError
from diff4splat.generation import pipeline as generation_pipeline
from diff4splat.generation.inputs.copies import Copies
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.plan import MOTION_PARTS
from diff4splat.generation.priors import image_maps
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.video_sampling import Conditions, initial_noise
from diff4splat.geometry.camera import pinhole
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.models.config.sizes import small_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, with_parts
from diff4splat.models.hub.weight_files import weights_sha256
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.networks import PARTS
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

QUICK = GenerationSettings(steps=2)


@pytest.fixture
def image() -> InputImage:
    return InputImage(
        rgb=torch.rand(32, 32, 3), camera=pinhole(30.0, (32, 32)), focal_source="test"
    )


@pytest.fixture
def pipeline() -> Diff4SplatPipeline:
    return Diff4SplatPipeline.from_pretrained("test")


def randomize(pipeline: Diff4SplatPipeline, part: str, scale: float = 0.3) -> None:
    """Give the zero-initialised layers of a network random weights, as training would."""
    pipeline.model = with_parts(pipeline.model, (part,))
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


def test_an_untrained_scene_says_so_and_is_static(
    pipeline: Diff4SplatPipeline, image: InputImage
) -> None:
    scene = pipeline(image, "spiral", settings=QUICK)
    assert scene.provenance.untrained
    assert scene.provenance.model == "test"
    assert isinstance(scene.motion, StaticMotion)
    assert len(scene.gaussians) == 32 * 32
    assert torch.equal(scene.path.cameras.world_from_camera[0], torch.eye(4))


def test_equal_seeds_give_equal_bits_and_other_seeds_do_not(
    pipeline: Diff4SplatPipeline, image: InputImage
) -> None:
    for part in ("dit", "ldrm", "deformation"):
        randomize(pipeline, part)
    torch.rand(3)
    first = pipeline(image, "arc", seed=1, settings=QUICK)
    torch.rand(7)
    assert_same_scene(first, pipeline(image, "arc", seed=1, settings=QUICK))
    other = pipeline(image, "arc", seed=2, settings=QUICK)
    assert len(other.gaussians) != len(first.gaussians) or not torch.equal(
        other.gaussians.means, first.gaussians.means
    )


def test_random_heads_move_and_the_file_keeps_the_motion(
    pipeline: Diff4SplatPipeline, image: InputImage, tmp_path: Path
) -> None:
    randomize(pipeline, "deformation", 0.05)
    scene = pipeline(image, "forward", settings=QUICK)
    assert isinstance(scene.motion, KeyframeMotion)
    assert len(scene.motion.moving_index) > 100
    assert scene.motion.time_range_s == (0.0, 2.0)
    moved = scene.state_at(1.0).means - scene.gaussians.means
    assert float(moved.abs().max()) > 0.01
    save_scene(scene, tmp_path / "scene.safetensors")
    assert_same_scene(scene, load_scene(tmp_path / "scene.safetensors"))


def test_gaussians_that_hardly_move_store_no_keys(
    pipeline: Diff4SplatPipeline, image: InputImage
) -> None:
    randomize(pipeline, "deformation", 0.05)
    log = RunLog()
    generous = replace(QUICK, static_threshold_px=50.0)
    trimmed = pipeline(image, "forward", settings=generous, log=log)
    strict = pipeline(image, "forward", settings=replace(QUICK, static_threshold_px=0.0))
    assert len(trimmed.motion.moving_index) < len(strict.motion.moving_index)
    assert "key times of static Gaussians" in {omission.what for omission in log.skipped}


def test_a_prompt_changes_the_scene_and_loads_the_text_encoder(
    pipeline: Diff4SplatPipeline, image: InputImage
) -> None:
    for part in ("dit", "ldrm"):
        randomize(pipeline, part)
    plain_log, log = RunLog(), RunLog()
    plain = pipeline(image, "arc", settings=QUICK, log=plain_log)
    prompted = pipeline(image, "arc", "a red ball rolls", settings=QUICK, log=log)
    assert not torch.equal(plain.gaussians.sh[:50], prompted.gaussians.sh[:50])
    assert "text_encoder" in {omission.what for omission in plain_log.skipped}
    assert "text_encoder" not in {omission.what for omission in log.skipped}
    assert prompted.provenance.prompt == "a red ball rolls"


def test_every_event_of_a_prompt_that_moves_something_is_a_request(
    pipeline: Diff4SplatPipeline, image: InputImage, monkeypatch: pytest.MonkeyPatch
) -> None:
    requests = []

    def recorded(model: Model, copies: Copies, frames: int, asked: list, log: RunLog) -> ImageMaps:
        requests.append([request.text for request in asked])
        return image_maps(model, copies, frames, asked, log)

    monkeypatch.setattr(generation_pipeline, "image_maps", recorded)
    events = ("a red ball rolls", "a blue cube hops")
    for prompt in (f"{events[0]}, a flag flutters, {events[1]}, the camera rises", *events):
        pipeline(image, "arc", prompt, settings=QUICK)
    both, first, second = requests
    assert len(both) == 2
    assert torch.equal(both[0], first[0]) and torch.equal(both[1], second[0])
    pipeline(image, "arc", settings=QUICK)
    assert requests[-1] == [None]


def test_the_image_latent_survives_sampling_unchanged(
    pipeline: Diff4SplatPipeline, image: InputImage
) -> None:
    from diff4splat.generation.video.video_sampling import sample_video

    randomize(pipeline, "dit")
    image = torch.randn(1, 4, 1, 4, 4)
    conditions = Conditions(image_latent=image, plucker=torch.randn(1, 6, 5, 32, 32), text=None)
    with torch.no_grad():
        video = sample_video(pipeline.model.networks.dit, conditions, QUICK, seed=0)
    torch.testing.assert_close(video.latent[:, :, :1], image)
    start = initial_noise(conditions, 0)
    assert not torch.allclose(video.latent[:, :, 1:], start[:, :, 1:])


def test_saved_and_loaded_pipelines_agree(
    pipeline: Diff4SplatPipeline, image: InputImage, tmp_path: Path
) -> None:
    for part in ("dit", "ldrm"):
        randomize(pipeline, part)
    pipeline.save_pretrained(tmp_path / "model")
    again = Diff4SplatPipeline.from_pretrained(tmp_path / "model")
    assert again.model.loaded == frozenset()
    assert len(again.model.weights_sha256()) == 64
    prompt = "waves"
    expected = pipeline(image, "arc", prompt, settings=QUICK)
    assert_same_scene(expected, again(image, "arc", prompt, settings=QUICK))


def test_a_model_folder_without_provenance_counts_as_untrained(
    pipeline: Diff4SplatPipeline, tmp_path: Path
) -> None:
    pipeline.save_pretrained(tmp_path)
    (tmp_path / "provenance.json").write_text("{")
    with pytest.raises(CheckpointError, match="untrained"):
        Diff4SplatPipeline.from_pretrained(tmp_path)
    (tmp_path / "provenance.json").unlink()
    assert Diff4SplatPipeline.from_pretrained(tmp_path).model.trained == frozenset()


def test_unknown_and_too_large_models_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="expected test, small, paper"):
        Diff4SplatPipeline.from_pretrained("huge")
    with pytest.raises(ConfigError, match="GiB"):
        Diff4SplatPipeline.from_pretrained("paper").save_pretrained(tmp_path)


def test_a_single_camera_and_a_file_name_are_enough(
    pipeline: Diff4SplatPipeline, image: InputImage, tmp_path: Path
) -> None:
    from diff4splat.io.photos.images import write_png

    write_png(torch.rand(40, 60, 3), tmp_path / "photo.png")
    scene = pipeline(tmp_path / "photo.png", "static", settings=QUICK)
    assert scene.path.cameras.size_px == (16, 32)
    one = replace(scene.path, cameras=scene.path.cameras[:1], times_s=scene.path.times_s[:1])
    assert len(pipeline(image, one, settings=QUICK).path) == 1


def test_bad_prompts_are_refused(pipeline: Diff4SplatPipeline, image: InputImage) -> None:
    with pytest.raises(InputError, match="prompt"):
        pipeline(image, "static", "", settings=QUICK)


def test_double_precision_is_taken_and_wrong_sizes_are_named(
    pipeline: Diff4SplatPipeline, image: InputImage
) -> None:
    exact = replace(image, rgb=image.rgb.double(), camera=image.camera.to(torch.float64))
    expected = pipeline(image, "arc", settings=QUICK)
    assert_same_scene(pipeline(exact, expected.path.to(torch.float64), settings=QUICK), expected)
    odd = InputImage(rgb=torch.rand(24, 24, 3), camera=pinhole(30.0, (24, 24)), focal_source="test")
    with pytest.raises(InputError, match="multiples of 16"):
        pipeline(odd, "arc", settings=QUICK)


def test_a_path_that_starts_later_is_shown_moving(
    pipeline: Diff4SplatPipeline, image: InputImage
) -> None:
    randomize(pipeline, "deformation", 0.05)
    path = pipeline(image, "arc", settings=QUICK).path
    later = replace(path, times_s=path.times_s + 5)
    scene = pipeline(image, later, settings=QUICK)
    assert float(scene.path.times_s[0]) == 0
    assert scene.motion.time_range_s == pytest.approx((0.0, float(scene.path.times_s[-1])))


def priors_model(trained: tuple[str, ...] = PARTS) -> Model:
    """The ``small`` size with random priors under the claim that parts are trained."""
    return Model(config=small_size(), trained=frozenset(trained))


def refuse_networks(monkeypatch: pytest.MonkeyPatch, model: Model) -> None:
    def refuse(*arguments: object, **named: object) -> None:
        raise AssertionError("a network ran")

    for _, part in model.networks.parts():
        for module in part.modules():
            monkeypatch.setattr(module, "forward", refuse)


def test_networks_load_when_they_are_needed_and_stay(image: InputImage) -> None:
    pipeline = Diff4SplatPipeline(priors_model())
    pipeline(image, "arc", settings=QUICK)
    assert pipeline.model.loaded == {"monocular_depth"}
    first = pipeline.model.networks.monocular_depth
    pipeline(image, "arc", "a ball rolls", settings=QUICK)
    assert pipeline.model.loaded == {"monocular_depth", *MOTION_PARTS}
    assert pipeline.model.networks.monocular_depth is first


@pytest.mark.parametrize(
    ("change", "prompt"),
    [
        ({}, "a ball rolls"),
        pytest.param({"fill": "video"}, "a ball rolls", marks=pytest.mark.slow),
        ({"still": True}, None),
        pytest.param({}, None, marks=pytest.mark.slow),
        pytest.param({"fill": "video"}, None, marks=pytest.mark.slow),
        pytest.param({"still": True}, "a ball rolls", marks=pytest.mark.slow),
    ],
)
def test_what_was_loaded_before_changes_nothing(
    change: dict[str, object], prompt: str | None, image: InputImage
) -> None:
    settings = replace(QUICK, **change)
    scenes = [
        Diff4SplatPipeline(model)(image, "left", prompt, settings=settings)
        for model in (priors_model(), with_parts(priors_model(), PARTS))
    ]
    assert_same_scene(*scenes)


def test_a_model_without_trained_priors_shows_the_image_on_a_plane(
    image: InputImage, monkeypatch: pytest.MonkeyPatch
) -> None:
    partly = with_parts(priors_model(("vae", "ldrm", "deformation")), PARTS)
    refuse_networks(monkeypatch, partly)
    scene = Diff4SplatPipeline(partly)(image, "arc", "waves", settings=QUICK)
    assert isinstance(scene.motion, StaticMotion)
    shown = scene.gaussians.means[: 32 * 32, 2]
    torch.testing.assert_close(shown, torch.full_like(shown, PLANE_DEPTH))
    assert scene.provenance.prompt == "waves" and not scene.provenance.untrained


@pytest.mark.parametrize(
    ("trained", "untrained"),
    [((), True), (PARTS, False), (("monocular_depth",), False), (("motion_unet",), False)],
)
def test_a_scene_is_untrained_if_a_network_that_ran_is(
    image: InputImage, trained: tuple[str, ...], untrained: bool
) -> None:
    pipeline = Diff4SplatPipeline(priors_model(trained))
    scene = pipeline(image, "arc", "a ball rolls", settings=QUICK)
    assert scene.provenance.untrained is untrained


def test_the_digest_is_that_of_the_networks_that_ran(
    pipeline: Diff4SplatPipeline, image: InputImage, tmp_path: Path
) -> None:
    assert pipeline(image, "arc", settings=QUICK).provenance.weights_sha256 == "none"
    pipeline.save_pretrained(tmp_path)
    again = Diff4SplatPipeline.from_pretrained(tmp_path)
    video = ("vae", "dit", "ldrm", "deformation")
    for prompt, parts in ((None, video), ("waves", (*video, "text_encoder"))):
        scene = again(image, "arc", prompt, settings=QUICK)
        assert scene.provenance.weights_sha256 == weights_sha256(tmp_path, parts)


def test_still_moves_nothing(image: InputImage, pipeline: Diff4SplatPipeline) -> None:
    randomize(pipeline, "deformation", 0.05)
    assert isinstance(pipeline(image, "arc", settings=QUICK).motion, KeyframeMotion)
    still = pipeline(image, "arc", "waves", settings=replace(QUICK, still=True))
    assert isinstance(still.motion, StaticMotion)


def test_the_image_and_the_path_get_one_lens(
    image: InputImage, pipeline: Diff4SplatPipeline
) -> None:
    path = pipeline(image, "arc", settings=QUICK).path
    zoomed = replace(path.cameras, focal_px=2 * path.cameras.focal_px)
    path = replace(path, cameras=zoomed)
    known = pipeline(image, path, settings=QUICK)
    torch.testing.assert_close(known.path.cameras[0].focal_px, torch.tensor([30.0, 30.0]))
    guessed = pipeline(replace(image, focal_known=False), path, settings=QUICK)
    torch.testing.assert_close(guessed.path.cameras[0].focal_px, torch.tensor([60.0, 60.0]))
    assert not torch.equal(guessed.gaussians.means, known.gaussians.means)


def test_requests_are_refused_before_weights_are_read(image: InputImage) -> None:
    pipeline = Diff4SplatPipeline(priors_model(("vae",)))
    with pytest.raises(ConfigError, match="--fill video"):
        pipeline(image, "arc", settings=replace(QUICK, fill="video"))
    for bad in ("", " ", "x" * 10_000):
        with pytest.raises(InputError, match="prompt"):
            pipeline(image, "arc", bad, settings=QUICK)
    with pytest.raises(ConfigError, match="--seed"):
        pipeline(image, "arc", seed=-1, settings=QUICK)
    assert pipeline.model.loaded == frozenset()


def test_scenes_come_back_to_the_cpu(image: InputImage, pipeline: Diff4SplatPipeline) -> None:
    assert pipeline.to("cpu") is pipeline
    scene = pipeline(image, "arc", settings=QUICK)
    assert scene.gaussians.means.device == torch.device("cpu")


@pytest.mark.parametrize(("fill", "dilation_px2"), [("none", 0.0), ("video", 0.3)])
def test_the_image_is_drawn_without_dilation(
    image: InputImage, pipeline: Diff4SplatPipeline, fill: str, dilation_px2: float
) -> None:
    scene = pipeline(image, "arc", settings=replace(QUICK, fill=fill))
    assert scene.dilation_px2 == dilation_px2


@pytest.mark.parametrize("value", [0.0, 1.0])
@pytest.mark.parametrize("fill", ["none", "video"])
def test_an_image_of_one_colour_gives_a_finite_scene(value: float, fill: str) -> None:
    flat = InputImage(
        rgb=torch.full((32, 48, 3), value), camera=pinhole(30.0, (32, 48)), focal_source="test"
    )
    settings = replace(QUICK, fill=fill)
    scene = Diff4SplatPipeline(priors_model())(flat, "left", "waves", settings=settings)
    for field in fields(Gaussians):
        assert bool(getattr(scene.gaussians, field.name).isfinite().all()), field.name


def test_a_network_has_the_same_weights_alone_and_with_others() -> None:
    config = small_size()
    alone = create_networks(config, parts=("text_encoder",)).text_encoder.state_dict()
    together = create_networks(config).text_encoder.state_dict()
    assert all(torch.equal(alone[key], together[key]) for key in together)


@pytest.mark.parametrize("dtype", ["bfloat16", "float16"])
def test_half_precision_is_near_and_gives_a_scene_in_float32(image: InputImage, dtype: str) -> None:
    exact, half = (
        Diff4SplatPipeline.from_pretrained("test")
        .to("cpu", name)(image, "spiral", settings=QUICK)
        .gaussians
        for name in ("float32", dtype)
    )
    assert half.means.dtype == torch.float32 and torch.isfinite(half.means).all()
    assert len(half) == len(exact)
    assert 0 <= float((half.means - exact.means).norm() / exact.means.norm()) < 0.05


def test_networks_go_where_they_are_asked_to(image: InputImage) -> None:
    """A device without memory: whatever stays behind would be an error there."""
    pipeline = Diff4SplatPipeline.from_pretrained("test").to("meta")
    pipeline.model = with_parts(pipeline.model, pipeline.model.parts)
    pipeline.model.networks.to(pipeline.device)
    for _, part in pipeline.model.networks.parts():
        assert {tensor.device.type for tensor in part.state_dict().values()} <= {"meta"}
