"""Scene files of every motion, PLY, camera paths, checkpoints of other programs."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import coded_scenes
import foreign_files
import numpy as np
import oracles_fourdgs
import oracles_hexplane
import oracles_io
import oracles_spacetime
import torch
from oracles_paths import random_path
from oracles_render import random_gaussians

from diff4splat.geometry.camera import pinhole
from diff4splat.io.cameras.path_files import read_path, write_path
from diff4splat.io.checkpoints.import_scene import import_scene
from diff4splat.io.glb.glb_file import read_glb, write_glb
from diff4splat.io.ply.ply_file import read_ply, write_ply
from diff4splat.io.scene_files.compression import Compression
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.io.spz.spz_file import read_spz, write_spz
from diff4splat.scene.scene import Scene
from fuzz.reader import Reader, read_each

SCENE = "scene.safetensors"
_TEXT_PLY = """ply
format ascii 1.0
element camera 1
property list uchar int view
property float far
element vertex 2
property float x
property float y
property float z
"""


def _scene(made: Callable[[], Scene], compression: Compression = "lossless") -> Reader:
    return Reader(
        make=lambda folder: save_scene(made(), folder / SCENE, compression),
        read=lambda folder: _shown(load_scene(folder / SCENE)),
    )


def _shown(scene: Scene) -> None:
    """The state in the middle, which uses every tensor."""
    start_s, stop_s = scene.motion.time_range_s
    scene.state_at(0.5 * (start_s + stop_s))


def _write_text_ply(folder: Path) -> None:
    names = ("f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2")
    names += tuple(f"rot_{k}" for k in range(4))
    header = _TEXT_PLY + "".join(f"property float {name}\n" for name in names) + "end_header\n"
    rows = "3 1 2 3 9.5\n" + 2 * (" ".join(["0.5"] * 14) + "\n")
    (folder / "text.ply").write_text(header + rows)


def _write_plys(folder: Path) -> None:
    write_ply(oracles_io.gaussians(), folder / "binary.ply")
    _write_text_ply(folder)


def _write_spz(folder: Path) -> None:
    write_spz(random_gaussians(4, dtype=torch.float32), folder / "a.spz")


def _write_spz4(folder: Path) -> None:
    write_spz(random_gaussians(4, dtype=torch.float32), folder / "a.spz", version=4)


def _write_foreign_plys(folder: Path) -> None:
    cloud = random_gaussians(4, dtype=torch.float32)
    (folder / "sharp.ply").write_bytes(foreign_files.sharp_ply(cloud))
    (folder / "anysplat.ply").write_bytes(foreign_files.anysplat_ply(cloud))


def _write_sequence(folder: Path) -> None:
    for number, state in enumerate(foreign_files.moving_cloud(6, 3)):
        write_ply(state, folder / f"frame_{number}.ply", comments=(f"time_s {number / 8:g}",))


def _write_point_maps(folder: Path) -> None:
    np.savez(folder / "a.npz", **foreign_files.point_maps())
    np.savez_compressed(folder / "b.npz", **foreign_files.point_maps(1))


def _import_each(folder: Path) -> None:
    read_each(folder, lambda file: _shown(import_scene(file).scene))


def _write_glb(folder: Path) -> None:
    write_glb(random_gaussians(4, dtype=torch.float32), folder / "a.glb")


def _read_plys(folder: Path) -> None:
    read_each(folder, read_ply)


_PATHS = {
    "a.txt": "realestate10k",
    "a.tum": "tum",
    "transforms.json": "transforms_json",
    "camera_path.json": "camera_path_json",
}


def _write_paths(folder: Path) -> None:
    for name in _PATHS:
        write_path(random_path(1, 4, centered=True), folder / name)


def _read_paths(folder: Path) -> None:
    read_each(folder, partial(read_path, view=pinhole(20.0, (24, 32))))


def _write_fourdgs(folder: Path) -> None:
    settings = "Namespace(no_dx=False, no_dr=False, no_ds=True, no_do=False, no_dshs=True)"
    state = oracles_fourdgs.random_state(channels=2, width=4, depth=1, multipliers=(1,))
    oracles_fourdgs.write_folder(folder, state, oracles_fourdgs.random_cloud(3), settings)


def _read_fourdgs(folder: Path) -> None:
    _shown(import_scene(folder).scene)


def _native_values() -> tuple:
    """What the program's ``GaussianModel.capture`` returns."""
    shape = oracles_spacetime.primitives(3, orders=3, bands=16).covariance
    colors = oracles_spacetime.primitives(3, orders=3, bands=16).orders.flatten(1, 2)
    zeros, flat = torch.zeros(3, 1), torch.zeros(3)
    return (
        *(3, shape.means[:, :3].float(), colors[:, :1].float(), colors[:, 1:].float()),
        *(shape.scales[:, :3].log().float(), shape.left_quats.float(), zeros),
        *(flat, zeros, zeros, zeros, {"state": {}}, 1.5),
        *(shape.means[:, 3:].float(), shape.scales[:, 3:].log().float()),
        *(shape.right_quats.float(), True, None, 2),
    )


def _write_native(folder: Path) -> None:
    torch.save((_native_values(), 30_000), folder / "chkpnt30000.pth")


def _read_native(folder: Path) -> None:
    _shown(import_scene(folder / "chkpnt30000.pth").scene)


SCENES = {
    "scene keyframes": _scene(oracles_io.scene),
    "scene spacetime": _scene(oracles_spacetime.file_scene),
    "scene hexplane": _scene(oracles_hexplane.file_scene),
    "scene coded": _scene(coded_scenes.scene, "standard"),
    "ply": Reader(make=_write_plys, read=_read_plys),
    "ply of other programs": Reader(make=_write_foreign_plys, read=_import_each),
    "ply compressed": Reader(
        make=lambda folder: (folder / "a.ply").write_bytes(foreign_files.compressed_ply()),
        read=_import_each,
    ),
    "ply spacetime": Reader(
        make=lambda folder: (folder / "a.ply").write_bytes(foreign_files.spacetime_ply(3)),
        read=_import_each,
    ),
    "ply sequence": Reader(
        make=_write_sequence, read=lambda folder: _shown(import_scene(folder).scene)
    ),
    "point maps": Reader(make=_write_point_maps, read=_import_each),
    "spz 4": Reader(make=_write_spz4, read=lambda folder: read_spz(folder / "a.spz")),
    "spz": Reader(make=_write_spz, read=lambda folder: read_spz(folder / "a.spz")),
    "glb": Reader(make=_write_glb, read=lambda folder: read_glb(folder / "a.glb")),
    "camera paths": Reader(make=_write_paths, read=_read_paths),
    "4DGaussians": Reader(make=_write_fourdgs, read=_read_fourdgs),
    "native 4D": Reader(make=_write_native, read=_read_native),
}
