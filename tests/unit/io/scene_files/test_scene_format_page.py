"""The page about the scene file tells the truth, and its reader runs."""

import re
from pathlib import Path
from typing import Any

import coded_scenes
import numpy as np
import oracles_io
import oracles_spacetime
import pytest

from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.io.scene_files.tensor_file import read_tensors

PAGE = Path(__file__).parents[4] / "docs" / "reference" / "scene-format.md"


def test_the_printed_reader_runs_and_is_short(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(code.strip().splitlines()) <= 40
    assert set(re.findall(r"^(?:import|from) (\w+)", code, re.MULTILINE)) == {"json", "safetensors"}
    save_scene(oracles_io.scene(), tmp_path / "scene.safetensors")
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    said = capsys.readouterr().out
    _reads_coded_files(code)
    assert "2 move; at 0.00 s:" in said
    assert "4 Gaussians, the first at [-0.25" in said


def _reads_coded_files(code: str) -> None:
    for kind in ("keyframes", "spacetime", "hexplane"):
        save_scene(coded_scenes.scene(kind), "scene.safetensors", "standard")
        names: dict[str, Any] = {}
        exec(code, names)
        want, _ = coded_scenes.read_plainly(Path("scene.safetensors"))
        assert names["tensors"].keys() == want.keys()
        for name, value in names["tensors"].items():
            assert value.dtype == want[name].dtype
            np.testing.assert_allclose(value, want[name], rtol=1e-6, atol=1e-12, err_msg=name)


def test_the_tables_name_every_tensor_with_its_shape() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \| (\w(?:, \w)*) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    sizes = {"n": 4, "k": 4, "m": 2, "t": 3, "w": 2, "f": 2}
    want = {
        name: tuple(sizes[axis] if axis in sizes else int(axis) for axis in shape.split(", "))
        for name, shape in rows
    }
    files = (oracles_io.GOLDEN, oracles_spacetime.GOLDEN)
    got = {name: tuple(value.shape) for file in files for name, value in read_tensors(file).items()}
    assert want == got
