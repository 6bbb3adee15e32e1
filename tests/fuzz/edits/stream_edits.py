"""Damage inside gzip and zstd streams, GLB and PLY files that stay whole around it."""

import gzip
import struct
from random import Random

from fuzz.edits.byte_edits import BYTE_EDITS
from fuzz.edits.json_edits import JSON_EDITS

_CHUNK, _SIZES = struct.Struct("<II"), struct.Struct("<QQ")
_EXTREMES = (float("nan"), float("inf"), -float("inf"), 3e38, -3e38, 1e-45, 0.0, -1.0, 100.0)


def edit_gzip(content: bytes, rng: Random) -> bytes:
    """An edit of what is compressed, or of its first bytes alone."""
    inner = gzip.decompress(content)
    head = rng.choice((16, len(inner)))
    edit = rng.choice(list(BYTE_EDITS.values()))
    return gzip.compress(edit(inner[:head], rng) + inner[head:], mtime=0)


def edit_glb_document(content: bytes, rng: Random) -> bytes:
    """An edit of the JSON chunk, with lengths that are right."""
    length, kind = _CHUNK.unpack_from(content, 12)
    edit = rng.choice(list(JSON_EDITS.values()))
    text = edit(content[20 : 20 + length], rng)
    text += b" " * (-len(text) % 4)
    rest = _CHUNK.pack(len(text), kind) + text + content[20 + length :]
    return content[:8] + struct.pack("<I", 12 + len(rest)) + rest


def edit_zstd_column(content: bytes, rng: Random) -> bytes:
    """SPZ 4: an edit of one column, with sizes that are right."""
    import zstandard

    streams, table_start = content[15], int.from_bytes(content[16:20], "little")
    table = list(_SIZES.iter_unpack(content[table_start:][: streams * _SIZES.size]))
    start, columns = table_start + streams * _SIZES.size, []
    for packed, _ in table:
        columns.append(zstandard.ZstdDecompressor().decompress(content[start : start + packed]))
        start += packed
    chosen = rng.randrange(streams)
    columns[chosen] = rng.choice(list(BYTE_EDITS.values()))(columns[chosen], rng)
    packed = [zstandard.ZstdCompressor().compress(column) for column in columns]
    sizes = (_SIZES.pack(len(p), len(c)) for p, c in zip(packed, columns, strict=True))
    return content[:table_start] + b"".join(sizes) + b"".join(packed)


def edit_ply_row(content: bytes, rng: Random) -> bytes:
    """PLY: extreme numbers in place of some of its binary values."""
    start = content.index(b"end_header") + len(b"end_header\n")
    values = bytearray(content[start:])
    for _ in range(rng.choice((1, 1, 2, 5))):
        place = 4 * rng.randrange(max(len(values) // 4, 1))
        values[place : place + 4] = struct.pack("<f", rng.choice(_EXTREMES))
    return content[:start] + bytes(values)
