"""Digest of a file."""

import hashlib
from pathlib import Path


def file_sha256(file: Path) -> str:
    """SHA-256 in hexadecimal."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()
