"""The bundled model: on images of two sizes, and on the demo's as ``make demo`` runs it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from wave_images import waves

from diff4splat.cli.main import run
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.metrics.image import psnr
from diff4splat.render.api import render

EXAMPLE = Path(__file__).parents[2] / "examples" / "make_world_picture.py"


@pytest.mark.parametrize(
    ("side_px", "parts"),
    [(64, {"monocular_depth"}), (256, {"monocular_depth", "image_inpainting"})],
)
def test_an_image_without_a_prompt_needs_its_depth_alone(side_px: int, parts: set[str]) -> None:
    """And a photograph what inpaints it."""
    image, pipeline = waves(side_px), Diff4SplatPipeline.from_pretrained("small")
    scene = pipeline(image, "arc:0.1")
    assert pipeline.model.loaded == parts
    assert scene.provenance.weights_sha256 == pipeline.model.weights_sha256(parts)
    assert not scene.provenance.untrained
    assert scene.dilation_px2 == 0
    assert len(scene.gaussians) > 3 * side_px**2
    assert float(psnr(render(scene, image.camera).rgb.clamp(0, 1), image.rgb)) >= 50


def test_every_network_runs_where_the_video_model_fills() -> None:
    image, pipeline = waves(64), Diff4SplatPipeline.from_pretrained("small")
    settings = GenerationSettings(fill="video", steps=1)
    scene = pipeline(image, "arc:0.1", "the blue ball moves to the left", settings=settings)
    assert pipeline.model.loaded == set(pipeline.model.parts) - {"image_inpainting"}
    assert not scene.provenance.untrained
    assert float(psnr(render(scene, image.camera).rgb.clamp(0, 1), image.rgb)) >= 50


@pytest.mark.slow
def test_the_demo_from_image_to_folder(tmp_path: Path) -> None:
    image, out = tmp_path / "image.jpg", tmp_path / "scene"
    subprocess.run([sys.executable, str(EXAMPLE), str(image)], check=True)
    arguments = ["generate", str(image), "--out", str(out), "--camera", "arc:0.2"]
    assert run([*arguments, "--frames", "9", "--prompt", "a turquoise block slides"]) == 0
    card = json.loads((out / "card.json").read_text())
    assert card["first_view_psnr_db"] >= 28
    assert card["scene"]["gaussians"] > 50_000
    assert card["peak_memory_bytes"] < 4 * 2**30
