"""PLY files of other programs: every variation that is harmless must be read."""

import struct
from pathlib import Path

import numpy as np
import pytest
import torch

from diff4splat.io.ply import ply_body
from diff4splat.io.ply.ply_file import read_ply

CORE = {
    **{"x": 1.0, "y": 2.0, "z": 3.0, "f_dc_0": 0.25, "f_dc_1": 0.5, "f_dc_2": 0.75},
    **{"opacity": 0.0, "scale_0": 0.0, "scale_1": 0.0, "scale_2": 0.0},
    **{"rot_0": 2.0, "rot_1": 0.0, "rot_2": 0.0, "rot_3": 0.0},
}
CODES = {
    "float": "f",
    "double": "d",
    "uchar": "B",
    "char": "b",
    "short": "h",
    "int": "i",
    "uint": "I",
}


def header(form: str, *elements: str, newline: str = "\n") -> bytes:
    lines = ["ply", f"format {form} 1.0", "comment SplatRenderMode: mip", "obj_info made elsewhere"]
    return newline.join([*lines, *elements, "end_header", ""]).encode()


def vertex(count: int, types: dict[str, str]) -> str:
    lines = [
        f"element vertex {count}",
        *(f"property {kind} {name}" for name, kind in types.items()),
    ]
    return "\n".join(lines)


def packed(order: str, types: dict[str, str], rows: list[dict[str, float]]) -> bytes:
    code = order + "".join(CODES[kind] for kind in types.values())
    values = [
        [row[name] if types[name] in ("float", "double") else int(row[name]) for name in types]
        for row in rows
    ]
    return b"".join(struct.pack(code, *row) for row in values)


def assert_core(file: Path, count: int = 1, scale_2: float = 1.0) -> None:
    got = read_ply(file)
    assert len(got) == count
    for i in range(count):
        assert got.means[i].tolist() == [1 + i, 2, 3]
        assert got.quats[i].tolist() == [1, 0, 0, 0]
        assert got.scales[i].tolist() == pytest.approx([1, 1, scale_2])
        assert got.opacities[i] == 0.5
        assert got.sh[i, 0].tolist() == [0.25, 0.5, 0.75]


def rows(count: int, **more: float) -> list[dict[str, float]]:
    return [{**CORE, **more, "x": 1.0 + i} for i in range(count)]


FLOATS = dict.fromkeys(CORE, "float")


@pytest.mark.parametrize(("form", "order"), [("little", "<"), ("big", ">")])
def test_both_byte_orders_without_normals_or_harmonics(
    tmp_path: Path, form: str, order: str
) -> None:
    data = header(f"binary_{form}_endian", vertex(2, FLOATS)) + packed(order, FLOATS, rows(2))
    (tmp_path / "a.ply").write_bytes(data)
    assert_core(tmp_path / "a.ply", 2)


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_text_with_any_line_ends(tmp_path: Path, newline: str) -> None:
    head = header("ascii", vertex(2, FLOATS).replace("\n", newline), newline=newline)
    body = newline.join(" ".join(str(value) for value in row.values()) for row in rows(2))
    (tmp_path / "a.ply").write_bytes(head + body.encode())
    assert_core(tmp_path / "a.ply", 2)


def test_windows_line_ends_before_binary_data(tmp_path: Path) -> None:
    elements = vertex(1, FLOATS).replace("\n", "\r\n")
    data = header("binary_little_endian", elements, newline="\r\n") + packed("<", FLOATS, rows(1))
    (tmp_path / "a.ply").write_bytes(data)
    assert_core(tmp_path / "a.ply")


def test_any_order_and_type_and_extra_properties(tmp_path: Path) -> None:
    types = {
        **{"segment": "uchar", "nx": "float", "weight": "double", "label": "short"},
        **dict(reversed(FLOATS.items())),
        **{"x": "double", "rot_0": "uchar", "scale_0": "int", "z": "uint", "opacity": "char"},
    }
    more = {"segment": 3, "nx": 0.5, "weight": 0.25, "label": -4}
    data = header("binary_little_endian", vertex(2, types)) + packed("<", types, rows(2, **more))
    (tmp_path / "a.ply").write_bytes(data)
    assert_core(tmp_path / "a.ply", 2)


EXTRA = "element camera 2\nproperty uchar id\nproperty list uchar float ray\nproperty double w"
EMPTY = "element nothing 0\nproperty list int int a\nelement void 3"


