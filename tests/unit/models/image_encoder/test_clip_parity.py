"""CLIP's vision transformer: states are those of transformers, before its last layer."""

from pathlib import Path

import numpy as np
import pytest
import torch
import wan_folder
from imported_models import imported, wan_source
from PIL import Image

from diff4splat.models.hub.model import load_model
from diff4splat.models.image_encoder.clip import ClipImageEncoder, clip_pixels
from diff4splat.models.image_encoder.public_weights import image_encoder_key

__all__ = ["imported", "wan_source"]


@pytest.fixture
def encoder(imported: dict[str, Path]) -> ClipImageEncoder:
    return load_model(imported["i2v"], parts=("image_encoder",)).networks.image_encoder


@torch.no_grad()
def test_states_are_those_of_transformers(encoder: ClipImageEncoder) -> None:
    pixels = torch.randn(2, 3, 28, 28)
    want = wan_folder.image_encoder()(pixels, output_hidden_states=True).hidden_states[-2]
    got = encoder(pixels)
    assert float((got - want).abs().max() / want.abs().max()) < 1e-5


@torch.no_grad()
def test_half_precision_is_as_exact_as_that_of_transformers(encoder: ClipImageEncoder) -> None:
    pixels, theirs = torch.randn(1, 3, 28, 28), wan_folder.image_encoder()
    want = theirs(pixels, output_hidden_states=True).hidden_states[-2]
    half = theirs.bfloat16()(pixels.bfloat16(), output_hidden_states=True).hidden_states[-2]
    got = encoder.to(torch.bfloat16)(pixels.bfloat16()).float()
    assert (got - want).abs().max() < 1.5 * (half.float() - want).abs().max() + 0.01


@pytest.mark.parametrize("size", [(224, 224), (300, 411), (512, 256), (90, 130)])
def test_images_are_prepared_as_transformers_does(size: tuple[int, int]) -> None:
    transformers = pytest.importorskip("transformers", reason="needs the package transformers")
    rows, columns = np.mgrid[: size[0], : size[1]]
    waves = np.stack([np.sin(rows / 9), np.cos(columns / 7), np.sin((rows + columns) / 11)], -1)
    pixels = np.uint8(127.5 + 127.5 * waves)
    processor = getattr(transformers, "CLIPImageProcessorPil", transformers.CLIPImageProcessor)()
    want = torch.as_tensor(
        np.asarray(processor(Image.fromarray(pixels), return_tensors="np")["pixel_values"])
    )
    image = torch.from_numpy(pixels).movedim(-1, 0)[None] / 255
    got = clip_pixels(image, 224)
    # There resized colours are whole numbers.
    assert float((got - want).abs().max()) < 2 / 255 / 0.26


def test_what_comes_after_the_states_is_not_needed() -> None:
    assert image_encoder_key("vision_model.post_layernorm.weight", 2) is None
    assert image_encoder_key("vision_model.encoder.layers.2.mlp.fc1.weight", 2) is None
    assert image_encoder_key("visual_projection.weight", 2) is None
    assert image_encoder_key("vision_model.surprise", 2) == "surprise"
