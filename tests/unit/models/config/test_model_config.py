import dataclasses
import json
import math
import re
from typing import get_args

import pytest

from diff4splat.errors import ConfigError, InputError
from diff4splat.models.config.model import (
    ActivationConfig,
    DeformationConfig,
    DitConfig,
    LdrmConfig,
    ModelConfig,
    MonocularDepthConfig,
    MotionUNetConfig,
    ObjectMaskConfig,
    RefinementConfig,
    TextConfig,
    VaeConfig,
)
from diff4splat.models.config.priors import BackboneSize
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
    "relative_position_buckets": 64,
    "grid_stride": 2,
    "width": 48,
    "channels": 8,
    "border_cells": 8,
    "pca_shortcut": True,
    "static_threshold_px": 1.5,
    "depth_range": [2.0, 9.0],
    "prediction_type": "clean",
    "render_condition": True,
    "pooled_text": True,
    "layout": "wan2.1",
    "decoder_widths": [4, 6, 9],
    "vocabulary": 300,
    "head_width": 8,
    "padded_text_tokens": 16,
    "condition_channels": 8,
    "image_width": 12,
    "positions": "rotary",
    "base_grid": [13, 30, 46],
    "betas": "linear",
    "offset_width": 8,
    "inverse_image_scale": True,
    "zero_terminal_snr": False,
    "expert_boundary": 0.5,
    "activation": "quick_gelu",
}
"""Valid values where doubling the old one is not."""
BOUND = [
    ("ldrm", "input"),
    ("text", "encoder"),
    ("motion_unet", "mask_refiner_width"),
    ("object_mask", "width"),
    ("refinement", "depth_prior"),
    ("object_mask", "instance_channels"),
    ("vae", "groups"),
    ("vae", "tile_px"),
    ("monocular_depth", "backbone_size"),
    ("object_mask", "backbone_size"),
    ("joint", "level_width"),
    ("joint", "patch_frames"),
    ("image_encoder", "width"),
]
"""Fields that may not change alone."""
ON_BACKBONE = {
    "monocular_depth": MonocularDepthConfig(channels=4, image_backbone=True),
    "object_mask": ObjectMaskConfig(width=4, image_backbone=True),
}
"""Parts of a model that may be on the image backbone."""


@pytest.mark.parametrize("name", SIZES)
def test_json_round_trip_is_exact(name: str) -> None:
    config = size_by_name(name)
    assert ModelConfig.from_json(config.to_json()) == config


def test_json_lists_every_field() -> None:
    data = json.loads(test_size().to_json())
    assert set(data) == {field.name for field in dataclasses.fields(ModelConfig)} | {"version"}
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


def test_the_mask_refiner_changes_the_fingerprint() -> None:
    motion = MotionUNetConfig(width=8)
    refined = dataclasses.replace(motion, mask_refiner_width=4)
    configs = [dataclasses.replace(test_size(), motion_unet=one) for one in (motion, refined)]
    assert len({config.fingerprint() for config in (*configs, test_size())}) == 3


def test_a_start_at_the_depth_prior_changes_the_fingerprint_and_needs_one() -> None:
    plane, prior = RefinementConfig(channels=6), RefinementConfig(channels=6, depth_prior=True)
    base = dataclasses.replace(test_size(), monocular_depth=MonocularDepthConfig(channels=8))
    prints = {dataclasses.replace(base, refinement=one).fingerprint() for one in (plane, prior)}
    assert len(prints) == 2
    with pytest.raises(ConfigError, match="false without a depth prior"):
        dataclasses.replace(test_size(), refinement=prior)
    with pytest.raises(ConfigError, match="false without channels"):
        RefinementConfig(depth_prior=True)


def test_the_size_of_the_backbone_changes_the_fingerprint() -> None:
    base = dataclasses.replace(test_size(), motion_unet=MotionUNetConfig(width=8))
    configs = [
        dataclasses.replace(base, **{part: dataclasses.replace(on, backbone_size=size)})
        for part, on in ON_BACKBONE.items()
        for size in get_args(BackboneSize)
    ]
    assert len({config.fingerprint() for config in configs}) == len(configs) == 4