def test_elements_and_lists_before_and_after_in_binary(tmp_path: Path) -> None:
    before = struct.pack(">BBffd", 1, 2, 0.5, 0.5, 1.5) + struct.pack(">BBd", 2, 0, 1.5)
    head = header(
        "binary_big_endian", EXTRA, EMPTY, vertex(1, FLOATS), "element face 7\nproperty int a"
    )
    (tmp_path / "a.ply").write_bytes(head + before + packed(">", FLOATS, rows(1)) + b"anything")
    assert_core(tmp_path / "a.ply")


def test_elements_and_lists_before_and_after_in_text(tmp_path: Path) -> None:
    head = header("ascii", EXTRA, EMPTY, vertex(1, FLOATS), "element face 1\nproperty int a")
    body = "1 2 0.5 0.5 1.5\n2 0 1.5\n" + " ".join(str(v) for v in CORE.values()) + "\nmore words"
    (tmp_path / "a.ply").write_bytes(head + body.encode())
    assert_core(tmp_path / "a.ply")


def test_a_list_inside_the_vertices(tmp_path: Path) -> None:
    listed = vertex(2, FLOATS).replace(
        "property float y", "property list uchar short tags\nproperty float y"
    )
    body = b""
    for i, row in enumerate(rows(2)):
        values = list(row.values())
        body += struct.pack("<f", values[0]) + struct.pack(f"<B{i}h", i, *range(i))
        body += struct.pack("<13f", *values[1:])
    (tmp_path / "a.ply").write_bytes(header("binary_little_endian", listed) + body)
    assert_core(tmp_path / "a.ply", 2)


def test_surfels_get_a_thin_third_axis(tmp_path: Path) -> None:
    types = {name: kind for name, kind in FLOATS.items() if name != "scale_2"}
    data = header("binary_little_endian", vertex(1, types)) + packed("<", types, rows(1))
    (tmp_path / "a.ply").write_bytes(data)
    assert_core(tmp_path / "a.ply", scale_2=1e-6)
    assert 0 < read_ply(tmp_path / "a.ply").scales[0, 2] < 1e-5


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_no_vertices(tmp_path: Path, form: str) -> None:
    (tmp_path / "a.ply").write_bytes(header(form, vertex(0, FLOATS)))
    got = read_ply(tmp_path / "a.ply")
    assert got.sh.shape == (0, 1, 3)


def test_infinite_logits_mean_certainty_and_a_log_of_zero_a_point(tmp_path: Path) -> None:
    sure = [{**CORE, "opacity": np.inf, "scale_1": -np.inf}, {**CORE, "opacity": -np.inf}]
    data = header("binary_little_endian", vertex(2, FLOATS)) + packed("<", FLOATS, sure)
    (tmp_path / "a.ply").write_bytes(data)
    got = read_ply(tmp_path / "a.ply")
    assert got.opacities.tolist() == [1.0, 0.0]
    assert got.scales[0].tolist() == [1.0, 0.0, 1.0]


@pytest.mark.parametrize("k", [4, 9, 16])
def test_harmonics_are_channel_major(tmp_path: Path, k: int) -> None:
    names = [f"f_rest_{i}" for i in range(3 * (k - 1))]
    types = {**FLOATS, **dict.fromkeys(names, "float")}
    row = {**CORE, **{name: float(i) for i, name in enumerate(names)}}
    data = header("binary_little_endian", vertex(1, types)) + packed("<", types, [row])
    (tmp_path / "a.ply").write_bytes(data)
    got = read_ply(tmp_path / "a.ply").sh
    want = torch.tensor([[channel * (k - 1) + i for channel in range(3)] for i in range(k - 1)])
    assert torch.equal(got[0, 1:], want.float())


@pytest.mark.parametrize("block_bytes", [9, 16, 33, 1 << 22])
def test_text_is_read_in_blocks_of_any_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block_bytes: int
) -> None:
    monkeypatch.setattr(ply_body, "_BLOCK_BYTES", block_bytes)
    body = "\n\n".join("  ".join(f"{v:.6f}" for v in row.values()) + " " for row in rows(9))
    (tmp_path / "a.ply").write_bytes(header("ascii", vertex(9, FLOATS)) + body.encode())
    assert_core(tmp_path / "a.ply", 9)
