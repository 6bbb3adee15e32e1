"""Where the tensors of one part lie: a ``.safetensors`` file, or several with an index.

Only headers are read, so that everything that is wrong is found before any memory is filled.
"""

from dataclasses import dataclass
from pathlib import Path

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.require_file import opened_file
from diff4splat.io.scene_files.tensor_file import MAX_AXES, MAX_HEADER_BYTES
from diff4splat.models.public_weights.source_folder import SourceFolder
from diff4splat.paths.formats.json_text import decode_json

BYTES_PER_NUMBER = {"F32": 4, "F16": 2, "BF16": 2}
"""What weights may be stored in."""
STEMS = ("diffusion_pytorch_model", "model")
"""File names of diffusers and of transformers."""
MAX_SHARDS = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredTensor:
    """One tensor in a file."""

    file: Path
    dtype: str
    """Name of the format: F32, F16 or BF16."""
    shape: tuple[int, ...]
    start: int
    """First byte in the file."""
    size: int
    """Bytes."""


def stored_tensors(folder: SourceFolder, part: str) -> dict[str, StoredTensor]:
    """Every tensor of a part by its name.

    Raises:
        CheckpointError: no weights, a shard is missing, or types that do not belong together.
        FileFormatError: a shard is damaged, cut off, or has another hash.
    """
    found: dict[str, StoredTensor] = {}
    for name in _shard_names(folder, part):
        for key, tensor in read_header(folder.verified(f"{part}/{name}")).items():
            if key in found:
                raise CheckpointError(f"{part}: expected {key[:60]} once, got it in two files")
            found[key] = tensor
    _require_types(found, part)
    return found


def _shard_names(folder: SourceFolder, part: str) -> list[str]:
    for stem in STEMS:
        if folder.has(f"{part}/{stem}.safetensors.index.json"):
            return _indexed(folder, part, f"{stem}.safetensors.index.json")
        if folder.has(f"{part}/{stem}.safetensors"):
            return [f"{stem}.safetensors"]
    raise CheckpointError(
        f"{folder.root / part}: expected {STEMS[0]}.safetensors, or an index of such files, "
        "got neither; download the model again"
    )


def _indexed(folder: SourceFolder, part: str, index: str) -> list[str]:
    places = folder.json(f"{part}/{index}").get("weight_map")
    names = sorted(set(places.values())) if isinstance(places, dict) else []
    plain = [name for name in names if isinstance(name, str) and Path(name).name == name]
    if not names or len(plain) < len(names) or len(names) > MAX_SHARDS:
        raise CheckpointError(
            f"{folder.root / part / index}: expected file names beside it, got others; "
            "download the model again"
        )
    return plain


def read_header(file: Path) -> dict[str, StoredTensor]:
    """The tensors that a ``.safetensors`` file promises, if it is as long as they need.

    Raises:
        FileFormatError: another kind of file, or a damaged or cut off one.
    """
    with opened_file(file, "a .safetensors file") as stream:
        length, size = int.from_bytes(stream.read(8), "little"), file.stat().st_size
        if length > MAX_HEADER_BYTES or 8 + length > size:
            raise FileFormatError(
                f"{file}: expected a whole .safetensors file, got only {size:,} bytes or another "
                "kind of file; download it again"
            )
        try:
            entries = decode_json(stream.read(length).decode())
            found = {
                key: _stored(file, entry, 8 + length)
                for key, entry in entries.items()
                if key != "__metadata__"
            }
        except (UnicodeDecodeError, AttributeError, KeyError, TypeError, ValueError) as error:
            raise _damaged(file) from error
    for tensor in found.values():
        _require_readable(tensor, size)
    return found


def _damaged(file: Path) -> FileFormatError:
    return FileFormatError(
        f"{file}: expected the header of a .safetensors file, got a damaged one; download it again"
    )


def _stored(file: Path, entry: dict, base: int) -> StoredTensor:
    dtype, (start, end) = str(entry["dtype"]), entry["data_offsets"]
    shape = tuple(int(side) for side in entry["shape"])
    needed = BYTES_PER_NUMBER.get(dtype, 0)
    for side in shape[:MAX_AXES]:
        needed *= side
    known = dtype in BYTES_PER_NUMBER
    if not 0 <= start <= end or (known and end - start != needed) or len(shape) > MAX_AXES:
        raise ValueError("offsets do not fit the shape")
    return StoredTensor(file=file, dtype=dtype, shape=shape, start=base + start, size=end - start)


def _require_readable(tensor: StoredTensor, size: int) -> None:
    file, end = tensor.file, tensor.start + tensor.size
    if tensor.dtype not in BYTES_PER_NUMBER:
        raise CheckpointError(
            f"{file}: expected weights in {', '.join(BYTES_PER_NUMBER)}, got {tensor.dtype[:20]}; "
            "download the model that is not quantised"
        )
    if end > size:
        raise FileFormatError(
            f"{file}: expected at least {end:,} bytes, got {size:,}; the file is cut off, "
            "download it again"
        )


def _require_types(tensors: dict[str, StoredTensor], part: str) -> None:
    """Single precision may stand beside one kind of half precision: diffusers keeps norms so."""
    found = {tensor.dtype for tensor in tensors.values()}
    if {"F16", "BF16"} <= found:
        raise CheckpointError(
            f"{part}: expected weights of one half precision, got F16 and BF16 mixed; "
            "download one variant of the model"
        )
