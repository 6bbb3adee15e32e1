"""Text to the tokens of CLIP: byte pairs of lower-case words (Sennrich et al. 2016).

A word becomes bytes, each written as one printable character; the last one is marked as the end of
the word. Then the pair that comes first in ``merges.txt`` is joined, until none is left.
"""

import json
import re
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

from diff4splat.errors import CheckpointError, FileFormatError

VOCABULARY, MERGES = "vocab.json", "merges.txt"
FIRST, LAST, END_OF_WORD = "<|startoftext|>", "<|endoftext|>", "</w>"
VERSION = "#version:"
"""Starts a line that is no merge."""
MAX_BYTES = 16 * 2**20
"""Larger files are no vocabulary."""
MAX_TEXT = 10_000
"""Characters that are looked at: the rest would be cut anyway."""
WORDS = re.compile(r"'s|'t|'re|'ve|'m|'ll|'d|[^\W\d_]+|\d|(?:[^\s\w]|_)+", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class ClipTokens:
    """A vocabulary and the order of merges."""

    vocabulary: dict[str, int]
    ranks: dict[tuple[str, str], int]

    def encode(self, text: str, limit: int) -> list[int]:
        """Tokens between those of start and end, at most ``limit`` with both."""
        words = WORDS.findall(" ".join(text[:MAX_TEXT].lower().split()))
        pieces = [piece for word in words for piece in self._pieces(word)]
        end = self.vocabulary[LAST]
        tokens = [self.vocabulary.get(piece, end) for piece in pieces]
        return [self.vocabulary[FIRST], *tokens[: limit - 2], end]

    def _pieces(self, word: str) -> list[str]:
        letters = [_byte_letters()[byte] for byte in word.encode()]
        pieces = [*letters[:-1], letters[-1] + END_OF_WORD]
        while len(pieces) > 1:
            best = min(pairwise(pieces), key=lambda pair: self.ranks.get(pair, len(self.ranks)))
            if best not in self.ranks:
                break
            pieces = _joined(pieces, best)
        return pieces


def read_tokens(folder: Path) -> ClipTokens:
    """Vocabulary and merges of a folder.

    Raises:
        CheckpointError: a file is missing.
        FileFormatError: a file is damaged.
    """
    names, order = _text(folder / VOCABULARY), _text(folder / MERGES)
    try:
        vocabulary = json.loads(names)
        known = isinstance(vocabulary, dict) and {FIRST, LAST} <= vocabulary.keys()
        if not known or not all(type(number) is int for number in vocabulary.values()):
            raise ValueError("no vocabulary of CLIP")
        lines = [line.split() for line in order.splitlines()]
        merges = [tuple(line) for line in lines if len(line) == 2 and line[0] != VERSION]
    except (ValueError, RecursionError) as error:
        raise FileFormatError(
            f"{folder}: expected {VOCABULARY} and {MERGES} of a CLIP, got something else; "
            "fetch the folder again"
        ) from error
    return ClipTokens(vocabulary, {pair: rank for rank, pair in enumerate(merges)})


def _text(file: Path) -> str:
    if not file.is_file():
        raise CheckpointError(f"{file}: expected a file of a CLIP, got none; check the folder")
    try:
        if file.stat().st_size > MAX_BYTES:
            raise ValueError("too large")
        return file.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise FileFormatError(
            f"{file}: expected text of up to {MAX_BYTES // 2**20} MB, got something else ({error})"
        ) from error


def _joined(pieces: list[str], pair: tuple[str, str]) -> list[str]:
    joined: list[str] = []
    for piece in pieces:
        if joined and (joined[-1], piece) == pair:
            joined[-1] += piece
        else:
            joined.append(piece)
    return joined


@cache
def _byte_letters() -> dict[int, str]:
    """A printable character for every byte: its own, or one from 256 on."""
    printable = [*range(33, 127), *range(161, 173), *range(174, 256)]
    rest = [byte for byte in range(256) if byte not in printable]
    letters = {byte: chr(byte) for byte in printable}
    return letters | {byte: chr(256 + index) for index, byte in enumerate(rest)}
