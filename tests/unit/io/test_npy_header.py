"""Headers of NumPy arrays: what NumPy writes is read, what breaks its parser is refused."""

import io
from pathlib import Path

import numpy as np
import pytest

from diff4splat.data_prep.readers.files.float_files import npy_array
from diff4splat.errors import FileFormatError
from diff4splat.io.npy_header import read_npy_header


@pytest.mark.parametrize("dtype", ["<f2", "<f4", ">f8", "|u1", "<i8", ">u2", "|b1"])
@pytest.mark.parametrize("shape", [(), (3,), (0, 3), (2, 3, 4)])
@pytest.mark.parametrize("order", ["C", "F"])
def test_what_numpy_saves_is_understood(dtype: str, shape: tuple[int, ...], order: str) -> None:
    values, file = np.ones(shape, dtype, order=order), io.BytesIO()
    np.save(file, values)
    header = read_npy_header(file.getvalue())
    assert (header.shape, header.dtype) == (values.shape, values.dtype)
    assert header.data_start + header.data_bytes == len(file.getvalue())


@pytest.mark.parametrize("order", ["C", "F"])
def test_values_are_those_of_numpy(tmp_path: Path, order: str) -> None:
    values = np.asarray(np.arange(24.0).reshape(2, 3, 4), order=order)
    np.save(tmp_path / "a.npy", values)
    assert np.array_equal(npy_array(tmp_path / "a.npy"), values)
    np.save(tmp_path / "a.npy", values[:0])
    assert npy_array(tmp_path / "a.npy").shape == (0, 3, 4)


def _npy(text: str) -> bytes:
    padded = text.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(padded).to_bytes(2, "little") + padded + bytes(64)


def _header(descr: str = "'<f4'", order: str = "False", shape: str = "(4,)") -> str:
    return f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}"


@pytest.mark.parametrize(
    "text",
    [
        *("", "{", "(" * 30_000, "[" * 300, "{'descr'", "'a' * 10", "{}", "{'descr': '<f4'}"),
        *(_header(shape=shape) for shape in ("(-1,)", "[4]", "4", "(4.5,)", "('a',)", "((4,),)")),
        *(_header(shape=f"({'9' * count},)") for count in (30, 250, 5000)),
        *(_header(shape="(" + "1," * 33 + ")"), _header(shape="(100000, 100000, 3)")),
        *(_header(descr=descr) for descr in ("'|O'", "'<U5'", "'|V8'", "'<f3'", "'f99'", "''")),
        *(_header(descr="[('a', '<f4')]"), _header(descr="(3,)"), _header(order="None")),
        *(
            _header() + "x",
            _header() + _header(),
            "#" + _header(),
            _header().replace("}", ", 'a': 1}"),
        ),
    ],
)
def test_headers_that_break_numpy_are_refused(tmp_path: Path, text: str) -> None:
    """TokenError, MemoryError, RecursionError, OverflowError and others before."""
    (tmp_path / "a.npy").write_bytes(_npy(text))
    with pytest.raises(FileFormatError, match=r"a\.npy: expected"):
        npy_array(tmp_path / "a.npy")


@pytest.mark.parametrize(
    "content", [b"PK\3\4 no archive", b"\x93NUMPY", b"\x93NUMPY\x09\x00vvvvvv"]
)
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.npy").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"a\.npy: expected"):
        npy_array(tmp_path / "a.npy")
