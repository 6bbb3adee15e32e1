"""The container of SPZ version 4: a plain header, a table of sizes, one zstd stream per column.

    32 bytes   magic, version, count, degree, bits after the point, flags, streams, table offset
    records    (type, length, bytes) of extensions, up to the table
    table      compressed and plain size of each stream, 8 bytes each
    streams    columns in the order of ``SpzHeader.widths``; empty columns have none

The only file that imports zstandard (the extra ``spz``).
"""

import io
import struct
from collections.abc import Iterator, Sequence
from types import ModuleType

from diff4splat.errors import FileFormatError, MissingExtraError
from diff4splat.io.spz.spz_header import MAGIC, ZSTD_VERSION, SpzHeader, checked_header

HEADER, SIZES, RECORD = struct.Struct("<IIIBBBBI12x"), struct.Struct("<QQ"), struct.Struct("<II")
START = MAGIC.to_bytes(4, "little")
LEVEL, LARGEST_WINDOW_BYTES = 12, 1 << 27
MOST_EXPANSION = 1000
"""Plain bytes per byte of a file; honest ones have fewer than 100."""
COORDINATES, SAME_AXES = 0xADBE0003, (0, 4)
"""The extension that names the axes, and its numbers for x right, y up, z back."""


def encode(columns: Sequence[bytes], header: SpzHeader, degree: int) -> bytes:
    """Equal columns give equal bytes.

    Raises:
        MissingExtraError: zstandard is not installed.
    """
    compressor = _zstandard().ZstdCompressor(level=LEVEL)
    plain = [column for column in columns if column]
    streams = [compressor.compress(column) for column in plain]
    numbers = (header.count, degree, header.fraction_bits, 0, len(streams), HEADER.size)
    table = (SIZES.pack(len(s), len(p)) for s, p in zip(streams, plain, strict=True))
    return b"".join((HEADER.pack(MAGIC, ZSTD_VERSION, *numbers), *table, *streams))


def decode(data: bytes) -> tuple[SpzHeader, bytes, tuple[str, ...]]:
    """The header, the columns side by side, and notes on what was skipped.

    Raises:
        FileFormatError: damaged, cut off, in other axes, or larger than its header says.
        MissingExtraError: zstandard is not installed.
    """
    if len(data) < HEADER.size:
        raise FileFormatError("expected 32 bytes of SPZ header, got fewer; copy the file again")
    *numbers, _, streams, table_start = HEADER.unpack_from(data)
    header = checked_header(*numbers)
    sizes = [width * header.count for width in header.widths() if width]
    table_stop = table_start + len(sizes) * SIZES.size
    if header.version != ZSTD_VERSION or streams != len(sizes):
        raise FileFormatError(f"expected {len(sizes)} streams of version 4, got {streams}")
    if not HEADER.size <= table_start <= table_stop <= len(data):
        raise FileFormatError("expected a table inside of the file, got another; copy it again")
    if sum(sizes) > MOST_EXPANSION * len(data):
        raise FileFormatError(f"expected {header.count} Gaussians, got a file too short for them")
    table = list(SIZES.iter_unpack(data[table_start:table_stop]))
    body = b"".join(_columns(data, table_stop, table, sizes))
    return header, body, _notes(data[HEADER.size : table_start])


def _columns(
    data: bytes, start: int, table: Sequence[tuple[int, int]], sizes: Sequence[int]
) -> Iterator[bytes]:
    zstandard = _zstandard()
    for (packed, plain), size in zip(table, sizes, strict=True):
        stop = start + packed
        if plain != size or stop > len(data):
            raise FileFormatError(f"expected streams of {size} bytes, got others; copy it again")
        decompressor = zstandard.ZstdDecompressor(max_window_size=LARGEST_WINDOW_BYTES)
        try:
            with decompressor.stream_reader(io.BytesIO(data[start:stop])) as stream:
                column = stream.read(size + 1)
        except zstandard.ZstdError as error:
            raise FileFormatError("expected zstd streams, got damaged ones") from error
        if len(column) != size:
            raise FileFormatError(f"expected a stream of {size} bytes, got another length")
        yield column
        start = stop


def _notes(records: bytes) -> tuple[str, ...]:
    """What the extensions of other programs are; one that changes the axes is refused."""
    notes, start = [], 0
    while start + RECORD.size <= len(records):
        kind, length = RECORD.unpack_from(records, start)
        stop = start + RECORD.size + length
        payload, start = records[start + RECORD.size : stop], stop
        if kind != COORDINATES:
            notes.append(f"not imported: the extension {kind:#010x} of another program")
        elif int.from_bytes(payload, "little") not in SAME_AXES:
            raise FileFormatError("expected x right, y up, z back, got other axes; export it anew")
    return tuple(notes[:3])


def _zstandard() -> ModuleType:
    try:
        import zstandard
    except ImportError as error:
        raise MissingExtraError(
            "SPZ version 4: expected the package zstandard, got none; "
            "pip install 'diff4splat[spz]', or use version 3"
        ) from error
    return zstandard
