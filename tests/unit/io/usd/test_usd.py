"""OpenUSD: its own interpolation between samples shows what the scene shows."""

from dataclasses import replace
from pathlib import Path

import oracles_io
import pytest
import torch

from diff4splat.errors import MissingExtraError
from diff4splat.io.usd.sample_times import between_s, sample_times_s
from diff4splat.io.usd.usd_file import UsdReader, require_usd, write_usd
from diff4splat.scene.gaussians import Gaussians


def test_between_samples_positions_follow_lines_and_rotations_slerp(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="pip install 'diff4splat[usd]'")
    scene = oracles_io.scene()
    straight = replace(
        scene.motion,
        interpolation="linear",
        log_scale_offsets=scene.motion.log_scale_offsets * 0,
    )
    scene = replace(scene, motion=straight)
    times_s = sample_times_s(straight)
    write_usd(scene, tmp_path / "a.usda", times_s)
    reader = UsdReader(tmp_path / "a.usda")
    for time_s in (-1.0, *times_s, *between_s(times_s, 5), 9.0):
        got, want = reader.state_at(time_s), scene.state_at(time_s)
        for name in ("means", "scales", "opacities", "sh"):
            torch.testing.assert_close(getattr(got, name), getattr(want, name), atol=1e-6, rtol=0)
        quats = torch.nn.functional.normalize(want.quats, dim=-1)
        assert float((quats * got.quats).sum(-1).abs().min()) > 1 - 1e-6
    assert isinstance(got, Gaussians)
    text = (tmp_path / "a.usda").read_text()
    assert "scales.timeSamples" not in text and "positions.timeSamples" in text


def test_halving_puts_samples_between() -> None:
    motion = oracles_io.scene().motion
    assert sample_times_s(motion, 1) == [0.0, 0.25, 0.5, 1.25, 2.0]
    assert sample_times_s(oracles_io.scene(moving=False).motion, 3) == [0.0]


def test_without_the_package_one_line_says_what_to_do(monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pxr", None)
    with pytest.raises(MissingExtraError, match=r"diff4splat\[usd\]"):
        require_usd()
