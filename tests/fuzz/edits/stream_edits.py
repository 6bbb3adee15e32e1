"""Damage inside gzip streams and GLB files that stay whole around it."""

import gzip
import struct
from random import Random

from fuzz.edits.byte_edits import BYTE_EDITS
from fuzz.edits.json_edits import JSON_EDITS

_CHUNK = struct.Struct("<II")


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
