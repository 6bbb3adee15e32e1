import dataclasses
import json
import re

import pytest

from diff4splat.errors import ConfigError, InputError
from diff4splat.models.config.model import (
    ActivationConfig,
    DeformationConfig,
    DetailConfig,
    DitConfig,
    LdrmConfig,
    ModelConfig,
    TextConfig,
    VaeConfig,
)
from diff4splat.models.config.sizes import SIZES, paper_size, size_by_name, small_size, test_size

LEAVES = [
    (part.name, leaf.name)
    for part in dataclasses.fields(ModelConfig)
    if dataclasses.is_dataclass(part.type)
    for leaf in dataclasses.fields(part.type)
]
OTHER_VALUES = {
    "heads": 1,
    "widths": [5, 6, 8],
    "level_widths": [9, 6, 4],
    "pixel_patch": 4,
    "buckets": 64,
    "grid_stride": 2,
    "width": 48,
    "surroundings": 8,
    "linear_code": True,
    "noise_px": 1.5,
    "picture_width": 8,
    "range": [2.0, 9.0],
    "predicts": "clean",
    "draft": True,
    "motion": True,
    "pooled_text": True,
}
"""Valid values where doubling the old one is not."""
BOUND = [("ldrm", "reads"), ("dit", "motion_width"), ("dit", "motion_outline")]
"""Fields that may not change alone."""


@pytest.mark.parametrize("name", SIZES)
def test_json_round_trip_is_exact(name: str) -> None:
    config = size_by_name(name)
    assert ModelConfig.from_json(config.to_json()) == config


def test_json_lists_every_field() -> None:
    data = json.loads(test_size().to_json())
    assert set(data) == {field.name for field in dataclasses.fields(ModelConfig)}
    assert all(leaf in data[part] for part, leaf in LEAVES)


def test_every_field_changes_the_fingerprint() -> None:
    prints = [test_size().fingerprint()]
    free = [pair for pair in LEAVES if pair not in BOUND]
    for part, leaf in free:
        data = json.loads(test_size().to_json())
        old = data[part][leaf]
        data[part][leaf] = OTHER_VALUES.get(leaf, 2 * old if isinstance(old, int | float) else None)
        prints.append(ModelConfig.from_json(json.dumps(data)).fingerprint())
        assert prints[-1] != prints[0], (part, leaf)
    assert all(re.fullmatch("[0-9a-f]{12}", each) for each in prints)


def test_a_branch_for_motion_needs_a_motion_and_room_for_its_heads() -> None:
    dit = dataclasses.replace(test_size().dit, motion=True, motion_width=8)
    outlined = dataclasses.replace(dit, motion_outline=4)
    prints = {dataclasses.replace(test_size(), dit=own).fingerprint() for own in (dit, outlined)}
    assert len(prints | {test_size().fingerprint()}) == 3
    for change, words in (
        ({"motion": False}, "DitConfig.motion: expected true where a branch tells it"),
        ({"motion_width": 6}, "motion_width: expected 0 or a multiple of 4, twice the heads"),
        ({"motion_width": -8}, "motion_width: expected 0 or a multiple"),
        ({"motion_width": True}, "motion_width: expected 0 or a multiple"),
        ({"motion_outline": -1}, "motion_outline: expected a whole number of at least 0, got -1"),
        ({"motion_outline": True}, "motion_outline: expected a whole number"),
        ({"motion_width": 0, "motion_outline": 4}, "expected 0 without a branch that it belongs"),
    ):
        with pytest.raises(ConfigError, match=words):
            dataclasses.replace(dit, **change)


@pytest.mark.parametrize("width", [-1, True])
def test_a_network_for_the_depth_of_pictures_has_a_whole_width(width: int) -> None:
    with pytest.raises(ConfigError, match="picture_width: expected a whole number of at least 0"):
        DetailConfig(width=6, picture_width=width)


def test_models_stored_before_a_picture_told_its_depth_have_none() -> None:
    data = json.loads(test_size().to_json())
    del data["detail"]["picture_width"]
    assert ModelConfig.from_json(json.dumps(data)) == test_size()


