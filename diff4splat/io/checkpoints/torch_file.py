"""Files of ``torch.save`` by other programs: tensors alone, in the memory that the file fills.

Nothing in the file is run (``weights_only``). Archives must be stored without compression, as torch
writes them, so that no entry can be larger than the file; and a tensor must fill the memory that it
claims: strides of 0, sparse layouts and devices without memory stand for sizes that nobody stored.
"""

import io
import pickletools
import zipfile
from collections.abc import Iterator
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import read_bytes

DTYPES = (
    *(torch.float64, torch.float32, torch.float16, torch.bfloat16, torch.bool),
    *(torch.int64, torch.int32, torch.int16, torch.int8, torch.uint8),
)
MOST_NAME_CHARACTERS = 200


def load_torch_file(file: Path, what: str) -> object:
    """Plain values and tensors on the CPU; ``what`` names the expected kind in errors.

    Raises:
        FileFormatError: missing, damaged, of another kind, in need of code, or with a tensor that
            is no plain array.
    """
    content = read_bytes(file, what)
    try:
        require_loadable(content)
        found = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except Exception as error:  # what damaged bytes make it raise is not documented
        raise FileFormatError(
            f"{file}: expected a torch file of tensors and nothing else, got one that is damaged "
            "or would run code; save the tensors alone"
        ) from error
    for tensor in _tensors(found):
        if not _is_plain(tensor):
            raise FileFormatError(
                f"{file}: expected plain tensors of known numbers, got a {tensor.layout} "
                f"{tensor.dtype} of shape {tuple(tensor.shape)}; save the tensors alone"
            )
    return found


def require_loadable(content: bytes) -> None:
    """No entry of the archive may be larger than what the file holds of it, and no name long.

    Raises:
        ValueError: one is. Damaged archives raise whatever Python's readers do.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
        if any(entry.compress_type != zipfile.ZIP_STORED for entry in entries):
            raise ValueError("compressed entries")
        if sum(entry.file_size for entry in entries) > len(content):
            raise ValueError("entries that are larger than the file")
        for entry in entries:
            if entry.filename.endswith(".pkl"):
                _require_short_names(archive.read(entry))


def _require_short_names(pickled: bytes) -> None:
    """Torch searches its messages, which quote names, in a time that grows with their square."""
    for opcode, argument, _ in pickletools.genops(pickled):
        if opcode.name == "GLOBAL" and len(argument) > MOST_NAME_CHARACTERS:
            raise ValueError("a name that is longer than any")


def _tensors(value: object) -> Iterator[Tensor]:
    waiting = [value]
    while waiting:
        value = waiting.pop()
        if isinstance(value, Tensor):
            yield value
        elif isinstance(value, dict):
            waiting += value.values()
        elif isinstance(value, list | tuple):
            waiting += value


def _is_plain(tensor: Tensor) -> bool:
    dense = tensor.layout == torch.strided and tensor.device.type == "cpu"
    if not dense or tensor.is_quantized or tensor.dtype not in DTYPES:
        return False
    return tensor.numel() * tensor.element_size() <= tensor.untyped_storage().nbytes()
