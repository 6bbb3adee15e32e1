"""Damage to bytes of any kind: flips, cuts, repeats, extreme numbers, deep nesting."""

import struct
from collections.abc import Callable
from random import Random

BytesEdit = Callable[[bytes, Random], bytes]
"""The content after one edit; all chance comes from the generator."""

NUMBERS = (0, 1, 2, 255, 256, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**62, 2**63, 2**64 - 1)
WORDS = (
    *(b"NaN", b"inf", b"-1", b"1e400", b"-0.0", b"9" * 400, b"9" * 5000, b"1" * 20, b"0"),
    *(b"\xc2\xb2", b"\xff\xfe", b"\0", b"null", b"true", b"x" * 300, b"y" * 5000, b"../../a"),
    *(b"[" * 200, b"{" * 5000, b"(" * 100_000, b'"', b"\\", b"\n", b"#", b" ", b"%s"),
)


def flip_bits(content: bytes, rng: Random) -> bytes:
    """One to eight bits."""
    changed = bytearray(content)
    for _ in range(rng.randint(1, 8) if changed else 0):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def truncate(content: bytes, rng: Random) -> bytes:
    """The start alone."""
    return content[: rng.randrange(len(content) + 1)]


def remove_block(content: bytes, rng: Random) -> bytes:
    """Without some bytes."""
    start, end = _block(content, rng)
    return content[:start] + content[end:]


def repeat_block(content: bytes, rng: Random) -> bytes:
    """With some bytes up to 500 times."""
    start, end = _block(content, rng)
    return content[:start] + content[start:end] * rng.choice((2, 3, 20, 500)) + content[end:]


def move_block(content: bytes, rng: Random) -> bytes:
    """With some bytes written over others."""
    start, end = _block(content, rng)
    place = rng.randrange(len(content) + 1)
    return content[:place] + content[start:end] + content[place + end - start :]


def zero_block(content: bytes, rng: Random) -> bytes:
    """With zeros, or ones, in place of some bytes."""
    start, end = _block(content, rng)
    return content[:start] + rng.choice((b"\0", b"\xff")) * (end - start) + content[end:]


def write_number(content: bytes, rng: Random) -> bytes:
    """An extreme whole or floating-point number over 2 to 8 bytes, in either order."""
    layout = rng.choice("<>") + rng.choice("HIQQfd")
    if layout[1] in "fd":
        value = rng.choice((float("nan"), float("inf"), -1.0, 1e30, 0.0))
    else:
        value = rng.choice(NUMBERS) & (1 << 8 * struct.calcsize(layout)) - 1
    packed = struct.pack(layout, value)
    place = _place(content, rng)
    return content[:place] + packed + content[place + len(packed) :]


def insert_word(content: bytes, rng: Random) -> bytes:
    """A word that text readers stumble over."""
    place = _place(content, rng)
    return content[:place] + rng.choice(WORDS) + content[place:]


def replace_word(content: bytes, rng: Random) -> bytes:
    """A word of a text, or of a text header, replaced by such a word."""
    words = content[: 1 << 16].split()
    if not words:
        return insert_word(content, rng)
    return content.replace(rng.choice(words), rng.choice(WORDS), rng.choice((1, 1, 2)))


BYTE_EDITS: dict[str, BytesEdit] = {
    edit.__name__: edit
    for edit in (
        *(flip_bits, truncate, remove_block, repeat_block, move_block, zero_block),
        *(write_number, insert_word, replace_word),
    )
}


def _place(content: bytes, rng: Random) -> int:
    """Any position; half of the time in the first kilobyte, where headers are."""
    return rng.randrange(min(len(content), rng.choice((1024, len(content)))) + 1)


def _block(content: bytes, rng: Random) -> tuple[int, int]:
    start = _place(content, rng)
    return start, min(start + rng.choice((1, 4, 8, 64, 1000)), len(content))
