"""Prompts to the tokens of a public text encoder, by the optional package ``tokenizers``."""

import html
import re
from pathlib import Path
from typing import Any

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.require_file import read_text

TOKENIZER_FILE = "tokenizer.json"


class Tokenizer:
    """A vocabulary in the format of the Hugging Face tokenizers."""

    def __init__(self, file: Path, max_tokens: int, *, cleans: bool = True) -> None:
        self._cleans = cleans
        self._tokenizer = _read(file)
        self._tokenizer.no_padding()
        self._tokenizer.enable_truncation(max_tokens)

    def token_row(self, prompt: str) -> list[int]:
        """Tokens of one prompt with the end token, cut to the longest that the model takes.

        ``cleans``: as Wan's pipeline does first.
        """
        return self._tokenizer.encode(clean_prompt(prompt) if self._cleans else prompt).ids


def clean_prompt(prompt: str) -> str:
    """The prompt as Wan's pipeline cleans it: entities resolved twice, single spaces."""
    resolved = html.unescape(html.unescape(prompt))
    return re.sub(r"\s+", " ", resolved).strip()


def _read(file: Path) -> Any:
    try:
        from tokenizers import Tokenizer as Reader
    except ImportError as error:
        raise ConfigError(
            "text encoder: expected the package tokenizers, got none; pip install tokenizers"
        ) from error
    try:
        return Reader.from_str(read_text(file, "a tokenizer"))
    except (FileFormatError, ConfigError):
        raise
    # The library raises bare exceptions.
    except Exception as error:
        raise FileFormatError(
            f"{file}: expected a tokenizer in JSON, got a damaged file; import the model again"
        ) from error
