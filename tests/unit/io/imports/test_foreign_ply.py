"""PLY files of SHARP, AnySplat, SuperSplat and Spacetime Gaussians."""

from pathlib import Path

import foreign_files
import numpy as np
import pytest
import torch
from oracles_render import random_gaussians

from diff4splat.errors import FileFormatError
from diff4splat.io.checkpoints.import_scene import import_scene
from diff4splat.io.ply.ply_body import read_columns
from diff4splat.io.ply.ply_file import read_ply, read_ply_content
from diff4splat.io.ply.ply_header import read_header
from diff4splat.scene.harmonics import color_from_dc
from diff4splat.scene.motion.polynomial import PolynomialMotion, linearised


def cloud(count: int = 7):
    return random_gaussians(count, dtype=torch.float32)


def written(tmp_path: Path, content: bytes) -> Path:
    (tmp_path / "a.ply").write_bytes(content)
    return tmp_path / "a.ply"


def test_the_camera_of_sharp_becomes_the_path(tmp_path: Path) -> None:
    imported = import_scene(written(tmp_path, foreign_files.sharp_ply(cloud())))
    camera = imported.scene.path.cameras[0]
    assert camera.size_px == (48, 64) and camera.focal_px.tolist() == [50, 50]
    torch.testing.assert_close(imported.scene.gaussians.means, cloud().means)
    assert imported.notes == ()


def test_linear_colours_become_srgb(tmp_path: Path) -> None:
    plain = read_ply(written(tmp_path, foreign_files.sharp_ply(cloud())))
    content = read_ply_content(written(tmp_path, foreign_files.sharp_ply(cloud(), 1)))
    linear = color_from_dc(plain.sh[:, 0]).clamp_min(0)
    again = color_from_dc(content.gaussians.sh[:, 0])
    back = torch.where(again <= 0.04045, again / 12.92, ((again + 0.055) / 1.055) ** 2.4)
    torch.testing.assert_close(back, linear, atol=1e-5, rtol=1e-5)
    assert "sRGB" in content.notes[0]


def test_a_camera_that_makes_no_sense_is_left_out(tmp_path: Path) -> None:
    content = foreign_files.sharp_ply(cloud())
    huge = content.replace(
        np.array([64, 48], "<u4").tobytes(), np.array([0, 9**9], "<u4").tobytes()
    )
    assert read_ply_content(written(tmp_path, huge)).camera is None
    cut = content[: -len(content) // 50]
    assert len(read_ply_content(written(tmp_path, cut)).gaussians) == 7


def test_the_fourth_degree_of_anysplat_is_left_out(tmp_path: Path) -> None:
    content = read_ply_content(written(tmp_path, foreign_files.anysplat_ply(cloud())))
    sh = content.gaussians.sh
    assert sh.shape == (7, 16, 3)
    torch.testing.assert_close(sh[0, 1:, 1], torch.arange(24, 39) / 100)
    assert content.notes == ("not imported: harmonics of degree 4",)


def test_compressed_fields_are_where_they_belong(tmp_path: Path) -> None:
    got = read_ply(written(tmp_path, foreign_files.compressed_ply()))
    torch.testing.assert_close(got.means, torch.tensor([[1.0, 2, 3]]).repeat(5, 1))
    torch.testing.assert_close(got.scales, torch.full((5, 3), np.exp(-6.0)).float())
    torch.testing.assert_close(got.opacities, torch.ones(5))
    rgb = color_from_dc(got.sh[0, 0])
    torch.testing.assert_close(rgb, torch.tensor([1.0, 128 / 255, 0.0]), atol=1e-6, rtol=0)
    torch.testing.assert_close(got.sh[0, 1], torch.tensor([4.0, 4.0, 4.0]))
    assert float(got.quats[0, 0]) > 0.999


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"element chunk 1", b"element chunx 1"),
        (b"property uint packed_color", b"property int  packed_color"),
        (b"float max_scale_z", b"float max_scale_q"),
        (b"uchar f_rest_8", b"uchar f_rest_9"),
    ],
)
def test_damaged_compressed_files_are_refused(tmp_path: Path, old: bytes, new: bytes) -> None:
    content = foreign_files.compressed_ply()
    assert old in content
    with pytest.raises(FileFormatError, match=r"a\.ply: "):
        read_ply(written(tmp_path, content.replace(old, new)))


def test_spacetime_gaussians_follow_the_formula_of_the_paper(tmp_path: Path) -> None:
    file = written(tmp_path, foreign_files.spacetime_ply())
    scene = import_scene(file).scene
    data = file.read_bytes()
    c = {k: v.astype("f8") for k, v in read_columns(data, read_header(data), "vertex").items()}
    dt = 0.37 - c["trbf_center"]
    x = c["x"] + c["motion_0"] * dt + c["motion_3"] * dt**2 + c["motion_6"] * dt**3
    opacity = 1 / (1 + np.exp(-c["opacity"])) * np.exp(-((dt / np.exp(c["trbf_scale"])) ** 2))
    quat = np.stack([c[f"rot_{i}"] + c[f"omega_{i}"] * dt for i in range(4)], 1)
    state = scene.state_at(0.37)
    np.testing.assert_allclose(state.means[:, 0], x, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(state.opacities, opacity, rtol=1e-5)
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    np.testing.assert_allclose(state.quats, quat, atol=1e-5)
    np.testing.assert_allclose(color_from_dc(state.sh[:, 0])[:, 0], c["f_dc_0"], atol=1e-6)


def test_a_colour_network_is_named(tmp_path: Path) -> None:
    imported = import_scene(written(tmp_path, foreign_files.spacetime_ply(network=True)))
    assert "colour network" in imported.notes[0]


def test_lines_in_place_of_curves_are_exact_for_lines(tmp_path: Path) -> None:
    scene = import_scene(written(tmp_path, foreign_files.spacetime_ply())).scene
    motion = scene.motion
    assert isinstance(motion, PolynomialMotion)
    straight = PolynomialMotion(
        coefficients=motion.coefficients[:, :1],
        spins=torch.zeros_like(motion.spins),
        time_centers_s=motion.time_centers_s,
        time_deviations_s=motion.time_deviations_s,
        time_range_s=(0.0, 1.0),
    )
    gaussians, kept, error = linearised(scene.gaussians, straight)
    assert error < 1e-5
    want, got = straight.state_at(scene.gaussians, 0.6), kept.state_at(gaussians, 0.6)
    torch.testing.assert_close(got.means, want.means, atol=1e-5, rtol=0)
    torch.testing.assert_close(got.opacities, want.opacities)
    assert linearised(scene.gaussians, motion)[2] > 0.01


@pytest.mark.parametrize("name", [b"omega_3", b"motion_4", b"trbf_scale"])
def test_spacetime_gaussians_without_a_column_are_refused(tmp_path: Path, name: bytes) -> None:
    content = foreign_files.spacetime_ply().replace(name + b"\n", b"other\n")
    with pytest.raises(FileFormatError, match=r"a\.ply: "):
        import_scene(written(tmp_path, content))


def test_no_gaussians_and_meshes_get_a_clear_answer(tmp_path: Path) -> None:
    empty = foreign_files.ply(foreign_files.columns_of(cloud(0)))
    with pytest.raises(FileFormatError, match="at least one Gaussian"):
        import_scene(written(tmp_path, empty))
    mesh = foreign_files.ply({n: np.zeros(3, "f4") for n in ("x", "y", "z")})
    with pytest.raises(FileFormatError, match="a point cloud or mesh"):
        import_scene(written(tmp_path, mesh))
