"""Fonts for any text: Pillow's own, then those of the system, then a visible box.

Pillow brings one font for Latin letters. Others, and emoji, need a font of the system; a character
that no font has is drawn as an empty box, never as nothing.
"""

import unicodedata
from collections.abc import Iterator
from functools import cache
from itertools import groupby
from pathlib import Path

from PIL import ImageFont

Font = ImageFont.FreeTypeFont
FOLDERS = (
    "/usr/share/fonts",
    "/usr/local/share/fonts",
    "~/.local/share/fonts",
    "~/.fonts",
    "/Library/Fonts",
    "/System/Library/Fonts",
    "C:/Windows/Fonts",
)
FILES = (
    *("NotoSansCJK-Regular.ttc", "NotoSansCJKsc-Regular.otf", "DroidSansFallbackFull.ttf"),
    *("wqy-microhei.ttc", "wqy-zenhei.ttc", "ipag.ttf", "PingFang.ttc", "Hiragino Sans GB.ttc"),
    *("Arial Unicode.ttf", "msyh.ttc", "msgothic.ttc", "malgun.ttf", "NotoSans-Regular.ttf"),
    *("NotoEmoji-Regular.ttf", "Symbola.ttf", "seguiemj.ttf", "seguisym.ttf", "DejaVuSans.ttf"),
)
"""Fonts with outlines that systems bring, in order of preference."""
ABSENT = "\U0010fffe"
"""Belongs to no alphabet, so every font draws its sign for a missing character."""
BOX_EM = 0.7
"""Width of a box in sizes of the font."""


@cache
def fonts(size_px: int) -> tuple[Font, ...]:
    """Pillow's own font, then those of the system."""
    return (ImageFont.load_default(size_px), *_system_fonts(size_px))


def runs(text: str, size_px: int) -> Iterator[tuple[Font | None, str]]:
    """Stretches of ``text`` in one font each; None draws boxes."""
    shown = (character for character in text if not _is_invisible(character))
    for font, part in groupby(shown, lambda character: _font_of(character, size_px)):
        yield font, "".join(part)


def run_width(font: Font | None, text: str, size_px: int) -> float:
    """Pixels that one stretch takes."""
    return BOX_EM * size_px * len(text) if font is None else font.getlength(text)


@cache
def _system_fonts(size_px: int) -> tuple[Font, ...]:
    found = []
    for file in _font_files():
        try:
            found.append(ImageFont.truetype(str(file), size_px))
        except OSError:  # damaged, or of a kind that FreeType lacks
            continue
    return tuple(found)


@cache
def _font_files() -> tuple[Path, ...]:
    present: dict[str, Path] = {}
    for folder in FOLDERS:
        try:
            for file in Path(folder).expanduser().rglob("*.*"):
                present.setdefault(file.name, file)
        except (OSError, RuntimeError):
            continue
    return tuple(present[name] for name in FILES if name in present)


@cache
def _font_of(character: str, size_px: int) -> Font | None:
    """The first font that has the character."""
    for font in fonts(size_px):
        if character.isspace() or _drawn(font, character) != _drawn(font, ABSENT):
            return font
    return None


def _drawn(font: Font, character: str) -> tuple[tuple[int, int], bytes]:
    mask = font.getmask(character)
    return mask.size, bytes(mask)


def _is_invisible(character: str) -> bool:
    """Joiners and variants of emoji, which fonts without them would draw as boxes."""
    return unicodedata.category(character) == "Cf" or "\ufe00" <= character <= "\ufe0f"
