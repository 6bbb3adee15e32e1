"""The wire format of protocol buffers, walked without taking values into memory.

A message is a row of fields: a key (number and wire type) and a number, or a length and so many
bytes. Weights are skipped by their length, so a file of gigabytes costs what its names cost.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from diff4splat.errors import FileFormatError

Buffer = bytes | memoryview
VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
_MAX_TEXT = 4096
_CUT_OFF = "expected a whole ONNX graph, got a cut off or damaged file"


@dataclass(frozen=True, slots=True)
class Message:
    """Bytes ``start`` to ``stop`` of a file."""

    data: Buffer
    start: int
    stop: int

    def __iter__(self) -> Iterator[tuple[int, "int | Message"]]:
        """(field number, number or bytes) one after the other.

        Raises:
            FileFormatError: a length points outside of the message.
        """
        place = self.start
        while place < self.stop:
            key, place = self._varint(place)
            number, kind = key >> 3, key & 7
            if number == 0:
                raise FileFormatError(_CUT_OFF)
            if kind == VARINT:
                value, place = self._varint(place)
                yield number, value
            elif kind == BYTES:
                length, place = self._varint(place)
                yield number, self._part(place, length)
                place += length
            elif kind in (FIXED32, FIXED64):
                length = 4 if kind == FIXED32 else 8
                yield number, self._part(place, length)
                place += length
            else:
                raise FileFormatError(_CUT_OFF)

    def messages(self, number: int) -> Iterator["Message"]:
        """The messages in one field."""
        return (value for key, value in self if key == number and isinstance(value, Message))

    def text(self, number: int) -> str:
        """The last text of a field; empty without one."""
        found = ""
        for part in self.messages(number):
            found = part.decoded()
        return found

    def number(self, field: int) -> int:
        """The last number of a field; 0 without one."""
        found = 0
        for key, value in self:
            if key == field and isinstance(value, int):
                found = value
        return found

    def decoded(self) -> str:
        """These bytes as text, cut to a sane length."""
        return bytes(self.data[self.start : min(self.stop, self.start + _MAX_TEXT)]).decode(
            "utf-8", "replace"
        )

    def numbers(self) -> Iterator[int]:
        """These bytes as packed numbers."""
        place = self.start
        while place < self.stop:
            value, place = self._varint(place)
            yield value

    def _part(self, start: int, length: int) -> "Message":
        if start + length > self.stop:
            raise FileFormatError(_CUT_OFF)
        return Message(self.data, start, start + length)

    def _varint(self, place: int) -> tuple[int, int]:
        value = 0
        for shift in range(0, 70, 7):
            if place >= self.stop:
                break
            byte = self.data[place]
            place += 1
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value & (1 << 64) - 1, place
        raise FileFormatError(_CUT_OFF)
