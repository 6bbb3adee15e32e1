"""The binary container of glTF 2.0: a JSON chunk, then one chunk of bytes (specification, 4.4)."""

import json
import struct

from diff4splat.errors import FileFormatError
from diff4splat.paths.formats.json_text import decode_json

MAGIC, VERSION, JSON_CHUNK, BIN_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
HEADER, CHUNK = struct.Struct("<III"), struct.Struct("<II")


def encode(document: dict, body: bytes) -> bytes:
    """Both chunks are padded to multiples of 4 bytes."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body += bytes(-len(body) % 4)
    length = HEADER.size + 2 * CHUNK.size + len(text) + len(body)
    head = HEADER.pack(MAGIC, VERSION, length)
    first, second = CHUNK.pack(len(text), JSON_CHUNK), CHUNK.pack(len(body), BIN_CHUNK)
    return b"".join((head, first, text, second, body))


def decode(data: bytes) -> tuple[object, bytes]:
    """The JSON document and the bytes.

    Raises:
        FileFormatError: another kind of file, or chunks that lie outside of it.
    """
    if len(data) < HEADER.size + 2 * CHUNK.size or HEADER.unpack_from(data)[:2] != (MAGIC, VERSION):
        raise FileFormatError("expected a binary glTF 2.0 file (.glb), got another kind of file")
    text, start = _chunk(data, HEADER.size, JSON_CHUNK)
    body, _ = _chunk(data, start, BIN_CHUNK)
    return decode_json(text.decode("utf-8", errors="replace")), body


def _chunk(data: bytes, start: int, kind: int) -> tuple[bytes, int]:
    if start + CHUNK.size > len(data):
        raise FileFormatError("expected two chunks, got fewer; copy the file again")
    length, found = CHUNK.unpack_from(data, start)
    stop = start + CHUNK.size + length
    if found != kind or stop > len(data):
        raise FileFormatError("expected whole chunks of JSON and bytes, got a damaged file")
    return data[start + CHUNK.size : stop], stop
