"""Text from prompts and files as people may safely see it: without control characters."""

import unicodedata

REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
_HIDDEN = {"Cc", "Cs", "Zl", "Zp"}
"""Controls such as escape sequences of terminals, halves of characters, line ends."""
_BIDI = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""What makes text run in another order than it is written."""


def plain_text(text: str) -> str:
    """``text`` with blanks for line ends and a visible sign for each other control character."""
    return "".join(_plain(character) for character in text)


def _plain(character: str) -> str:
    if character in "\t\n\r\v\f":
        return " "
    hidden = unicodedata.category(character) in _HIDDEN or character in _BIDI
    return REPLACEMENT if hidden else character
