"""A SentencePiece vocabulary (``spiece.model``) as a tokenizer of Hugging Face, in JSON.

Only unigram models, which T5 has. The file is a protocol buffer: pieces with score and kind in
field 1, the normaliser's table of characters in field 2 of field 3.
"""

import base64
import json
import struct
from pathlib import Path

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import read_bytes
from diff4splat.models.depth_priors.protobuf import Message

PIECES_FILE = "spiece.model"
MAX_BYTES, MAX_PIECES = 64 << 20, 1 << 20
PIECES, TRAINER, NORMALIZER = 1, 2, 3
PIECE, SCORE = 1, 2
MODEL_TYPE, UNIGRAM = 3, 1
CHARACTERS = 2
UNKNOWN, END = "<unk>", "</s>"
SPACE = "▁"


def tokenizer_json(file: Path) -> bytes:
    """The same vocabulary, which appends the end token to every prompt.

    Raises:
        FileFormatError: damaged, too large, or another kind of vocabulary.
    """
    data = read_bytes(file, "a SentencePiece vocabulary", max_bytes=MAX_BYTES)
    try:
        vocabulary, characters = _read(data)
        numbers = {piece: number for number, (piece, _) in enumerate(vocabulary)}
        unknown, end = numbers[UNKNOWN], numbers[END]
    except (FileFormatError, KeyError, ValueError, struct.error) as error:
        raise FileFormatError(
            f"{file}: expected a SentencePiece vocabulary of unigrams with {UNKNOWN} and {END}, "
            "got a damaged file or another kind; download it again"
        ) from error
    return json.dumps(_tokenizer(vocabulary, characters, unknown, end)).encode()


def _read(data: bytes) -> tuple[list[tuple[str, float]], bytes]:
    """Pieces with their scores, and the table of characters."""
    whole = Message(data, 0, len(data))
    vocabulary, characters = [], b""
    for field, value in whole:
        if field == PIECES and isinstance(value, Message):
            vocabulary.append(_piece(value))
        elif field == TRAINER and isinstance(value, Message):
            _require_unigram(value)
        elif field == NORMALIZER and isinstance(value, Message):
            for table in value.messages(CHARACTERS):
                characters = bytes(table.data[table.start : table.stop])
        if len(vocabulary) > MAX_PIECES:
            raise ValueError("too many pieces")
    return vocabulary, characters


def _piece(message: Message) -> tuple[str, float]:
    score = 0.0
    for part in message.messages(SCORE):
        (score,) = struct.unpack("<f", part.data[part.start : part.stop])
    return message.text(PIECE), score


def _require_unigram(trainer: Message) -> None:
    if trainer.number(MODEL_TYPE) not in (0, UNIGRAM):
        raise ValueError("another kind of model")


def _tokenizer(
    vocabulary: list[tuple[str, float]], characters: bytes, unknown: int, end: int
) -> dict[str, object]:
    steps: list[dict[str, object]] = [
        {"type": "Strip", "strip_left": True, "strip_right": True},
        {"type": "Replace", "pattern": {"Regex": " {2,}"}, "content": " "},
    ]
    if characters:
        table = base64.b64encode(characters).decode()
        steps.insert(0, {"type": "Precompiled", "precompiled_charsmap": table})
    prompt = {"Sequence": {"id": "A", "type_id": 0}}
    closed = [prompt, {"SpecialToken": {"id": END, "type_id": 0}}]
    return {
        "version": "1.0",
        "added_tokens": [],
        "normalizer": {"type": "Sequence", "normalizers": steps},
        "pre_tokenizer": {
            "type": "Metaspace",
            "replacement": SPACE,
            "prepend_scheme": "always",
            "split": True,
        },
        "post_processor": {
            "type": "TemplateProcessing",
            "single": closed,
            "pair": [*closed, {"Sequence": {"id": "B", "type_id": 1}}],
            "special_tokens": {END: {"id": END, "ids": [end], "tokens": [END]}},
        },
        "decoder": None,
        "model": {
            "type": "Unigram",
            "unk_id": unknown,
            "vocab": vocabulary,
            "byte_fallback": False,
        },
    }
