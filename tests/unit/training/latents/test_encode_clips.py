"""From a folder of clips to a folder of latents: what the video model would see of the clips."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from clip_shards import exact_clip
from latent_folders import latents_of, learning_from
from oracles_clips import make_clip
from stage_fixtures import make_stage

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.data.clip import Clip
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import FileFormatError
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model, save_model
from diff4splat.progress.phases import Phases
from diff4splat.training.batches.sample import Origin, make_sample
from diff4splat.training.latents import encode
from diff4splat.training.latents.encode import EncodingJob, encode_clips
from diff4splat.training.latents.latent_shards import LatentPack, read_packs
from diff4splat.training.latents.samples import LatentSamples
from diff4splat.training.stage import SampleKey

RECIPE = recipe_by_name("test").stage("video_diffusion")
LEFT = "a red ball rolls to the left, the camera circles right"
RIGHT = "a red ball rolls to the right, the camera circles left"
WORDS = ("someone turns left.", "someone turns right.")


def tiny_model(rendered: bool = False) -> Model:
    config: ModelConfig = recipe_by_name("test").model
    config = replace(config, dit=replace(config.dit, render_condition=rendered))
    return Model(config=config, networks=create_networks(config))


def told(clip: Clip, caption: str) -> Clip:
    return replace(clip, note=replace(clip.note, caption=caption))


def write_clips(folder: Path, *clips: Clip) -> Path:
    with ShardWriter(folder, ShardOptions(generator="oracle 1")) as writer:
        for clip in clips:
            writer.write(clip)
    return folder


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    clips = (told(exact_clip(0, True), WORDS[0]), told(exact_clip(1, False), LEFT))
    return write_clips(tmp_path_factory.mktemp("shards"), *clips)


def job(clips: Path, folder: Path, mirror: bool = True, rendered: bool = False) -> EncodingJob:
    return EncodingJob(
        model=tiny_model(rendered), data=RECIPE.data, clips=clips, folder=folder, mirror=mirror
    )


@pytest.fixture(scope="module")
def encoded(shards: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("latents")
    assert encode_clips(job(shards, folder, rendered=True), Phases()) == 4
    return folder


def test_each_clip_is_followed_by_its_mirror_image(encoded: Path) -> None:
    pack = read_packs(encoded)
    assert (pack.versions, pack.model, len(pack)) == (2, "none", 4)
    assert pack.captions == (*WORDS, LEFT, RIGHT)
    assert pack.is_static.tolist() == [True, True, False, False]


def test_latents_are_those_of_the_images_and_of_the_images_in_a_mirror(encoded: Path) -> None:
    pack, vae = read_packs(encoded), tiny_model().networks.vae
    for place, (seed, static) in enumerate(((0, True), (1, False))):
        rgb = exact_clip(seed, static).views[0].rgb[None].movedim(-1, 1).float() / 127.5 - 1
        for version, video in enumerate((rgb, rgb.flip(-1))):
            with torch.no_grad():
                wanted = vae.encode(video).mean[0]
            torch.testing.assert_close(pack.latent[2 * place + version], wanted)


def test_cameras_begin_at_the_identity_and_turn_the_other_way_in_a_mirror(encoded: Path) -> None:
    cameras = read_packs(encoded).cameras
    pose, flip = cameras.world_from_camera, torch.diag(torch.tensor([-1.0, 1.0, 1.0, 1.0]))
    torch.testing.assert_close(pose[:, 0], torch.eye(4).expand(4, 4, 4))
    torch.testing.assert_close(pose[1::2], flip @ pose[::2] @ flip)
    assert float(pose[::2, -1, 0, 3].abs().min()) > 1e-3
    width = cameras.size_px[1]
    torch.testing.assert_close(cameras.center_px[1::2, :, 0], width - cameras.center_px[::2, :, 0])


def as_sample(place: int) -> Clip:
    return told(exact_clip(place, place == 0), (WORDS[0], LEFT)[place])


@pytest.mark.parametrize("place", [0, 1])
def test_the_video_model_sees_what_it_would_see_of_the_clip(encoded: Path, place: int) -> None:
    pack = read_packs(encoded)
    stage = make_stage(RECIPE, model=tiny_model(rendered=True).config)
    origin = Origin(key=SampleKey(0, "video_diffusion", 0, "sample"), source="made")
    seen = stage.encoded(make_sample(as_sample(place), RECIPE.data, origin))
    own = slice(2 * place, 2 * place + 1)
    torch.testing.assert_close(pack.latent[own], seen.latent)
    torch.testing.assert_close(pack.render_latent[own], seen.render_latent)
    assert torch.equal(pack.validity[own].float(), seen.validity)
    for name in ("focal_px", "center_px", "world_from_camera"):
        torch.testing.assert_close(getattr(pack.cameras[own], name), getattr(seen.cameras, name))
    assert pack.captions[2 * place] == seen.captions[0]


def test_render_conditions_begin_with_the_true_image_and_then_differ(encoded: Path) -> None:
    pack = read_packs(encoded)
    rendered = pack.render_latent
    assert rendered.shape == pack.latent.shape
    torch.testing.assert_close(rendered[:, :, 0], pack.latent[:, :, 0])
    assert not torch.allclose(rendered[:, :, 1:], pack.latent[:, :, 1:])
    assert not torch.allclose(rendered[::2], rendered[1::2])


def test_validity_is_that_of_pixels_and_is_complete_in_the_first_frame(encoded: Path) -> None:
    validity = read_packs(encoded).validity
    assert validity.shape == (4, 1, 5, 32, 32)
    assert bool(validity[:, :, 0].all()) and not validity[:, :, -1].flatten(1).all(1).any()


def test_models_without_render_conditions_get_none(shards: Path, tmp_path: Path) -> None:
    encode_clips(job(shards, tmp_path), Phases())
    pack = read_packs(tmp_path)
    assert pack.render_latent is None and pack.validity is None


def test_packs_name_the_weights_of_a_stored_model(shards: Path, tmp_path: Path) -> None:
    save_model(tiny_model(), tmp_path / "model")
    stored = load_model(tmp_path / "model")
    encode_clips(replace(job(shards, tmp_path / "out"), model=stored), Phases())
    assert read_packs(tmp_path / "out").model == stored.weights_sha256() != "none"


def test_a_second_run_writes_nothing(shards: Path, encoded: Path) -> None:
    (file,) = encoded.iterdir()
    before = file.read_bytes(), file.stat().st_mtime_ns
    assert encode_clips(job(shards, encoded, rendered=True), Phases()) == 0
    assert (file.read_bytes(), file.stat().st_mtime_ns) == before
    assert list(encoded.iterdir()) == [file]


def test_without_mirrors_each_clip_is_there_once(shards: Path, tmp_path: Path) -> None:
    assert encode_clips(job(shards, tmp_path, mirror=False), Phases()) == 2
    pack = read_packs(tmp_path)
    assert (pack.versions, pack.captions) == (1, (WORDS[0], LEFT))


def few_a_file(shards: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    monkeypatch.setattr(encode, "PACK", 1)
    encode_clips(job(shards, folder), Phases())
    return sorted(folder.iterdir())


def test_a_run_that_was_stopped_goes_on_with_the_files_that_are_missing(
    shards: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = few_a_file(shards, tmp_path, monkeypatch)
    assert [file.name[8:13] for file in files] == ["00000", "00001"]
    whole: LatentPack = read_packs(tmp_path)
    files[0].unlink()
    assert encode_clips(job(shards, tmp_path), Phases()) == 2
    again = read_packs(tmp_path)
    assert again.captions == whole.captions == (*WORDS, LEFT, RIGHT)
    torch.testing.assert_close(again.latent, whole.latent, rtol=0, atol=0)


def test_clips_that_are_too_short_are_left_out(tmp_path: Path) -> None:
    short = make_clip(3, (32, 32), seed=5, tracks=8)
    clips = write_clips(tmp_path / "clips", short, as_sample(1))
    assert encode_clips(job(clips, tmp_path / "out", mirror=False), Phases()) == 1
    assert read_packs(tmp_path / "out").captions == (LEFT,)


def test_what_is_encoded_can_be_learnt_from(encoded: Path) -> None:
    sample = LatentSamples(learning_from(latents_of(encoded, 0.0)), 0)[0]
    assert sample.captions[0] in (LEFT, RIGHT)
    terms = make_stage(RECIPE, model=tiny_model(rendered=True).config)(sample)
    assert bool(torch.isfinite(terms["flow"]).all())


def test_a_folder_without_clips_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"manifest\.json"):
        encode_clips(job(tmp_path, tmp_path / "out"), Phases())
    assert not (tmp_path / "out").exists()
