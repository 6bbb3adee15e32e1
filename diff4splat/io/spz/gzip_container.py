"""The container of SPZ versions 2 and 3: a header and all columns in one gzip stream."""

import gzip
import io
import struct
import zlib
from collections.abc import Sequence

from diff4splat.errors import FileFormatError
from diff4splat.io.spz.spz_header import HAS_EXTENSIONS, MAGIC, SpzHeader, checked_header

HEADER = struct.Struct("<IIIBBBB")
START = b"\x1f\x8b"


def encode(columns: Sequence[bytes], header: SpzHeader, degree: int) -> bytes:
    """Equal columns give equal bytes."""
    head = HEADER.pack(MAGIC, 3, header.count, degree, header.fraction_bits, 0, 0)
    return gzip.compress(b"".join((head, *columns)), mtime=0)


def decode(data: bytes) -> tuple[SpzHeader, bytes]:
    """The header and the columns side by side; never more than the header says is read.

    Raises:
        FileFormatError: damaged, cut off, of another version, or longer than its header says.
    """
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
            header, flags = _header(stream.read(HEADER.size))
            size = header.count * sum(header.widths())
            body = stream.read(size + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise FileFormatError("expected a gzip stream, got a damaged one; copy it again") from error
    if len(body) < size or (len(body) > size and not flags & HAS_EXTENSIONS):
        raise FileFormatError(f"expected {size} bytes for {header.count} Gaussians, got others")
    return header, body[:size]


def _header(data: bytes) -> tuple[SpzHeader, int]:
    if len(data) < HEADER.size:
        raise FileFormatError("expected 16 bytes of SPZ header, got fewer; copy the file again")
    magic, version, count, degree, bits, flags, _ = HEADER.unpack(data)
    header = checked_header(magic, version, count, degree, bits)
    if version >= 4:
        raise FileFormatError(f"expected version 2 or 3 in a gzip stream, got version {version}")
    return header, flags
