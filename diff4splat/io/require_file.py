"""Check of a path before a reader opens it."""

from pathlib import Path

from diff4splat.errors import Diff4SplatError, FileFormatError


def require_file(file: Path, what: str, error: type[Diff4SplatError] = FileFormatError) -> None:
    """Require a readable, non-empty file; ``what`` names the expected kind in errors.

    Raises:
        error: the path does not exist, is a folder or device, is empty, or is not readable.
    """
    try:
        if not file.exists():
            raise error(f"{file}: expected {what}, got no such file; check the path")
        if not file.is_file():
            kind = "a folder" if file.is_dir() else "a device"
            raise error(f"{file}: expected {what}, got {kind}; give the file itself")
        with file.open("rb") as stream:
            if not stream.read(1):
                raise error(f"{file}: expected {what}, got an empty file; make or copy it again")
    except OSError as failure:
        reason = failure.strerror or "it cannot be opened"
        raise error(f"{file}: expected {what}, got '{reason}'; check the path") from failure
