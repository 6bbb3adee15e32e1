"""I3D against modules of torch written apart, with random weights of a user's file."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from oracles_i3d import random_i3d
from safetensors.torch import save_file

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.metrics.features.i3d import I3d, read_i3d
from diff4splat.metrics.features.protocol import VideoFeatures

SIDE_PX = 40


@pytest.fixture(scope="module")
def weights_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("i3d") / "rgb.pt"
    torch.save(random_i3d().state_dict(), file)
    return file


@pytest.mark.parametrize("frames", [1, 8, 9])
def test_it_is_the_network(weights_file: Path, frames: int) -> None:
    features = replace(read_i3d(weights_file), side_px=SIDE_PX)
    generator = torch.Generator().manual_seed(frames)
    videos = torch.rand(2, frames, 3, SIDE_PX, SIDE_PX, generator=generator)
    with torch.no_grad():
        wanted = random_i3d()(2 * videos.transpose(1, 2) - 1)
    found = features.embed_videos(videos)
    assert found.shape == (2, 5)
    assert float(wanted.std()) > 1e-3
    assert torch.allclose(found, wanted, rtol=1e-3, atol=1e-4 * float(wanted.abs().max()))


def test_other_sizes_are_resized(weights_file: Path) -> None:
    features = replace(read_i3d(weights_file), side_px=SIDE_PX)
    assert isinstance(features, VideoFeatures)
    assert features.name.startswith("I3D (weights ")
    grey = torch.full((1, 4, 3, 20, 30), 0.5)
    whole = features.embed_videos(torch.full((1, 4, 3, SIDE_PX, SIDE_PX), 0.5))
    assert torch.allclose(features.embed_videos(grey), whole, atol=1e-5)


def test_other_files_are_refused(weights_file: Path, tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="expected a weight file, got none"):
        read_i3d(tmp_path / "absent.pt")
    other = tmp_path / "other.safetensors"
    save_file({"weight": torch.zeros(3)}, other)
    with pytest.raises(CheckpointError, match="I3D weights: missing"):
        read_i3d(other)
    weights = torch.load(weights_file, weights_only=True)
    weights["Mixed_3b.b0.bn.weight"] = torch.zeros(3)
    torch.save(weights, tmp_path / "shape.pt")
    with pytest.raises(CheckpointError, match="wrong shape"):
        read_i3d(tmp_path / "shape.pt")
    (tmp_path / "damaged.pt").write_bytes(b"PK\x03\x04 no")
    with pytest.raises(FileFormatError):
        read_i3d(tmp_path / "damaged.pt")


def test_weights_tell_networks_apart() -> None:
    one, other = (I3d(weights={"a": torch.full((2,), value)}) for value in (0.0, 1.0))
    assert one.name != other.name
