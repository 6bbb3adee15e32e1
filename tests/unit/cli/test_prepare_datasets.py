"""``prepare import`` and ``prepare doctor`` as commands."""

from pathlib import Path
from typing import get_args

import pytest
from toy_datasets import TOYS

from diff4splat.cli.datasets.prepare_datasets import DatasetName
from diff4splat.cli.main import run
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.datasets.registry import DATASETS


def test_every_reader_has_its_name_on_the_command_line() -> None:
    assert get_args(DatasetName) == tuple(DATASETS)


def test_import_writes_shards_report_and_sheet(tmp_path: Path) -> None:
    toy = TOYS["dynamic_replica"]
    toy.write(toy.truth(), tmp_path / "data")
    out = tmp_path / "clips"
    options = ["--dataset", "dynamic_replica", "--out", str(out), "--images", "jpeg"]
    assert run(["prepare", "import", str(tmp_path / "data"), *options, "--max-side", "32"]) == 0
    (entry,) = ClipFolder(out).entries
    assert (entry.size_px, entry.views, entry.dataset) == ((18, 32), 2, "dynamic_replica")
    assert (entry.motion, entry.layers, entry.commercial_ok) == ("tracks", ("depth", "flow"), False)
    assert {"clips.png", "report.csv", "manifest.json"} <= {file.name for file in out.iterdir()}


def test_doctor_prints_a_table_and_writes_a_figure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toy = TOYS["vkitti2"]
    toy.write(toy.truth(), tmp_path / "data")
    figure = tmp_path / "doctor.png"
    command = ["prepare", "doctor", str(tmp_path / "data"), "--dataset", "vkitti2"]
    assert run([*command, "--out", str(figure)]) == 0
    assert "sound: cameras, depth, flow and tracks agree" in capsys.readouterr().out
    assert figure.stat().st_size > 10_000
    next((tmp_path / "data").rglob("depth_00001.png")).write_bytes(b"damaged")
    assert run([*command, "--out", str(figure)]) == 2
    said = capsys.readouterr()
    assert "not readable: " in said.out
    assert "no sequence could be examined" in said.err
