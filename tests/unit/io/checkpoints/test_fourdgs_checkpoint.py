"""Checkpoints of 4DGaussians: states, settings, and files that are refused."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import oracles_fourdgs as oracles
import pytest
import torch
from oracles_fourdgs import NET, random_cloud, random_state, write_folder

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.checkpoints.fourdgs_checkpoint import read_fourdgs_checkpoint
from diff4splat.io.checkpoints.fourdgs_settings import DEFAULT_HEADS, heads_in_use
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane.decoder import HEAD_NAMES

PARTS = [field.name for field in fields(Gaussians)]


def test_states_are_those_of_the_program(tmp_path: Path) -> None:
    state, cloud = random_state(), random_cloud(50)
    write_folder(tmp_path, state, cloud)
    gaussians, motion = read_fourdgs_checkpoint(tmp_path, duration_s=4.0, heads=HEAD_NAMES)
    for part in (0.0, 0.31, 1.0):
        got, want = motion.state_at(gaussians, 4.0 * part), oracles.moved(state, cloud, part)
        for name in PARTS:
            torch.testing.assert_close(
                getattr(got, name).double(), want[name], rtol=1e-4, atol=1e-4
            )


def test_a_state_computed_by_hand(tmp_path: Path) -> None:
    """Planes of 2 give 2⁶ = 64; the trunk makes 6.4 of it, the head 0.1 · 6.4 + 0.36 = 1."""
    state, cloud = random_state(channels=1, width=1, depth=1, multipliers=(1,)), random_cloud(2)
    for name, tensor in state.items():
        tensor.fill_(2.0 if ".grids." in name else 0.0)
    state[f"{NET}grid.aabb"] = torch.tensor([[1.0] * 3, [-1.0] * 3])
    state[f"{NET}feature_out.0.weight"][:] = 0.1
    state[f"{NET}pos_deform.1.weight"][:] = 0.1
    state[f"{NET}pos_deform.1.bias"][:] = 0.36
    state[f"{NET}pos_deform.3.weight"][:] = torch.tensor([[1.0], [-2.0], [3.0]])
    state[f"{NET}rotations_deform.3.bias"][:] = torch.tensor([0.0, 2.0, 0, 0])
    state[f"{NET}scales_deform.3.bias"][:] = float(np.log(3))
    cloud["rot"][:] = (2.0, 0.0, 0.0, 0.0)
    write_folder(tmp_path, state, cloud)
    gaussians, motion = read_fourdgs_checkpoint(tmp_path)
    moved = motion.state_at(gaussians, 0.7)
    torch.testing.assert_close(moved.means - gaussians.means, torch.tensor([[1.0, -2, 3]] * 2))
    torch.testing.assert_close(moved.scales, 3 * gaussians.scales)
    # Added to a quaternion of length 2: a quarter turn, not the wider one of length 1.
    torch.testing.assert_close(moved.quats, torch.tensor([[0.5**0.5, 0.5**0.5, 0, 0]] * 2))
    assert torch.equal(moved.opacities, gaussians.opacities)


def test_any_folder_of_a_run_leads_to_its_last_iteration(tmp_path: Path) -> None:
    last = write_folder(tmp_path, random_state(), random_cloud(3))
    early = last.parent / "iteration_3000"
    early.mkdir()
    (last.parent / "iteration_final").mkdir()
    for folder in (tmp_path, tmp_path / "point_cloud", last):
        assert len(read_fourdgs_checkpoint(folder)[0]) == 3
    with pytest.raises(FileFormatError, match="iteration_N"):
        read_fourdgs_checkpoint(early)


def test_all_gaussians_move_and_times_are_seconds(tmp_path: Path) -> None:
    write_folder(tmp_path, random_state(), random_cloud(4))
    gaussians, motion = read_fourdgs_checkpoint(tmp_path, duration_s=2.5)
    assert motion.moving_index.tolist() == [0, 1, 2, 3]
    assert motion.time_range_s == (0.0, 2.5)
    assert tuple(motion.decoder.heads) == DEFAULT_HEADS
    assert gaussians.means.dtype == motion.planes.levels[0][0].dtype == torch.float32


@pytest.mark.parametrize(
    ("text", "heads"),
    [
        ("Namespace()", DEFAULT_HEADS),
        ("Namespace(no_do=False, no_dshs=False, bounds=1.6)", HEAD_NAMES),
        ("Namespace(no_dx=False, no_ds=True, no_dr=True, no_do=True)", ("position",)),
        ("Namespace(kplanes_config={'a': [1]}, data=object(), **{'no_do': False})", DEFAULT_HEADS),
    ],
)
def test_settings_say_which_heads_were_in_use(
    tmp_path: Path, text: str, heads: tuple[str, ...]
) -> None:
    iteration = write_folder(tmp_path, random_state(), random_cloud(2), text)
    assert set(heads_in_use(iteration)) == set(heads)
    assert set(read_fourdgs_checkpoint(tmp_path)[1].decoder.heads) == set(heads)


@pytest.mark.parametrize("text", ["", "Namespace(", "3", "\x00", "[" * 5000])
def test_settings_that_are_no_settings_are_refused(tmp_path: Path, text: str) -> None:
    write_folder(tmp_path, random_state(), random_cloud(2), text)
    with pytest.raises(FileFormatError, match="name the heads yourself"):
        read_fourdgs_checkpoint(tmp_path)
    read_fourdgs_checkpoint(tmp_path, heads=("position",))


@pytest.mark.parametrize("switch", ["apply_rotation=True", "static_mlp=True", "grid_pe=2"])
def test_experimental_switches_are_refused(tmp_path: Path, switch: str) -> None:
    write_folder(tmp_path, random_state(), random_cloud(2), f"Namespace({switch})")
    with pytest.raises(FileFormatError, match=switch.partition("=")[0]):
        read_fourdgs_checkpoint(tmp_path)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        (f"{NET}grid.aabb", None, "grid.aabb"),
        (f"{NET}grid.grids.1.3", None, "grid.grids.1.3"),
        (f"{NET}feature_out.0.bias", None, "feature_out.0.bias"),
        (f"{NET}pos_deform.3.weight", None, "pos_deform.3.weight"),
        (f"{NET}grid.grids.0.0", torch.zeros(6, 5), "shape"),
        (f"{NET}grid.grids.0.0", torch.zeros(1, 8, 4, 4), "levels"),
        (f"{NET}feature_out.0.weight", torch.zeros(12, 3), "decoder of 16"),
        (f"{NET}pos_deform.3.weight", torch.zeros(4, 12), "pos_deform.3.bias"),
        (f"{NET}pos_deform.1.weight", torch.full((12, 12), torch.nan), "NaN"),
        (f"{NET}grid.aabb", torch.zeros(2, 3, dtype=torch.int64), "float32"),
        (f"{NET}static_mlp.1.weight", torch.zeros(12, 12), "static_mlp"),
        (f"{NET}empty_voxel.grid", torch.zeros(3), "empty_voxel"),
        (f"{NET}grid.grids.0.6", torch.zeros(3), "grid.grids.0.6"),
        (f"{NET}grid.aabb", "text", "aabb"),
    ],
)
def test_states_that_do_not_fit_are_refused(
    tmp_path: Path, name: str, value: object, message: str
) -> None:
    state = random_state()
    if value is None:
        del state[name]
    else:
        state[name] = value
    write_folder(tmp_path, state, random_cloud(2))
    with pytest.raises(FileFormatError, match=message) as caught:
        read_fourdgs_checkpoint(tmp_path)
    assert "deformation.pth" in str(caught.value) and "\n" not in str(caught.value)


class Harmful:
    """What a pickle may run."""

    ran = False

    def __reduce__(self) -> tuple:
        return _run, ()


def _run() -> None:
    Harmful.ran = True


def test_files_that_would_run_code_are_refused_unread(tmp_path: Path) -> None:
    write_folder(tmp_path, {**random_state(), "x": Harmful()}, random_cloud(2))
    with pytest.raises(FileFormatError, match="would run code"):
        read_fourdgs_checkpoint(tmp_path)
    assert not Harmful.ran


def test_damaged_and_missing_files_are_refused(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, random_state(), random_cloud(2))
    for name in ("deformation.pth", "point_cloud.ply", "deformation_table.pth"):
        file = folder / name
        whole = file.read_bytes()
        for broken in (whole[: len(whole) // 2], b"", b"nothing"):
            file.write_bytes(broken)
            with pytest.raises(FileFormatError, match=name):
                read_fourdgs_checkpoint(folder)
        file.write_bytes(whole)
    (folder / "deformation.pth").unlink()
    with pytest.raises(FileFormatError, match="no such file"):
        read_fourdgs_checkpoint(folder)


def test_tables_are_not_needed_but_must_belong_to_the_gaussians(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, random_state(), random_cloud(2))
    torch.save(torch.ones(3) > 0, folder / "deformation_table.pth")
    with pytest.raises(FileFormatError, match="2 truth values"):
        read_fourdgs_checkpoint(folder)
    (folder / "deformation_table.pth").unlink()
    (folder / "deformation_accum.pth").unlink()
    read_fourdgs_checkpoint(folder)


def test_other_things_than_tensors_by_name_are_refused(tmp_path: Path) -> None:
    write_folder(tmp_path, [torch.zeros(2)], random_cloud(2))
    with pytest.raises(FileFormatError, match="expected dict, got list"):
        read_fourdgs_checkpoint(tmp_path)


def test_a_colour_head_needs_harmonics_of_degree_three(tmp_path: Path) -> None:
    cloud = random_cloud(2)
    cloud["sh"] = cloud["sh"][:, :4]
    write_folder(tmp_path, random_state(), cloud)
    read_fourdgs_checkpoint(tmp_path)
    with pytest.raises(FileFormatError, match="leave the head 'color' out"):
        read_fourdgs_checkpoint(tmp_path, heads=HEAD_NAMES)


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), float("inf")])
def test_durations_that_are_none_are_refused(tmp_path: Path, duration_s: float) -> None:
    with pytest.raises(InputError, match="duration_s"):
        read_fourdgs_checkpoint(tmp_path, duration_s)


def test_unknown_heads_are_refused(tmp_path: Path) -> None:
    write_folder(tmp_path, random_state(), random_cloud(2))
    with pytest.raises(InputError, match="heads"):
        read_fourdgs_checkpoint(tmp_path, heads=("position", "weight"))
