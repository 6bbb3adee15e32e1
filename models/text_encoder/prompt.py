"""Checks of prompts, before any network is built (and without importing torch)."""

from diff4splat.errors import InputError


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
