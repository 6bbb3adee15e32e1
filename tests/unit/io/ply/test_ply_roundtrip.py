"""INRIA PLY: the layout on disk against an independent reader, and the way back."""

import math
from dataclasses import fields, replace
from pathlib import Path

import oracles_io
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import InputError
from diff4splat.geometry import quaternion
from diff4splat.io.ply.ply_file import read_ply, write_ply
from diff4splat.scene.gaussians import Gaussians

NAMES = [field.name for field in fields(Gaussians)]


def assert_equal_to_rounding(want: Gaussians, got: Gaussians) -> None:
    """A logarithm of size up to 87 in float32 costs up to 87·2⁻²⁴ relative after exp."""
    want = replace(want, quats=quaternion.normalize(want.quats))
    for name in NAMES:
        assert getattr(got, name).dtype == torch.float32
        torch.testing.assert_close(
            getattr(got, name), getattr(want, name).float(), rtol=6e-6, atol=1e-7, msg=name
        )


@pytest.mark.parametrize("k", [1, 4, 9, 16])
@pytest.mark.parametrize("n", [0, 1, 5])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_what_is_written_comes_back(tmp_path: Path, n: int, k: int, dtype: torch.dtype) -> None:
    want = oracles_io.gaussians(n, k, dtype)
    write_ply(want, tmp_path / "a.ply")
    assert_equal_to_rounding(want, read_ply(str(tmp_path / "a.ply")))


def test_the_columns_hold_what_the_format_says(tmp_path: Path) -> None:
    want = oracles_io.gaussians(3, 4, torch.float64)
    write_ply(want, tmp_path / "a.ply", comments=("time_s 0.5",))
    comments, names, rows = oracles_io.read_ply_plainly((tmp_path / "a.ply").read_bytes())
    assert "time_s 0.5" in comments
    assert "color space sRGB-referred" in comments
    assert names == [
        *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"),
        *(f"f_rest_{i}" for i in range(9)),
        *("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
    ]
    for i, row in enumerate(rows):
        opacity = float(want.opacities[i])
        assert [row["x"], row["y"], row["z"]] == want.means[i].tolist()
        assert [row["nx"], row["ny"], row["nz"]] == [0, 0, 0]
        assert row["opacity"] == pytest.approx(math.log(opacity / (1 - opacity)), rel=1e-6)
        for axis in range(3):
            assert row[f"scale_{axis}"] == pytest.approx(math.log(want.scales[i, axis]), rel=1e-6)
        for part in range(4):
            assert row[f"rot_{part}"] == pytest.approx(float(want.quats[i, part]))
        for channel in range(3):
            assert row[f"f_dc_{channel}"] == float(want.sh[i, 0, channel])
            for harmonic in range(3):
                stored = row[f"f_rest_{channel * 3 + harmonic}"]
                assert stored == float(want.sh[i, 1 + harmonic, channel]), "not channel-major"


def test_the_ends_of_every_range_stay_finite(tmp_path: Path) -> None:
    extreme = replace(
        oracles_io.gaussians(4, 1),
        opacities=torch.tensor([0.0, 1.0, 1e-30, 1 - 6e-8]),
        scales=torch.tensor([[0.0, 1e-38, 1e-6], [1e3, 1e30, 3e37], [1, 1, 1], [1, 1, 1]]),
        quats=torch.tensor([[0.0, 0, 0, 0], [1e-30, 0, 0, 0], [3e30, 0, 0, 3e30], [-2, 0, 0, 0]]),
    )
    write_ply(extreme, tmp_path / "a.ply")
    _, _, rows = oracles_io.read_ply_plainly((tmp_path / "a.ply").read_bytes())
    assert all(math.isfinite(value) for row in rows for value in row.values())
    back = read_ply(tmp_path / "a.ply")
    assert back.opacities[1] == 1
    assert_equal_to_rounding(extreme, back)


@given(
    logit=st.floats(-80, 80),
    log_scale=st.floats(-80, 80),
    mean=st.floats(-1e30, 1e30),
    quat=st.lists(st.floats(-1, 1), min_size=4, max_size=4),
)
@settings(max_examples=25, deadline=None)
def test_any_values_survive(
    tmp_path_factory: pytest.TempPathFactory,
    logit: float,
    log_scale: float,
    mean: float,
    quat: list[float],
) -> None:
    file = tmp_path_factory.mktemp("p") / "a.ply"
    want = replace(
        oracles_io.gaussians(1, 1),
        opacities=torch.tensor([logit]).sigmoid(),
        scales=torch.full((1, 3), log_scale).exp(),
        means=torch.full((1, 3), mean),
        quats=torch.tensor([quat]),
    )
    write_ply(want, file)
    assert_equal_to_rounding(want, read_ply(file))


def test_equal_gaussians_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("a.ply", "b.ply"):
        write_ply(oracles_io.gaussians(), tmp_path / name)
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()


def test_gradients_are_left_behind(tmp_path: Path) -> None:
    tracked = replace(oracles_io.gaussians(), means=torch.zeros(4, 3, requires_grad=True))
    write_ply(tracked, tmp_path / "a.ply")
    assert not read_ply(tmp_path / "a.ply").means.requires_grad


def test_comments_cannot_damage_the_header(tmp_path: Path) -> None:
    write_ply(
        oracles_io.gaussians(2), tmp_path / "a.ply", comments=("a\nelement vertex 9\r", "grün", "")
    )
    comments, _, rows = oracles_io.read_ply_plainly((tmp_path / "a.ply").read_bytes())
    assert "a element vertex 9" in comments
    assert "gr?n" in comments
    assert len(rows) == 2
    assert len(read_ply(tmp_path / "a.ply")) == 2


@pytest.mark.parametrize(
    ("name", "bad", "says"),
    [
        ("means", float("nan"), "got 1 of 4 NaN, infinite or too large in 'y'"),
        ("means", 1e39, "too large in 'y'"),
        ("scales", float("inf"), "in 'scale_1'"),
        ("quats", float("nan"), "in 'rot_"),
        ("sh", float("-inf"), "in 'f_rest_"),
    ],
)
def test_values_that_no_viewer_can_show_are_refused(
    tmp_path: Path, name: str, bad: float, says: str
) -> None:
    good = oracles_io.gaussians(dtype=torch.float64)
    value = getattr(good, name).clone()
    value[2, 1] = bad
    with pytest.raises(InputError, match="expected finite Gaussians") as caught:
        write_ply(replace(good, **{name: value}), tmp_path / "a.ply")
    assert says in str(caught.value)
    assert list(tmp_path.iterdir()) == []
