"""JSON values as frozen dataclasses, strictly: no unknown key, none missing, numbers of their kind.

Fields may be dataclasses, tuples, literals, numbers, texts and truth values. A whole number is fine
where a fraction is wanted; nothing else is converted. Keys of fields with a default may be missing.
"""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from diff4splat.errors import Diff4SplatError

MAX_QUOTED_CHARACTERS = 60
"""Characters of a refused value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TypedReader:
    """How values are read and refused."""

    error_type: type[Diff4SplatError]
    """Raised for a value that does not fit, with the dotted place where it stands."""
    readers: Mapping[type, Callable[[Any], Any]] = field(default_factory=dict)
    """Readers of classes that know better how they are stored."""
    dependent: Mapping[type, Callable[[Mapping[str, Any]], Mapping[str, Any]]] = field(
        default_factory=dict
    )
    """For some dataclasses: types of fields that depend on the values of other fields."""

    def read(self, kind: Any, value: Any, where: str) -> Any:
        """``value`` as an instance of the annotated ``kind``."""
        if kind in self.readers:
            return self.readers[kind](value)
        if is_dataclass(kind):
            return self._record(kind, value, where)
        if get_origin(kind) is tuple:
            return self._tuple(get_args(kind), value, where)
        if get_origin(kind) is Literal:
            choices = get_args(kind)
            self._require(value in choices, where, f"one of {', '.join(map(str, choices))}", value)
            return value
        return self._plain(kind, value, where)

    def _record(self, kind: type, value: Any, where: str) -> Any:
        self._require(isinstance(value, dict), where, "an object", value)
        hints, known = get_type_hints(kind), {one.name: one for one in fields(kind)}
        for key in value:
            self._require(key in known, where, f"the keys {', '.join(known)}", key)
        for name, one in known.items():
            optional = one.default is not MISSING or one.default_factory is not MISSING
            self._require(name in value or optional, where, f"the key {name!r}", None)
        if kind in self.dependent:
            hints |= self.dependent[kind](value)
        # In the order of the fields: those that others depend on come first.
        present = [name for name in known if name in value]
        return kind(**{key: self.read(hints[key], value[key], f"{where}.{key}") for key in present})

    def _tuple(self, kinds: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
        self._require(isinstance(value, list), where, "a list", value)
        kinds = (kinds[0],) * len(value) if kinds[-1] is Ellipsis else kinds
        self._require(len(value) == len(kinds), where, f"{len(kinds)} values", value)
        pairs = enumerate(zip(kinds, value, strict=True))
        return tuple(self.read(kind, one, f"{where}[{place}]") for place, (kind, one) in pairs)

    def _plain(self, kind: type, value: Any, where: str) -> Any:
        allowed = (int, float) if kind is float else kind
        # bool is an int to Python, but true is no number to anybody else.
        fits = isinstance(value, allowed) and (kind is bool or not isinstance(value, bool))
        self._require(fits, where, kind.__name__, value)
        return float(value) if kind is float else value

    def _require(self, holds: bool, where: str, expected: str, got: Any) -> None:
        if not holds:
            shown = "none" if got is None else repr(got)[:MAX_QUOTED_CHARACTERS]
            raise self.error_type(f"{where}: expected {expected}, got {shown}; correct it")
