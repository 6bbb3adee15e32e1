"""Numbered PLY files and point maps: key frames where rows match, else one by one."""

from dataclasses import replace
from pathlib import Path

import foreign_files
import numpy as np
import pytest
import torch

from diff4splat.errors import FileFormatError
from diff4splat.io.checkpoints.import_scene import import_scene
from diff4splat.io.imports.ply_sequence import numbered_files
from diff4splat.io.ply.ply_file import write_ply_sequence
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.spacetime import SpacetimeMotion


def same_covariances(left: Gaussians, right: Gaussians) -> None:
    torch.testing.assert_close(left.means, right.means, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(left.scales, right.scales, atol=1e-5, rtol=1e-4)
    assert float((left.quats * right.quats).sum(-1).abs().min()) > 1 - 1e-5


def test_files_in_one_order_become_key_frames_of_what_moves(tmp_path: Path) -> None:
    states = foreign_files.moving_cloud()
    folder = foreign_files.write_sequence(states, tmp_path / "frames")
    imported = import_scene(folder, fps=10.0)
    motion = imported.scene.motion
    assert isinstance(motion, KeyframeMotion)
    assert imported.notes == ("4 files became key times, 10 Gaussians move",)
    torch.testing.assert_close(motion.key_times_s, torch.tensor([0.0, 0.1, 0.2, 0.3]))
    for number, state in enumerate(states):
        same_covariances(imported.scene.state_at(number / 10), state)


def test_our_own_sequence_keeps_its_times(tmp_path: Path) -> None:
    scene = import_scene(
        foreign_files.write_sequence(foreign_files.moving_cloud(), tmp_path / "a"), fps=10.0
    ).scene
    write_ply_sequence(scene, tmp_path / "b", [0.0, 0.05, 0.3])
    again = import_scene(tmp_path / "b").scene
    torch.testing.assert_close(again.motion.key_times_s, torch.tensor([0.0, 0.05, 0.3]))
    same_covariances(again.state_at(0.05), scene.state_at(0.05))


def test_numbers_order_the_files_and_the_largest_set_counts(tmp_path: Path) -> None:
    folder = foreign_files.write_sequence(foreign_files.moving_cloud(), tmp_path / "frames")
    (folder / "other1.ply").write_bytes(b"")
    (folder / "splat_11.ply").rename(folder / "splat_0003.compressed.ply")
    names = [file.name for file in numbered_files(folder)]
    assert names == ["splat_0003.compressed.ply", "splat_8.ply", "splat_9.ply", "splat_10.ply"]


def shuffled(states: list[Gaussians]) -> list[Gaussians]:
    torch.manual_seed(1)
    plain = [replace(s, sh=torch.zeros_like(s.sh), opacities=s.opacities * 0 + 0.5) for s in states]
    return [s.select(torch.randperm(len(s))) for s in plain]


def changed_count(states: list[Gaussians]) -> list[Gaussians]:
    return [s.select(slice(0, 10 + i)) for i, s in enumerate(states)]


def changed_color(states: list[Gaussians]) -> list[Gaussians]:
    return [replace(s, sh=s.sh + i) for i, s in enumerate(states)]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (changed_count, "numbers of Gaussians differ"),
        (changed_color, "colours change"),
        (shuffled, "order changes"),
    ],
)
def test_other_files_are_kept_one_by_one(tmp_path: Path, change, reason: str) -> None:
    states = change(foreign_files.moving_cloud())
    imported = import_scene(foreign_files.write_sequence(states, tmp_path / "frames"), fps=10.0)
    assert isinstance(imported.scene.motion, SpacetimeMotion)
    assert reason in imported.notes[0]
    start = 0
    for number, state in enumerate(states):
        for shift_s in (0.0, 0.04, -0.04):
            now = imported.scene.state_at(number / 10 + shift_s)
            visible = now.opacities > 0
            rows = torch.arange(start, start + len(state))
            assert torch.equal(visible.nonzero()[:, 0], rows)
            torch.testing.assert_close(now.opacities[rows], state.opacities, atol=1e-4, rtol=0)
        start += len(state)


def test_point_maps_become_gaussians_of_their_pixels(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", **foreign_files.point_maps())
    imported = import_scene(tmp_path / "a.npz", fps=2.0)
    scene = imported.scene
    assert len(scene.gaussians) == 3 * (6 * 8 - 1)
    assert "one by one" in imported.notes[0]
    torch.testing.assert_close(scene.gaussians.scales.median(), torch.tensor(0.0625))
    visible = scene.state_at(0.5).opacities > 0
    assert int(visible.sum()) == 47
    assert float(scene.gaussians.means[visible, 2].min()) >= 3


def test_one_point_map_is_static(tmp_path: Path) -> None:
    maps = {name: value[0] for name, value in foreign_files.point_maps().items()}
    np.savez(tmp_path / "a.npz", xyz=maps["points"], images=maps["colors"] / np.float32(255))
    scene = import_scene(tmp_path / "a.npz").scene
    assert len(scene.motion.moving_index) == 0
    assert len(scene.gaussians) == 47


@pytest.mark.parametrize(
    "change",
    [
        {"points": np.zeros((2, 3), "f4")},
        {"colors": np.zeros((3, 6, 7, 3), "u1")},
        {"points": np.full((3, 6, 8, 3), np.nan, "f4")},
        {"times_s": np.array([0.0, 1.0, 1.0])},
        {"mask": np.zeros(5, bool)},
        {"points": np.array([{}])},
    ],
    ids=range(6),
)
def test_other_arrays_are_refused(tmp_path: Path, change: dict) -> None:
    np.savez(tmp_path / "a.npz", **foreign_files.point_maps() | change)
    with pytest.raises(FileFormatError, match=r"a\.npz: "):
        import_scene(tmp_path / "a.npz")
