"""The shipped size on the demo's picture, as ``make demo`` runs it."""

import json
import runpy
from pathlib import Path

import pytest

from diff4splat.cli.main import run

EXAMPLE = Path(__file__).parents[2] / "examples" / "make_picture.py"


@pytest.mark.slow
def test_the_demo_from_picture_to_folder(tmp_path: Path) -> None:
    make_picture = runpy.run_path(str(EXAMPLE))["make_picture"]
    make_picture(width=960, seed=7).save(tmp_path / "picture.jpg", quality=95)
    out = tmp_path / "scene"
    arguments = ["generate", str(tmp_path / "picture.jpg"), "--out", str(out)]
    assert run([*arguments, "--frames", "9", "--prompt", "clouds drift"]) == 0
    card = json.loads((out / "card.json").read_text())
    assert card["first_view_psnr_db"] >= 28
    assert card["scene"]["gaussians"] > 50_000
    assert card["peak_memory_bytes"] < 4 * 2**30
