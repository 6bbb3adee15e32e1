"""Some tensors of a large ``.safetensors`` file, without reading the others."""

from collections.abc import Sequence
from pathlib import Path

from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.tensor_file import opened_tensors


def read_some(file: Path, names: Sequence[str]) -> list[Tensor]:
    """The tensors of these names, in their order.

    Raises:
        FileFormatError: the file is damaged or of another kind, or lacks a name.
    """
    with opened_tensors(file) as opened:
        missing = sorted(set(names) - set(opened.keys()))
        if missing:
            raise FileFormatError(f"{file}: expected tensor {missing[0]}, got none; copy it again")
        return [opened.get_tensor(name).clone() for name in names]
