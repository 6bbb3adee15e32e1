"""The data part of a PLY file: the plain columns of its elements, from text or binary.

List properties are stepped over row by row, everything else is read at once; text in blocks, as
Python's words take twenty times the memory of their characters.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from diff4splat.errors import FileFormatError
from diff4splat.io.ply.ply_header import Element, Header

Columns = dict[str, np.ndarray]
_BLOCK_BYTES = 1 << 22
_SPACES = (b" ", b"\n", b"\r", b"\t", b"\v", b"\f")


def read_columns(data: bytes, header: Header, name: str) -> Columns:
    """The values of every plain property of element ``name``, as numbers of the stored type.

    Elements after it are not looked at.

    Raises:
        FileFormatError: there is no such element, or the data ends too early.
    """
    names = [element.name for element in header.elements]
    if name not in names:
        raise FileFormatError(f"expected an element '{name}', got {repr(names)[:60]}")
    source = _source(data, header)
    for element in header.elements[: names.index(name)]:
        source.read(element)
    return source.read(header.elements[names.index(name)])


def read_elements(data: bytes, header: Header, needed: str) -> Mapping[str, Columns]:
    """The columns of every element, as far as the data goes; ``needed`` must be whole.

    Raises:
        FileFormatError: there is no element ``needed``, or the data ends before its end.
    """
    names = [element.name for element in header.elements]
    if needed not in names:
        raise FileFormatError(f"expected an element '{needed}', got {repr(names)[:60]}")
    source, found = _source(data, header), {}
    for place, element in enumerate(header.elements):
        try:
            found[element.name] = source.read(element)
        except FileFormatError:
            if place <= names.index(needed):
                raise
            break
    return found


def _source(data: bytes, header: Header) -> "_Binary | _Text":
    return _Binary(data, header) if header.byte_order else _Text(data, header)


def _has_lists(element: Element) -> bool:
    return any(prop.length_code for prop in element.properties)


def _cut_off(element: Element) -> FileFormatError:
    return FileFormatError(
        f"expected {element.count} rows of element {element.name[:40]!r}, got fewer; "
        "the file is cut off, copy it again"
    )


def _length(element: Element, value: float) -> int:
    if not 0 <= value < 2**32:
        raise FileFormatError(
            f"expected list lengths from 0 in element {element.name[:40]!r}, got {value:g}"
        )
    return int(value)


class _Binary:
    """Reads element after element from packed rows."""

    def __init__(self, data: bytes, header: Header) -> None:
        self.data, self.order, self.position = data, header.byte_order, header.data_start

    def read(self, element: Element) -> Columns:
        if _has_lists(element):
            rows = np.array([list(self._row(element)) for _ in range(element.count)])
            return _by_name(element, rows)
        layout = np.dtype([(p.name, self.order + p.code) for p in element.properties])
        size = element.count * layout.itemsize
        if self.position + size > len(self.data):
            raise _cut_off(element)
        start, self.position = self.position, self.position + size
        if size == 0:
            return {p.name: np.zeros(0) for p in element.properties}
        table = np.frombuffer(self.data, layout, element.count, start)
        return {p.name: table[p.name] for p in element.properties}

    def _row(self, element: Element) -> Iterator[float]:
        for prop in element.properties:
            value = self._take(element, prop.length_code or prop.code, 1)[0]
            if prop.length_code is None:
                yield float(value)
            else:
                self._take(element, prop.code, _length(element, float(value)))

    def _take(self, element: Element, code: str, count: int) -> np.ndarray:
        kind = np.dtype(self.order + code)
        end = self.position + count * kind.itemsize
        if end > len(self.data):
            raise _cut_off(element)
        start, self.position = self.position, end
        return np.frombuffer(self.data[start:end], kind)


class _Text:
    """Reads element after element from words separated by white space."""

    def __init__(self, data: bytes, header: Header) -> None:
        self.data, self.position = data, header.data_start
        self.words: list[bytes] = []
        self.used = 0

    def read(self, element: Element) -> Columns:
        if _has_lists(element):
            rows = np.array([list(self._row(element)) for _ in range(element.count)])
        else:
            width = len(element.properties)
            rows = self._take(element, element.count * width).reshape(element.count, width)
        return _by_name(element, rows)

    def _row(self, element: Element) -> Iterator[float]:
        for prop in element.properties:
            value = float(self._take(element, 1)[0])
            if prop.length_code is None:
                yield value
            else:
                self._take(element, _length(element, value))

    def _take(self, element: Element, count: int) -> np.ndarray:
        blocks, missing = [np.zeros(0)], count
        while missing:
            if self.used == len(self.words):
                self._next_words(element, missing)
            taken = self.words[self.used : self.used + missing]
            self.used += len(taken)
            missing -= len(taken)
            blocks.append(_numbers(taken, element))
        return np.concatenate(blocks)

    def _next_words(self, element: Element, missing: int) -> None:
        """The words of the next block that has some."""
        self.words, self.used = [], 0
        while not self.words:
            if 2 * missing > len(self.data) - self.position + 1:
                raise _cut_off(element)  # each word takes a character and a space
            stop = self.position + _BLOCK_BYTES
            if stop < len(self.data):
                # Not inside of a word, unless it is longer than a block.
                spaces = (self.data.rfind(space, self.position, stop) + 1 for space in _SPACES)
                last = max(spaces)
                stop = last if last > self.position else stop
            self.words = self.data[self.position : stop].split()
            self.position = stop


def _numbers(words: list[bytes], element: Element) -> np.ndarray:
    try:
        return np.array(words, dtype=np.float64)
    except ValueError as error:
        raise FileFormatError(
            f"expected numbers in element {element.name[:40]!r}, got other text; "
            "copy the file again"
        ) from error


def _by_name(element: Element, rows: np.ndarray) -> Columns:
    plain = [prop.name for prop in element.properties if prop.length_code is None]
    table = rows.reshape(element.count, len(plain))
    return {name: table[:, i] for i, name in enumerate(plain)}