def test_models_stored_before_there_were_details_have_none() -> None:
    data = json.loads(test_size().to_json())
    del data["detail"], data["vae"]["linear_code"], data["ldrm"]["reads"]
    for later in ("predicts", "draft", "motion", "motion_width", "pooled_text"):
        del data["dit"][later]
    assert ModelConfig.from_json(json.dumps(data)) == test_size()


def test_fingerprint_is_stable() -> None:
    assert test_size().fingerprint() == test_size().fingerprint()


@pytest.mark.parametrize("path", [[], ["vae"], ["dit"], ["activation"]])
def test_unknown_key_is_named(path: list[str]) -> None:
    data = json.loads(test_size().to_json())
    target = data
    for key in path:
        target = target[key]
    target["wdith"] = 3
    with pytest.raises(ConfigError, match=r"expected the keys .*got 'wdith'"):
        ModelConfig.from_json(json.dumps(data))


def test_missing_key_is_named() -> None:
    data = json.loads(test_size().to_json())
    del data["ldrm"]["heads"]
    with pytest.raises(ConfigError, match=r"configuration\.ldrm: expected the key 'heads'"):
        ModelConfig.from_json(json.dumps(data))


@pytest.mark.parametrize("text", ["", "{", "[1]", "null", '{"vae": 3}', '"x"'])
def test_malformed_json_is_a_config_error(text: str) -> None:
    with pytest.raises(ConfigError, match="expected") as caught:
        ModelConfig.from_json(text)
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        (DitConfig, {"heads": 5}, "DitConfig.heads: expected a divisor of width 24"),
        (DitConfig, {"heads": 6}, "DitConfig.heads: expected even heads of at least 6"),
        (DitConfig, {"width": 0}, "DitConfig.width: expected a whole number of at least 1"),
        (DitConfig, {"width": "24"}, "DitConfig.width: expected a whole number"),
        (DitConfig, {"blocks": True}, "DitConfig.blocks: expected a whole number"),
        (DitConfig, {"frequency_width": 15}, "DitConfig.frequency_width: expected an even number"),
        (LdrmConfig, {"grid_stride": 3}, "LdrmConfig.grid_stride: expected 1 or 2"),
        (LdrmConfig, {"reads": "sounds"}, "LdrmConfig.reads: expected latents or frames"),
        (VaeConfig, {"linear_code": 1}, "VaeConfig.linear_code: expected true or false"),
        (
            VaeConfig,
            {"linear_code": True, "latent_channels": 769},
            "latent_channels: expected at most the 768 values of a block",
        ),
        (DetailConfig, {"width": -1}, "DetailConfig.width: expected a whole number of at least 0"),
        (DetailConfig, {"depths": True}, "DetailConfig.depths: expected a whole number"),
        (DetailConfig, {"match_channels": 0}, "match_channels: expected a whole number"),
        (DetailConfig, {"surroundings": 6}, "surroundings: expected a multiple of 4, got 6"),
        (DetailConfig, {"range": (2.0, 1.0)}, "DetailConfig.range: expected two rising depths"),
        (DetailConfig, {"range": ("1", "2")}, "DetailConfig.range: expected two rising depths"),
        (DetailConfig, {"range": None}, "DetailConfig.range: expected two rising depths"),
        (VaeConfig, {"widths": (4, 8)}, "VaeConfig.widths: expected at least 3 widths"),
        (VaeConfig, {"widths": (4, 8, -1)}, "VaeConfig.widths: expected whole numbers"),
        (TextConfig, {"max_bytes": 0}, "TextConfig.max_bytes: expected a whole number"),
        (TextConfig, {"buckets": 30}, "TextConfig.buckets: expected a multiple of 4"),
        (TextConfig, {"max_distance": 8}, "TextConfig.max_distance: expected above 8"),
        (DeformationConfig, {"level_widths": (1, 2)}, "level_widths: expected three widths"),
        (DeformationConfig, {"level_widths": (1, 2, 0)}, "level_widths: expected whole numbers"),
        (ActivationConfig, {"footprint_px": 0.0}, "footprint_px: expected a finite number above 0"),
        (ActivationConfig, {"log_scale_limit": float("inf")}, "log_scale_limit: expected a finite"),
    ],
)
def test_bad_values_are_refused(kind: type, change: dict, message: str) -> None:
    config = test_size()
    part = next(
        v for f in dataclasses.fields(config) if isinstance(v := getattr(config, f.name), kind)
    )
    with pytest.raises(ConfigError, match=message):
        dataclasses.replace(part, **change)


