"""GLB: an own parser finds the numbers of the specification, and damaged files are answered."""

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from oracles_render import random_gaussians

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.glb.container import decode, encode
from diff4splat.io.glb.glb_file import read_glb, write_glb
from diff4splat.scene.gaussians import Gaussians

COUNT, EXTENSION = 7, "KHR_gaussian_splatting"


def some(coefficients: int = 4) -> Gaussians:
    cloud = random_gaussians(COUNT, dtype=torch.float32)
    return Gaussians(
        means=cloud.means,
        quats=torch.nn.functional.normalize(cloud.quats, dim=-1),
        scales=cloud.scales,
        opacities=cloud.opacities,
        sh=torch.linspace(-1, 1, COUNT * coefficients * 3).view(COUNT, coefficients, 3),
    )


def parsed(file: Path) -> tuple[dict, Callable[[str], np.ndarray]]:
    """The document, and what gives an attribute's numbers: written from the specification."""
    data = file.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    document = json.loads(data[20 : 20 + size])
    body_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    body = data[28 + size :]
    assert len(body) == body_size
    attributes = document["meshes"][0]["primitives"][0]["attributes"]

    def numbers(name: str) -> np.ndarray:
        accessor = document["accessors"][attributes[name]]
        view = document["bufferViews"][accessor["bufferView"]]
        dtype = {5126: "<f4", 5121: "u1"}[accessor["componentType"]]
        start, stop = view["byteOffset"], view["byteOffset"] + view["byteLength"]
        return np.frombuffer(body[start:stop], dtype).reshape(accessor["count"], -1)

    return document, numbers


def test_an_own_parser_finds_what_was_written(tmp_path: Path) -> None:
    gaussians = some()
    write_glb(gaussians, tmp_path / "a.glb")
    document, numbers = parsed(tmp_path / "a.glb")
    primitive = document["meshes"][0]["primitives"][0]
    assert document["extensionsUsed"] == [EXTENSION]
    assert primitive["mode"] == 0
    assert primitive["extensions"][EXTENSION]["kernel"] == "ellipse"
    assert primitive["extensions"][EXTENSION]["colorSpace"] == "srgb_rec709_display"
    assert document["nodes"][0]["rotation"] == [1, 0, 0, 0]
    np.testing.assert_array_equal(numbers("POSITION"), gaussians.means)
    np.testing.assert_array_equal(numbers(f"{EXTENSION}:SCALE"), gaussians.scales)
    np.testing.assert_array_equal(numbers(f"{EXTENSION}:OPACITY")[:, 0], gaussians.opacities)
    quats = numbers(f"{EXTENSION}:ROTATION")
    np.testing.assert_allclose(quats, gaussians.quats.roll(-1, 1), atol=1e-7)
    np.testing.assert_array_equal(numbers(f"{EXTENSION}:SH_DEGREE_1_COEF_2"), gaussians.sh[:, 3])
    first = document["accessors"][primitive["attributes"]["POSITION"]]
    np.testing.assert_array_equal(first["min"], gaussians.means.amin(0))


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_everything_comes_back(tmp_path: Path, coefficients: int) -> None:
    gaussians = some(coefficients)
    write_glb(gaussians, tmp_path / "a.glb")
    again = read_glb(tmp_path / "a.glb")
    for name in Gaussians.__slots__:
        torch.testing.assert_close(getattr(again, name), getattr(gaussians, name))


def changed(file: Path, change: Callable[[dict], object]) -> None:
    document, body = decode(file.read_bytes())
    change(document)
    file.write_bytes(encode(document, body))


def splats(document: dict) -> dict:
    return document["meshes"][0]["primitives"][0]


CHANGES = {
    "mesh": lambda d: splats(d).pop("extensions"),
    "no positions": lambda d: splats(d)["attributes"].pop("POSITION"),
    "index": lambda d: splats(d)["attributes"].update(POSITION=999),
    "text": lambda d: splats(d)["attributes"].update(POSITION="0"),
    "count": lambda d: d["accessors"][0].update(count=10**12),
    "negative": lambda d: d["bufferViews"][0].update(byteOffset=-4),
    "beyond": lambda d: d["bufferViews"][0].update(byteOffset=10**9),
    "stride": lambda d: d["bufferViews"][0].update(byteStride=16),
    "shorts": lambda d: d["accessors"][0].update(componentType=5123),
    "shorter": lambda d: d["accessors"][0].update(count=3),
    "moved": lambda d: d["nodes"][0].update(translation=[1, 0, 0]),
    "list": lambda d: d.update(meshes={}),
}


@pytest.mark.parametrize("name", CHANGES)
def test_damaged_documents_are_refused(tmp_path: Path, name: str) -> None:
    write_glb(some(), tmp_path / "a.glb")
    changed(tmp_path / "a.glb", CHANGES[name])
    with pytest.raises(FileFormatError, match=r"a\.glb: expected|a\.glb: '\w+': expected"):
        read_glb(tmp_path / "a.glb")


def test_cut_off_files_are_refused(tmp_path: Path) -> None:
    write_glb(some(), tmp_path / "a.glb")
    whole = (tmp_path / "a.glb").read_bytes()
    for length in (0, 11, 20, 200, len(whole) - 1):
        (tmp_path / "a.glb").write_bytes(whole[:length])
        with pytest.raises(FileFormatError, match=r"a\.glb: "):
            read_glb(tmp_path / "a.glb")


def test_what_is_not_finite_is_neither_written_nor_read(tmp_path: Path) -> None:
    gaussians = some()
    write_glb(gaussians, tmp_path / "a.glb")
    data = bytearray((tmp_path / "a.glb").read_bytes())
    data[-4 * COUNT - 4 * 10 :] = b"\xff" * (4 * COUNT + 40)
    (tmp_path / "a.glb").write_bytes(data)
    with pytest.raises(FileFormatError, match="expected finite numbers"):
        read_glb(tmp_path / "a.glb")
    gaussians.means[0, 0] = float("inf")
    with pytest.raises(InputError, match="of 'means'"):
        write_glb(gaussians, tmp_path / "b.glb")
    assert not (tmp_path / "b.glb").exists()