def test_vectors_of_instances_change_the_fingerprint() -> None:
    base = dataclasses.replace(test_size(), motion_unet=MotionUNetConfig(width=8))
    masks = [ObjectMaskConfig(width=4, instance_channels=count) for count in (0, 2, 4)]
    configs = [dataclasses.replace(base, object_mask=mask) for mask in masks]
    assert len({config.fingerprint() for config in configs}) == 3


def test_an_object_mask_that_is_shown_changes_the_fingerprint_and_needs_a_motion_network() -> None:
    motions = [MotionUNetConfig(width=8, object_mask=shown) for shown in (False, True)]
    configs = [dataclasses.replace(test_size(), motion_unet=motion) for motion in motions]
    assert len({config.fingerprint() for config in configs}) == 2
    with pytest.raises(ConfigError, match=r"object_mask: expected false without the network"):
        MotionUNetConfig(object_mask=True)


@pytest.mark.parametrize("weight", [-0.1, math.nan, math.inf])
def test_a_guidance_that_no_model_can_have_is_refused(weight: float) -> None:
    with pytest.raises(ConfigError, match=r"ModelConfig\.default_guidance: expected at least 0"):
        dataclasses.replace(test_size(), default_guidance=weight)


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("fill", ["", None, True, "image"])
def test_an_unknown_fill_is_refused(fill: object) -> None:
    data = json.loads(test_size().to_json()) | {"default_fill": fill}
    with pytest.raises(ConfigError, match=r"ModelConfig\.default_fill: expected none or video"):
        ModelConfig.from_json(json.dumps(data))


@pytest.mark.parametrize("version", [0, 3, "2", True, None, []])
def test_another_version_is_refused(version: object) -> None:
    data = json.loads(test_size().to_json()) | {"version": version}
    with pytest.raises(ConfigError, match=r"expected version 1 or 2, got .*a newer diff4splat"):
        ModelConfig.from_json(json.dumps(data))


