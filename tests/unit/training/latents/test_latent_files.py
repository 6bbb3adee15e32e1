"""Folders of encoded clips: what is written is read back, and what is not whole is named."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from latent_folders import latent_folder, make_pack

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)
from diff4splat.training.latents.latent_shards import (
    LatentPack,
    has_pack,
    join_packs,
    read_packs,
    write_pack,
)

FILE = "latents-00000.safetensors"


def assert_same(one: LatentPack, other: LatentPack) -> None:
    pairs = [(one.latent, other.latent), (one.is_static, other.is_static)]
    for name in ("focal_px", "center_px", "world_from_camera"):
        pairs.append((getattr(one.cameras, name), getattr(other.cameras, name)))
    for name in ("render_latent", "validity"):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert (mine is None) == (theirs is None)
        if mine is not None:
            pairs.append((mine, theirs))
    for left, right in pairs:
        torch.testing.assert_close(left, right, rtol=0, atol=0)
    assert one.cameras.size_px == other.cameras.size_px
    told = [(pack.captions, pack.model, pack.versions) for pack in (one, other)]
    assert told[0] == told[1]


@pytest.mark.parametrize("rendered", [True, False])
def test_what_is_written_is_read_back(tmp_path: Path, rendered: bool) -> None:
    pack = make_pack([True, False, False, True], rendered=rendered, versions=2)
    assert not has_pack(tmp_path, 0)
    write_pack(pack, tmp_path / "new", 0)
    assert has_pack(tmp_path / "new", 0) and not has_pack(tmp_path / "new", 1)
    assert_same(read_packs(tmp_path / "new"), pack)


def test_half_precision_is_stored_in_single(tmp_path: Path) -> None:
    pack = make_pack([True])
    names = ("latent", "render_latent")
    half = replace(pack, **{name: getattr(pack, name).bfloat16() for name in names})
    found = read_packs(latent_folder(tmp_path, half))
    for name in names:
        assert getattr(found, name).dtype == torch.float32
        torch.testing.assert_close(getattr(found, name), getattr(pack, name))


def test_equal_packs_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("one", "other"):
        latent_folder(tmp_path / name, make_pack([True, False]))
    assert (tmp_path / "one" / FILE).read_bytes() == (tmp_path / "other" / FILE).read_bytes()


def test_packs_are_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    packs = [make_pack([False] * 2, first=2 * number) for number in range(3)]
    for number in (2, 0, 1):
        write_pack(packs[number], tmp_path, number)
    found = read_packs(tmp_path)
    assert found.latent[:, 0, 0, 0, 0].tolist() == [0, 1, 2, 3, 4, 5]
    assert_same(found, join_packs(packs))


@pytest.mark.parametrize("rendered", [True, False])
def test_joined_packs_are_one_after_the_other(rendered: bool) -> None:
    whole = make_pack([True, False, True], rendered=rendered, versions=2)
    parts = [make_pack([True], rendered=rendered, versions=2)]
    parts.append(make_pack([False, True], first=1, rendered=rendered, versions=2))
    assert_same(join_packs(parts), whole)
    assert len(join_packs(parts)) == 3


@pytest.mark.parametrize("other", [{"model": "another"}, {"versions": 2}])
def test_packs_of_two_models_are_refused(tmp_path: Path, other: dict) -> None:
    latent_folder(tmp_path, make_pack([True] * 2), make_pack([True] * 2, **other))
    with pytest.raises(InputError, match=r"latents that one model made .* encode the clips ag"):
        read_packs(tmp_path)


@pytest.mark.parametrize("name", ["", "missing"])
def test_a_folder_without_packs_says_how_to_make_some(tmp_path: Path, name: str) -> None:
    (tmp_path / "latents-00000.safetensors.tmp").write_text("")
    with pytest.raises(InputError, match=r"expected files latents.*got none; .*prepare latents"):
        read_packs(tmp_path / name)


@pytest.mark.parametrize("kept", [0, 4, 200, -4])
def test_a_file_that_was_cut_off_is_refused(tmp_path: Path, kept: int) -> None:
    file = latent_folder(tmp_path, make_pack([True, False])) / FILE
    file.write_bytes(file.read_bytes()[:kept])
    with pytest.raises(FileFormatError, match=FILE):
        read_packs(tmp_path)


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    latent_folder(tmp_path, make_pack([True]))
    (tmp_path / "latents-00001.safetensors").write_text("an image, perhaps")
    with pytest.raises(FileFormatError, match="latents-00001"):
        read_packs(tmp_path)


@pytest.mark.parametrize("name", ["latent", "focal_px", "center_px", "pose", "is_static"])
def test_a_file_without_a_tensor_is_named(tmp_path: Path, name: str) -> None:
    file = latent_folder(tmp_path, make_pack([True])) / FILE
    tensors, metadata = read_tensors(file), read_metadata(file)
    del tensors[name]
    write_tensors(TensorFile(tensors=tensors, metadata=metadata), file)
    with pytest.raises(FileFormatError, match=rf"{FILE}: expected latent, focal_px, .* encode the"):
        read_packs(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        {"captions": None},
        {"model": None},
        {"size_px": None},
        {"versions": None},
        {"versions": "two"},
        {"captions": "no list"},
        {"size_px": "7"},
    ],
)
def test_a_file_with_other_text_is_named(tmp_path: Path, change: dict) -> None:
    file = latent_folder(tmp_path, make_pack([True])) / FILE
    metadata = read_metadata(file) | change
    metadata = {key: value for key, value in metadata.items() if value is not None}
    write_tensors(TensorFile(tensors=read_tensors(file), metadata=metadata), file)
    with pytest.raises(FileFormatError, match=rf"{FILE}: expected .* got others"):
        read_packs(tmp_path)


@pytest.mark.parametrize("name", ["render_latent", "validity"])
def test_half_of_a_render_condition_is_refused(tmp_path: Path, name: str) -> None:
    file = latent_folder(tmp_path, make_pack([True])) / FILE
    tensors, metadata = read_tensors(file), read_metadata(file)
    del tensors[name]
    write_tensors(TensorFile(tensors=tensors, metadata=metadata), file)
    with pytest.raises(FileFormatError, match=rf"{FILE}: expected .* encode the clips again"):
        read_packs(tmp_path)


def of_an_earlier_release(file: Path, rendered: bool) -> None:
    """The same file as that release wrote it: motion channels, and no validity."""
    tensors, metadata = read_tensors(file), read_metadata(file)
    if rendered:
        tensors["draft"] = tensors.pop("render_latent")
        del tensors["validity"]
    tensors["motion"] = torch.zeros_like(tensors["latent"])
    write_tensors(TensorFile(tensors=tensors, metadata=metadata), file)


def test_render_conditions_of_an_earlier_release_are_refused(tmp_path: Path) -> None:
    file = latent_folder(tmp_path, make_pack([True, False])) / FILE
    of_an_earlier_release(file, rendered=True)
    with pytest.raises(FileFormatError, match=rf"{FILE}: expected .* with validity, got those of "):
        read_packs(tmp_path)
    with pytest.raises(FileFormatError, match="earlier release; encode the clips again"):
        read_packs(tmp_path)


def test_latents_alone_of_an_earlier_release_are_read(tmp_path: Path) -> None:
    pack = make_pack([True, False], rendered=False)
    of_an_earlier_release(latent_folder(tmp_path, pack) / FILE, rendered=False)
    assert_same(read_packs(tmp_path), pack)


def test_folders_with_and_without_render_conditions_do_not_mix(tmp_path: Path) -> None:
    latent_folder(tmp_path, make_pack([True]), make_pack([True], rendered=False))
    with pytest.raises(InputError, match=r"latents that one model made .* encode the clips ag"):
        read_packs(tmp_path)


def test_captions_may_hold_any_letters(tmp_path: Path) -> None:
    captions = ('a "red"\nball', "ein grüner Würfel")
    pack = replace(make_pack([True, False]), captions=captions)
    file = latent_folder(tmp_path, pack) / FILE
    assert read_packs(tmp_path).captions == captions
    assert json.loads(read_metadata(file)["size_px"]) == [24, 24]


@pytest.mark.parametrize(
    "change",
    [
        {"latent": torch.zeros(1, 4, 2, 3)},
        {"latent": torch.zeros(1, 4, 2, 3, 3, dtype=torch.float64)},
        {"latent": torch.full((1, 4, 2, 3, 3), float("nan"))},
        {"focal_px": torch.ones(1, 7, 2)},
        {"pose": torch.zeros(1, 5, 4, 3)},
        {"validity": torch.full((1, 1, 5, 24, 24), 7, dtype=torch.uint8)},
        {"validity": torch.ones(1, 1, 5, 24, 24)},
        {"is_static": torch.tensor([3])},
    ],
)
def test_tensors_that_no_encoder_writes_are_refused(tmp_path: Path, change: dict) -> None:
    file = latent_folder(tmp_path, make_pack([True])) / FILE
    tensors, metadata = read_tensors(file) | change, read_metadata(file)
    write_tensors(TensorFile(tensors=tensors, metadata=metadata), file)
    with pytest.raises(FileFormatError, match=rf"{FILE}: expected .*{next(iter(change))}"):
        read_packs(tmp_path)


@pytest.mark.parametrize("text", ["9" * 5000, "[" * 100_000, "[1e400, 24]", "[0, 24]", "-1"])
def test_metadata_beyond_any_clip_is_refused(tmp_path: Path, text: str) -> None:
    file = latent_folder(tmp_path, make_pack([True])) / FILE
    for key in ("size_px", "versions", "captions"):
        metadata = read_metadata(file) | {key: text}
        write_tensors(TensorFile(tensors=read_tensors(file), metadata=metadata), file)
        with pytest.raises(FileFormatError, match=FILE):
            read_packs(tmp_path)
        latent_folder(tmp_path, make_pack([True]))
