"""Failures to write, in words that say what to do."""

import errno
from pathlib import Path

from diff4splat.errors import OutputError

_ADVICE = {
    errno.ENOSPC: "the disk is full; free some space or choose another folder",
    errno.EDQUOT: "the disk quota is used up; free some space or choose another folder",
    errno.EFBIG: "the file would be larger than this system allows; choose another folder",
    errno.EACCES: "no permission to write there; choose another folder",
    errno.EPERM: "no permission to write there; choose another folder",
    errno.EROFS: "the file system is read-only; choose another folder",
    errno.ENOTDIR: "a file stands where a folder is needed; choose another folder",
    errno.EEXIST: "a file stands where a folder is needed; choose another folder",
    errno.EISDIR: "a folder stands where the file should go; remove it or choose another name",
    errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
}


def output_error(target: Path, error: OSError) -> OutputError:
    """The same failure in words that say what to do."""
    advice = _ADVICE.get(error.errno or 0, error.strerror or str(error))
    return OutputError(f"{target}: expected to write here, but {advice}")