def test_parts_that_a_stored_model_does_not_name_are_left_out() -> None:
    data = json.loads(test_size().to_json())
    for later in (
        "refinement",
        "monocular_depth",
        "motion_unet",
        "object_mask",
        "joint",
        "image_encoder",
        "default_fill",
        "default_guidance",
    ):
        del data[later]
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
        (DitConfig, {"blocks": 2**40}, "DitConfig.blocks: expected a whole number of at least 1"),
        (DitConfig, {"width": 2**62}, "DitConfig.width: expected a whole number of at least 1"),
        (DitConfig, {"width": 0}, "DitConfig.width: expected a whole number of at least 1"),
        (DitConfig, {"width": "24"}, "DitConfig.width: expected a whole number"),
        (DitConfig, {"blocks": True}, "DitConfig.blocks: expected a whole number"),
        (DitConfig, {"frequency_width": 15}, "DitConfig.frequency_width: expected an even number"),
        (LdrmConfig, {"grid_stride": 3}, "LdrmConfig.grid_stride: expected 1 or 2"),
        (DitConfig, {"prediction_type": "noise"}, "prediction_type: expected velocity or clean"),
        (DitConfig, {"render_condition": 1}, "DitConfig.render_condition: expected true or false"),
        (LdrmConfig, {"input": "audio"}, "LdrmConfig.input: expected latents or frames"),
        (VaeConfig, {"pca_shortcut": 1}, "VaeConfig.pca_shortcut: expected true or false"),
        (
            VaeConfig,
            {"pca_shortcut": True, "latent_channels": 769},
            "latent_channels: expected at most the 768 values of a block",
        ),
        (RefinementConfig, {"channels": -1}, "channels: expected a whole number of at least 0"),
        (RefinementConfig, {"cost_volume_depths": True}, "depths: expected a whole number"),
        (RefinementConfig, {"match_channels": 0}, "match_channels: expected a whole number"),
        (RefinementConfig, {"border_cells": 6}, "border_cells: expected a multiple of 4, got 6"),
        (RefinementConfig, {"depth_range": (2.0, 1.0)}, "depth_range: expected two rising depths"),
        (RefinementConfig, {"depth_range": ("1", "2")}, "depth_range: expected two rising depths"),
        (RefinementConfig, {"depth_range": None}, "depth_range: expected two rising depths"),
        (MonocularDepthConfig, {"channels": -1}, "channels: expected a whole number of at least 0"),
        (MonocularDepthConfig, {"channels": True}, "channels: expected a whole number"),
        (
            MonocularDepthConfig,
            {"image_backbone": True},
            "MonocularDepthConfig.image_backbone: expected false without the network",
        ),
        *(
            (kind, {**size, **change}, f"{kind.__name__}.backbone_size: expected lite0, or lite2")
            for kind, size in (
                (MonocularDepthConfig, {"channels": 4}),
                (ObjectMaskConfig, {"width": 4}),
            )
            for change in (
                {"backbone_size": "lite2"},
                {"backbone_size": "lite1", "image_backbone": True},
                {"backbone_size": None, "image_backbone": True},
            )
        ),
        (
            ObjectMaskConfig,
            {"image_backbone": True},
            "ObjectMaskConfig.image_backbone: expected false without the network",
        ),
        (MotionUNetConfig, {"heads": 0}, "MotionUNetConfig.heads: expected a whole number"),
        (MotionUNetConfig, {"width": 12}, "width: expected 0 or a multiple of 8, twice the heads"),
        (MotionUNetConfig, {"width": -8}, "width: expected a whole number of at least 0"),
        (MotionUNetConfig, {"width": True}, "width: expected a whole number"),
        (MotionUNetConfig, {"mask_refiner_width": -1}, "mask_refiner_width: expected a whole"),
        (MotionUNetConfig, {"mask_refiner_width": 4}, "expected 0 without the network that it"),
        (DeformationConfig, {"static_threshold_px": -1.0}, "expected a number from 0 on"),
        (VaeConfig, {"widths": (4, 8)}, "VaeConfig.widths: expected at least 3 widths"),
        (VaeConfig, {"widths": (4, 8, -1)}, "VaeConfig.widths: expected whole numbers"),
        (TextConfig, {"max_bytes": 0}, "TextConfig.max_bytes: expected a whole number"),
        (TextConfig, {"relative_position_buckets": 30}, "buckets: expected a multiple of 4"),
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


def test_frames_as_input_need_refinement() -> None:
    config, refinement = test_size(), RefinementConfig(channels=6)
    ldrm = dataclasses.replace(config.ldrm, input="frames")
    with pytest.raises(ConfigError, match="expected latents without a refinement decoder"):
        dataclasses.replace(config, ldrm=ldrm)
    both = dataclasses.replace(config, ldrm=ldrm, refinement=refinement)
    assert ModelConfig.from_json(both.to_json()) == both
    assert both.fingerprint() != dataclasses.replace(config, refinement=refinement).fingerprint()


def test_refinement_needs_whole_pixels_and_tokens_of_sixteen() -> None:
    config, refinement = test_size(), RefinementConfig(channels=6)
    halves = dataclasses.replace(config.ldrm, grid_stride=2)
    with pytest.raises(ConfigError, match="grid_stride: expected 1 with a refinement decoder"):
        dataclasses.replace(config, ldrm=halves, refinement=refinement)
    vae = dataclasses.replace(config.vae, pixel_patch=4)
    with pytest.raises(ConfigError, match=r"tokens of 16 px with a refinement decoder, got 32"):
        dataclasses.replace(config, vae=vae, refinement=refinement)


def test_unknown_size_lists_the_known() -> None:
    with pytest.raises(ConfigError, match="expected test, small, paper, got 'large'"):
        size_by_name("large")


def test_published_numbers() -> None:
    paper = paper_size()
    assert (paper.vae.latent_channels, paper.vae.space_stride) == (32, 8)
    assert (paper.dit.blocks, paper.dit.width) == (32, 4096)
    assert (paper.ldrm.blocks, paper.ldrm.embed_channels) == (16, 64)
    assert (paper.frames, paper.size_px) == (49, (512, 512))
