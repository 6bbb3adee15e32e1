"""The text part of a PLY file: which elements follow, how many of each, with which properties.

Format: Turk, "The PLY Polygon File Format", 1994.
"""

from dataclasses import dataclass

from diff4splat.errors import FileFormatError

TYPE_CODES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
"""PLY's names, old and new, for NumPy's type codes."""
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER_BYTES = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Property:
    """One value, or a list of values, of every row of an element."""

    name: str
    code: str
    """NumPy type code of the value, or of the list's items."""
    length_code: str | None = None
    """NumPy type code of the list's length; None for a plain value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Element:
    """``count`` rows with the same properties."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """What the file says about itself."""

    byte_order: str
    """``<`` or ``>`` for binary data, empty for text."""
    elements: tuple[Element, ...]
    data_start: int
    """Position of the first byte after the header."""
    comments: tuple[str, ...] = ()
    """The texts of comment lines."""


def read_header(data: bytes) -> Header:
    """Parse the header at the start of ``data``.

    Raises:
        FileFormatError: not a PLY, no end, or a line that makes no sense.
    """
    lines, data_start = _lines(data)
    byte_order: str | None = None
    elements: list[Element] = []
    comments: list[str] = []
    for line in lines:
        match line.split():
            case [] | ["obj_info", *_]:
                continue
            case ["comment", *words]:
                comments.append(" ".join(words))
            case ["format", kind, _] if kind in _BYTE_ORDERS:
                byte_order = _BYTE_ORDERS[kind]
            case ["element", name, count] if (
                count.isascii() and count.isdigit() and len(count) < 19
            ):
                elements.append(Element(name=name, count=int(count), properties=()))
            case ["property", *words] if elements:
                elements[-1] = _extended(elements[-1], words, line)
            case _:
                raise FileFormatError(f"expected a PLY header line, got {line[:60]!r}")
    if byte_order is None:
        raise FileFormatError("expected a PLY 'format' line, got none")
    return Header(
        byte_order=byte_order,
        elements=tuple(elements),
        data_start=data_start,
        comments=tuple(comments),
    )


def _lines(data: bytes) -> tuple[list[str], int]:
    """The lines between the magic word and ``end_header``, and where the data starts."""
    if data[:4] not in (b"ply\n", b"ply\r"):
        raise FileFormatError("expected a PLY file, got another kind of file; check the path")
    end = data.find(b"\nend_header", 0, _MAX_HEADER_BYTES)
    line_end = data.find(b"\n", end + 1)
    if end < 0 or line_end < 0 or data[end + 1 : line_end].strip() != b"end_header":
        raise FileFormatError(
            "expected 'end_header' to end the PLY header, got none; the file is cut off"
        )
    text = data[:end].decode("ascii", errors="replace")
    return text.split("\n")[1:], line_end + 1


def _extended(element: Element, words: list[str], line: str) -> Element:
    match words:
        case ["list", length, item, name] if length in TYPE_CODES and item in TYPE_CODES:
            new = Property(name=name, code=TYPE_CODES[item], length_code=TYPE_CODES[length])
        case [kind, name] if kind in TYPE_CODES:
            new = Property(name=name, code=TYPE_CODES[kind])
        case _:
            raise FileFormatError(f"expected a PLY property of a known type, got {line[:60]!r}")
    if any(new.name == old.name for old in element.properties):
        raise FileFormatError(f"expected different property names, got {new.name[:60]!r} twice")
    properties = (*element.properties, new)
    return Element(name=element.name, count=element.count, properties=properties)
