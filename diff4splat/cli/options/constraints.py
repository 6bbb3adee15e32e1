"""What an argument must be, declared beside its option and checked before any library is loaded.

    steps: Annotated[int | None, Number(least=1, most=1000)] = None

A command may have a method ``check`` for what concerns several options. It imports no torch either.
"""

import errno
import math
import os
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Protocol, get_type_hints, runtime_checkable

import tyro

from diff4splat.errors import ConfigError, InputError
from diff4splat.io.atomic import output_error
from diff4splat.io.require_file import require_file


@runtime_checkable
class Constraint(Protocol):
    """Part of an annotation."""

    def check(self, option: str, value: Any) -> None:
        """Raise a Diff4SplatError if ``value`` cannot be used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A finite number in a range; of several, each."""

    least: float | int = -math.inf
    most: float | int = math.inf
    above: float | int | None = None
    """An open lower end, in place of ``least``."""

    def check(self, option: str, value: float | int | tuple[float | int, ...]) -> None:
        """Refuse numbers out of range, NaN and infinity."""
        for number in value if isinstance(value, tuple) else (value,):
            above = self.above is None or number > self.above
            if not (self.least <= number <= self.most and above and abs(number) < math.inf):
                raise ConfigError(f"{option}: expected {self._range()}, got {number:g}")

    def _range(self) -> str:
        most = f"at most {self.most:g}" if self.most < math.inf else ""
        if self.above is not None:
            return f"more than {self.above:g}" + (f" and {most}" if most else "")
        if self.least > -math.inf:
            return f"{self.least:g} to {self.most:g}" if most else f"at least {self.least:g}"
        return most or "a finite number"


@dataclass(frozen=True, slots=True, kw_only=True)
class InputPath:
    """Something to read."""

    what: str
    file: bool = True
    folder: bool = True

    def check(self, option: str, value: Path | tuple[Path, ...]) -> None:
        """Refuse what is not there, empty files, and pipes and devices, which would hang."""
        del option
        for path in value if isinstance(value, tuple) else (value,):
            if not (self.folder and self._is_folder(path)):
                require_file(path, self.what, InputError)
                if not self.file:
                    raise InputError(f"{path}: expected {self.what}, got a file; name the folder")

    def _is_folder(self, path: Path) -> bool:
        try:
            return path.is_dir()
        except OSError:
            return False  # longer than any name, which `require_file` says


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputFile:
    """A file to write."""

    suffixes: tuple[str, ...] = ()
    """Allowed endings; any, if there are none."""

    def check(self, option: str, value: Path) -> None:
        """Refuse other endings, and places where no file can be written."""
        if self.suffixes and value.suffix.lower() not in self.suffixes:
            endings = ", ".join(self.suffixes)
            raise ConfigError(f"{option}: expected a name ending in {endings}, got {value}")
        require_writable(value, is_folder=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputFolder:
    """A folder to write files into; it may exist."""

    def check(self, option: str, value: Path) -> None:
        """Refuse places where no folder can be made or written."""
        del option
        require_writable(value, is_folder=True)


OutFolder = Annotated[Path, OutputFolder(), tyro.conf.arg(aliases=("-o",))]
OutFile = Annotated[Path, OutputFile(), tyro.conf.arg(aliases=("-o",))]


def require_writable(target: Path, *, is_folder: bool) -> None:
    """Require that ``target`` can be made or replaced, as far as that shows without writing.

    Raises:
        OutputError: with what stands in the way.
    """
    try:
        if target.exists():
            _require_kind(target, is_folder)
        folder = target if is_folder and target.exists() else target.parent
        while not folder.exists():
            folder = folder.parent
        if not folder.is_dir():
            raise OSError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        if not os.access(folder, os.W_OK | os.X_OK):
            raise OSError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise output_error(target, error) from error


def _require_kind(target: Path, is_folder: bool) -> None:
    """Refuse a file in place of a folder, a folder in place of a file, and devices."""
    if is_folder and not target.is_dir():
        raise OSError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
    if not is_folder and target.is_dir():
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not is_folder and not target.is_file():
        raise OSError(errno.EINVAL, "a pipe or device stands there; choose another name")


def check_arguments(command: Any) -> None:
    """Check every field of a command and of its groups of options.

    Raises:
        Diff4SplatError: the first argument that cannot be used.
    """
    hints = get_type_hints(type(command), include_extras=True)
    for field in fields(command):
        value = getattr(command, field.name)
        if is_dataclass(value):
            check_arguments(value)
        elif value is not None:
            option = f"--{field.name.replace('_', '-')}"
            for mark in getattr(hints[field.name], "__metadata__", ()):
                if isinstance(mark, Constraint):
                    mark.check(option, value)
    if hasattr(command, "check"):
        command.check()
