"""Tensors that claim more than their file holds, and other tensors that no reader expects."""

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from oracles_fourdgs import NET, random_cloud, random_state, write_folder
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.checkpoints.fourdgs_checkpoint import read_fourdgs_checkpoint
from diff4splat.io.checkpoints.fourdgs_settings import heads_in_use
from diff4splat.io.checkpoints.torch_file import load_torch_file

PLANE = f"{NET}grid.grids.0.0"


@pytest.mark.parametrize(
    "odd",
    [
        lambda plane: plane.new_zeros(1).as_strided((1, 4, 1 << 20, 1 << 20), (0, 0, 0, 0)),
        lambda plane: plane.new_zeros(()).expand(plane.shape),
        lambda plane: plane.to_sparse(),
        lambda plane: torch.sparse_coo_tensor(
            torch.zeros(1, 1).long(), torch.ones(1), (1 << 40,), check_invariants=True
        ),
        lambda plane: torch.empty(1 << 40, device="meta"),
        lambda plane: plane.to(torch.float8_e4m3fn),
        lambda plane: plane.to(torch.complex64),
    ],
)
def test_tensors_without_their_memory_are_refused(
    tmp_path: Path, odd: Callable[[Tensor], Tensor]
) -> None:
    state = random_state()
    state[PLANE] = odd(state[PLANE])
    write_folder(tmp_path, state, random_cloud(2))
    with pytest.raises(FileFormatError, match=r"deformation\.pth: expected"):
        read_fourdgs_checkpoint(tmp_path)


def test_plain_tensors_views_and_parameters_are_read(tmp_path: Path) -> None:
    values = {
        "view": torch.arange(12.0).reshape(3, 4).T,
        "part": torch.arange(12)[3:5],
        "parameter": torch.nn.Parameter(torch.ones(2)),
        "empty": torch.zeros(0, 3),
    }
    torch.save([values, "text", 3], tmp_path / "a.pth")
    found, text, number = load_torch_file(tmp_path / "a.pth", "a test file")
    assert (text, number) == ("text", 3)
    for name, value in values.items():
        assert torch.equal(found[name], value)


def test_compressed_archives_are_refused(tmp_path: Path) -> None:
    """A few kilobytes could stand for any number of gigabytes."""
    plain, packed = io.BytesIO(), tmp_path / "a.pth"
    torch.save(torch.zeros(100_000), plain)
    with zipfile.ZipFile(plain) as source, zipfile.ZipFile(packed, "w") as target:
        for info in source.infolist():
            target.writestr(info.filename, source.read(info), zipfile.ZIP_DEFLATED)
    assert packed.stat().st_size < 10_000
    with pytest.raises(FileFormatError, match="expected a torch file of tensors"):
        load_torch_file(packed, "a test file")


@pytest.mark.parametrize("depth", [200, 5000])
def test_nested_settings_take_no_time(tmp_path: Path, depth: int) -> None:
    """Python's parser takes exponential time for them."""
    nested = "Namespace(" * depth + "no_ds=True" + ")" * depth
    iteration = write_folder(tmp_path, random_state(), random_cloud(2), nested)
    assert "scale" not in heads_in_use(iteration)


def test_texts_in_settings_switch_nothing(tmp_path: Path) -> None:
    text = "Namespace(path='/a, no_dx=True, ', no_dr=True, n=3, other=\"(no_ds=True)\")"
    iteration = write_folder(tmp_path, random_state(), random_cloud(2), text)
    assert heads_in_use(iteration) == ("position", "scale")


def test_iterations_are_plain_numbers(tmp_path: Path) -> None:
    last = write_folder(tmp_path, random_state(), random_cloud(3))
    for name in ("²", "٣", "9" * 200):
        (last.parent / f"iteration_{name}").mkdir()
    assert len(read_fourdgs_checkpoint(tmp_path)[0]) == 3


def test_a_name_of_many_pages_takes_no_time(tmp_path: Path) -> None:
    """Torch searches its own message for patterns in a time that grows with its square."""
    plain, file = io.BytesIO(), tmp_path / "a.pth"
    torch.save(torch.zeros(3), plain)
    with zipfile.ZipFile(plain) as source, zipfile.ZipFile(file, "w") as target:
        for info in source.infolist():
            data = source.read(info)
            if info.filename.endswith("data.pkl"):
                data = data.replace(b"torch._utils", b"t" * 500)
            target.writestr(info.filename, data)
    with pytest.raises(FileFormatError, match="expected a torch file of tensors") as refusal:
        load_torch_file(file, "a test file")
    assert "longer than any" in str(refusal.value.__cause__)
