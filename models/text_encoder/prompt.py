"""Prompts as bytes and their checks, before any network is built (and without importing torch).

A token is a UTF-8 byte 0 … 255, so there is no vocabulary file; 256 pads, 257 begins and 258 ends a
prompt.
"""

from diff4splat.errors import InputError

PAD, BEGIN, END = 256, 257, 258
VOCABULARY = 259


def token_row(prompt: str, max_bytes: int) -> list[int]:
    """The tokens of one prompt.

    Raises:
        InputError: as ``require_prompt``.
    """
    return [BEGIN, *require_prompt(prompt, max_bytes).encode("utf-8"), END]


def require_prompt(prompt: str, max_bytes: int) -> str:
    """Return ``prompt`` when the text encoder can read it.

    Raises:
        InputError: empty, not text that UTF-8 can hold, or longer than ``max_bytes`` in UTF-8.
    """
    if not prompt.strip():
        raise InputError(
            "prompt: expected some text, got none; leave the prompt out to generate without one"
        )
    try:
        count = len(prompt.encode("utf-8"))
    except UnicodeEncodeError as error:
        raise InputError(
            f"prompt: expected text, got a damaged character at position {error.start}; retype it"
        ) from error
    if count > max_bytes:
        raise InputError(
            f"prompt: expected at most {max_bytes} bytes of UTF-8, got {count}; "
            f"shorten it by {count - max_bytes}"
        )
    return prompt
