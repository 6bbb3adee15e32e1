"""PLY, SPZ and GLB against SplatTransform: what it makes of our files, and we of its.

npm install @playcanvas/splat-transform; then name its program in SPLAT_TRANSFORM, or have it in
the path.
"""

import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from filmed_scenes import filmed_scene

from diff4splat.io.ply.ply_file import write_ply
from diff4splat.io.splats.axes import half_turn
from diff4splat.io.splats.formats import SPLAT_FORMATS
from diff4splat.io.spz.spz_file import write_spz
from diff4splat.outputs.export_check import check_states
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

PROGRAM = os.environ.get("SPLAT_TRANSFORM") or shutil.which("splat-transform")
pytestmark = pytest.mark.skipif(
    PROGRAM is None, reason="npm install @playcanvas/splat-transform; SPLAT_TRANSFORM names it"
)
FLOORS_DB = {".ply": 50.0, ".glb": 50.0, ".compressed.ply": 38.0}
SAME_DB = 50.0
"""Between two readers of one file."""


def scene() -> Scene:
    """Colours depend on the view; no two sizes are the same, as in scenes of photographs."""
    plain = filmed_scene(3, (90, 120), side=12)
    torch.manual_seed(0)
    count = len(plain.gaussians)
    gaussians = Gaussians(
        means=plain.gaussians.means,
        quats=torch.nn.functional.normalize(torch.randn(count, 4), dim=-1),
        scales=plain.gaussians.scales * torch.rand(count, 3).mul(0.8).exp(),
        opacities=torch.rand(count) * 0.6 + 0.3,
        sh=torch.cat([plain.gaussians.sh, 0.1 * torch.randn(count, 15, 3)], 1),
    )
    return Scene(
        gaussians=gaussians,
        motion=plain.motion,
        path=plain.path,
        provenance=plain.provenance,
    )


def transformed(source: Path, target: Path, *options: str) -> Path:
    command = [PROGRAM, "--overwrite", "--quiet", *options, str(source), str(target)]
    subprocess.run(command, check=True, timeout=120, capture_output=True)
    return target


def read(file: Path) -> Gaussians:
    found = SPLAT_FORMATS[file.suffix].read(file).gaussians
    # Its GLB files face the other way: forward is z there, -z in ours.
    return half_turn(found, "y") if file.suffix == ".glb" else found


def worst_db(left: Gaussians, right: Gaussians) -> float:
    shown = replace(scene(), gaussians=left, motion=StaticMotion())
    return check_states(shown, lambda _: right, [0.0], "ours", 0.0).worst_db


def first_state() -> Gaussians:
    made = scene()
    return made.state_at(made.motion.time_range_s[0])


@pytest.mark.parametrize("ending", FLOORS_DB)
def test_our_ply_through_its_writers_and_our_readers(tmp_path: Path, ending: str) -> None:
    write_ply(first_state(), tmp_path / "a.ply")
    found = read(transformed(tmp_path / "a.ply", tmp_path / f"b{ending}"))
    assert worst_db(first_state(), found) >= FLOORS_DB[ending]


@pytest.mark.parametrize("version", ["3", "4"])
def test_its_spz_is_what_ours_is(tmp_path: Path, version: str) -> None:
    write_ply(first_state(), tmp_path / "a.ply")
    write_spz(first_state(), tmp_path / "a.spz")
    target = transformed(tmp_path / "a.ply", tmp_path / "b.spz", "--spz-version", version)
    assert worst_db(read(tmp_path / "a.spz"), read(target)) >= SAME_DB


@pytest.mark.parametrize("version", [3, 4])
def test_our_spz_through_its_reader(tmp_path: Path, version: int) -> None:
    if version == 4:
        pytest.importorskip("zstandard", reason="pip install 'diff4splat[spz]'")
    write_spz(first_state(), tmp_path / "a.spz", version=version)
    theirs = read(transformed(tmp_path / "a.spz", tmp_path / "b.ply"))
    assert worst_db(read(tmp_path / "a.spz"), theirs) >= SAME_DB
