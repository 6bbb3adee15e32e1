"""The shipped size on the demo's picture, as ``make demo`` runs it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from diff4splat.cli.main import run

EXAMPLE = Path(__file__).parents[2] / "examples" / "make_world_picture.py"


@pytest.mark.slow
def test_the_demo_from_picture_to_folder(tmp_path: Path) -> None:
    picture, out = tmp_path / "picture.jpg", tmp_path / "scene"
    subprocess.run([sys.executable, str(EXAMPLE), str(picture)], check=True)
    arguments = ["generate", str(picture), "--out", str(out), "--camera", "arc:0.2"]
    assert run([*arguments, "--frames", "9", "--prompt", "a turquoise block slides"]) == 0
    card = json.loads((out / "card.json").read_text())
    assert card["first_view_psnr_db"] >= 28
    assert card["scene"]["gaussians"] > 50_000
    assert card["peak_memory_bytes"] < 4 * 2**30
