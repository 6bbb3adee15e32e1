"""PLY files that are not whole or not Gaussians: one line each, never a traceback."""

import random
from pathlib import Path

import oracles_io
import pytest

from diff4splat.errors import FileFormatError
from diff4splat.io.ply.ply_file import read_ply, write_ply


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_ply(oracles_io.gaussians(3), tmp_path / "a.ply")
    return tmp_path / "a.ply"


def refusal(file: Path) -> str:
    with pytest.raises(FileFormatError) as caught:
        read_ply(file)
    assert str(caught.value).isprintable()
    assert str(file) in str(caught.value)
    return str(caught.value)


def replaced(file: Path, old: bytes, new: bytes) -> Path:
    data = file.read_bytes()
    assert data.count(old) >= 1
    file.write_bytes(data.replace(old, new, 1))
    return file


def test_missing_folder_empty_and_other_kinds(tmp_path: Path) -> None:
    assert "got no such file" in refusal(tmp_path / "no.ply")
    assert "got a folder" in refusal(tmp_path)
    (tmp_path / "a.ply").touch()
    assert "got an empty file" in refusal(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes(random.Random(0).randbytes(500))
    assert "expected a PLY file, got another kind" in refusal(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes(b"plywood\n")
    assert "expected a PLY file, got another kind" in refusal(tmp_path / "a.ply")


def test_truncation_anywhere_is_noticed(file: Path) -> None:
    whole = file.read_bytes()
    start = whole.index(b"end_header\n") + len(b"end_header\n")
    for length in [*range(1, 40), *range(40, len(whole), 7), start, len(whole) - 1]:
        file.write_bytes(whole[:length])
        message = refusal(file)
        if length >= start:
            assert "expected 3 rows of element 'vertex', got fewer; the file is cut off" in message
        elif length >= 4:
            assert "'end_header'" in message


def test_text_that_is_cut_off_or_no_number(tmp_path: Path) -> None:
    names = oracles_io.PLY_CORE
    head = "ply\nformat ascii 1.0\nelement vertex 2\n"
    head += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    row = " ".join(["1"] * len(names))
    (tmp_path / "a.ply").write_text(f"{head}{row}\n{row[:-2]}")
    assert "expected 2 rows" in refusal(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_text(f"{head}{row}\n{row[:-1]}word")
    assert "expected numbers in element 'vertex'" in refusal(tmp_path / "a.ply")


@pytest.mark.parametrize("count", [b"4", b"999999999999999", b"999999999999999999"])
def test_more_vertices_than_the_file_has_room_for(file: Path, count: bytes) -> None:
    says = f"expected {count.decode()} rows"
    assert says in refusal(replaced(file, b"vertex 3", b"vertex " + count))


@pytest.mark.parametrize("count", [b"-1", b"many", b"1.5", b"9" * 5000, b""])
def test_vertex_counts_that_are_none(file: Path, count: bytes) -> None:
    message = refusal(replaced(file, b"vertex 3", b"vertex " + count))
    assert "expected a PLY header line, got 'element vertex" in message


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b"element vertex", b"element point", "expected an element 'vertex', got ['point']"),
        (
            b"format binary_little_endian",
            b"format binary_middle_endian",
            "expected a PLY header line",
        ),
        (b"format binary_little_endian 1.0", b"comment none", "expected a PLY 'format' line"),
        (b"float nx", b"quaternion nx", "property of a known type, got 'property quaternion nx'"),
        (b"float nx", b"list float nx", "property of a known type"),
        (b"float nx", b"nonsense \x1b[31m\r", "expected a PLY property of a known type, got"),
        (b"format binary", b"\x1b[31mformat binary", "expected a PLY header line, got"),
        (b"float nx", b"float x", "expected different property names, got 'x' twice"),
        (b"element vertex 3", b"comment no element", "expected a PLY header line, got 'property"),
    ],
)
def test_headers_that_make_no_sense(file: Path, old: bytes, new: bytes, says: str) -> None:
    assert says in refusal(replaced(file, old, new))


@pytest.mark.parametrize("name", oracles_io.PLY_CORE)
def test_a_missing_property_is_named(file: Path, name: str) -> None:
    old, new = f"float {name}\n".encode(), f"float other_{name}\n".encode()
    assert f"expected property '{name}'" in refusal(replaced(file, old, new))


def test_compressed_files_are_recognised(file: Path) -> None:
    message = refusal(replaced(file, b"float x\n", b"float packed_position\n"))
    assert "expected 'packed_position' of type uint" in message


def test_harmonics_of_no_degree(file: Path) -> None:
    assert "expected 0, 9, 24, 45 or 72" in refusal(
        replaced(file, b"float f_rest_8", b"float other")
    )
    assert "expected 0, 9, 24, 45 or 72" in refusal(
        replaced(file, b"float other", b"float f_rest_9")
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[(name, "nan") for name in ("x", "f_dc_1", "f_rest_3", "opacity", "scale_2", "rot_0")],
        *[("y", "inf"), ("rot_3", "-inf"), ("scale_0", "inf"), ("scale_1", "200"), ("z", "1e39")],
    ],
)
def test_values_that_are_none_are_named_and_counted(file: Path, name: str, value: str) -> None:
    _, names, rows = oracles_io.read_ply_plainly(file.read_bytes())
    lines = [" ".join(value if n == name else str(row[n]) for n in names) for row in rows[:2]]
    lines.append(" ".join(str(number) for number in rows[2].values()))
    head = file.read_bytes().split(b"end_header\n")[0].replace(b"binary_little_endian", b"ascii")
    file.write_bytes(head + b"end_header\n" + "\n".join(lines).encode())
    assert f"property '{name}': expected finite numbers, got 2 of 3" in refusal(file)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_lists_with_lengths_that_are_none(tmp_path: Path, form: str) -> None:
    head = f"ply\nformat {form} 1.0\nelement e 9\nproperty list float int a\n"
    head += "element vertex 0\nend_header\n"
    for text, number in (
        ("nan", b"\0\0\xc0\x7f"),
        ("-1", b"\0\0\x80\xbf"),
        ("1e30", b"\xca\xf2\x49\x71"),
    ):
        body = text.encode() if form == "ascii" else number
        (tmp_path / "a.ply").write_bytes(head.encode() + body)
        assert "expected list lengths from 0 in element 'e'" in refusal(tmp_path / "a.ply")
    body = b"7 1 2" if form == "ascii" else b"\0\0\xe0\x40"
    (tmp_path / "a.ply").write_bytes(head.encode() + body)
    assert "the file is cut off" in refusal(tmp_path / "a.ply")


def test_damaged_bytes_never_end_in_another_exception(file: Path) -> None:
    whole, source = file.read_bytes(), random.Random(1)
    for _ in range(200):
        damaged = bytearray(whole)
        for _ in range(3):
            damaged[source.randrange(len(damaged))] = source.randrange(256)
        file.write_bytes(damaged)
        try:
            read_ply(file)
        except FileFormatError as error:
            assert str(error).isprintable()
