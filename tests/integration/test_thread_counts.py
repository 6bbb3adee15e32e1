"""One seed is one scene, on any number of cores."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from wave_images import waves

from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.io.scene_files.scene_file import save_scene


@pytest.fixture(autouse=True)
def restore_threads() -> Iterator[None]:
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize("side_px", [64, pytest.param(192, marks=pytest.mark.slow)])
@pytest.mark.parametrize("prompt", [None, "the blue ball moves to the left"])
def test_the_scene_file_has_the_same_bytes(
    side_px: int, prompt: str | None, tmp_path: Path
) -> None:
    image, pipeline = waves(side_px), Diff4SplatPipeline.from_pretrained("small")
    files = []
    for threads in (1, 2, 3):
        torch.set_num_threads(threads)
        scene = pipeline(image, "arc:0.1", prompt)
        assert torch.get_num_threads() == threads
        files.append(tmp_path / f"{threads}.safetensors")
        save_scene(scene, files[-1])
    assert len({file.read_bytes() for file in files}) == 1