def test_latent_grid() -> None:
    assert small_size().latent_grid(17, (256, 256)) == (5, 32, 32)
    assert small_size().latent_grid(1, (16, 48)) == (1, 2, 6)
    assert paper_size().latent_grid(49, (512, 512)) == (13, 64, 64)


@pytest.mark.parametrize(
    ("frames", "size_px", "message"),
    [
        (16, (32, 32), r"expected 1 \+ 4 k, got 16; use 17"),
        (0, (32, 32), r"expected 1 \+ 4 k, got 0; use 1"),
        (-3, (32, 32), r"expected 1 \+ 4 k, got -3; use 1"),
        (5, (32, 40), "multiples of 16 px, got 40; use 32"),
        (5, (0, 32), "multiples of 16 px, got 0; use 16"),
    ],
)
def test_latent_grid_says_what_fits(frames: int, size_px: tuple[int, int], message: str) -> None:
    with pytest.raises(InputError, match=message):
        test_size().latent_grid(frames, size_px)


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("value", [["a", 32], [32], 32, None, [32.0, 32]])
def test_malformed_size_is_refused(value: object) -> None:
    data = json.loads(test_size().to_json()) | {"size_px": value}
    with pytest.raises(ConfigError, match=r"size_px: expected \(height, width\) in whole pixels"):
        ModelConfig.from_json(json.dumps(data))


def test_default_frames_and_size_must_fit() -> None:
    with pytest.raises(ConfigError, match=r"expected 1 \+ 4 k"):
        dataclasses.replace(test_size(), frames=6)
    with pytest.raises(ConfigError, match="multiples of 16"):
        dataclasses.replace(test_size(), size_px=(33, 32))


def test_grid_stride_needs_large_enough_tokens() -> None:
    config = test_size()
    vae = dataclasses.replace(config.vae, pixel_patch=1)
    ldrm = dataclasses.replace(config.ldrm, grid_stride=2)
    with pytest.raises(ConfigError, match="expected tokens of a multiple of 16 px, got 8"):
        dataclasses.replace(config, vae=vae, ldrm=ldrm)


def test_frames_are_read_by_a_detail_decoder_alone() -> None:
    config, detail = test_size(), DetailConfig(width=6)
    ldrm = dataclasses.replace(config.ldrm, reads="frames")
    with pytest.raises(ConfigError, match="expected latents where there is no detail decoder"):
        dataclasses.replace(config, ldrm=ldrm)
    both = dataclasses.replace(config, ldrm=ldrm, detail=detail)
    assert ModelConfig.from_json(both.to_json()) == both
    assert both.fingerprint() != dataclasses.replace(config, detail=detail).fingerprint()


def test_details_need_whole_pixels_and_tokens_of_sixteen() -> None:
    config, detail = test_size(), DetailConfig(width=6)
    halves = dataclasses.replace(config.ldrm, grid_stride=2)
    with pytest.raises(ConfigError, match="grid_stride: expected 1 with a detail decoder"):
        dataclasses.replace(config, ldrm=halves, detail=detail)
    vae = dataclasses.replace(config.vae, pixel_patch=4)
    with pytest.raises(ConfigError, match="expected tokens of 16 px with a detail decoder, got 32"):
        dataclasses.replace(config, vae=vae, detail=detail)


def test_unknown_size_lists_the_known() -> None:
    with pytest.raises(ConfigError, match="expected test, small, paper, got 'large'"):
        size_by_name("large")


def test_published_numbers() -> None:
    paper = paper_size()
    assert (paper.vae.latent_channels, paper.vae.space_stride) == (32, 8)
    assert (paper.dit.blocks, paper.dit.width) == (32, 4096)
    assert (paper.ldrm.blocks, paper.ldrm.embed_channels) == (16, 64)
    assert (paper.frames, paper.size_px) == (49, (512, 512))
