"""Mounted as ``diff4splat.models``."""

if __name__ != "diff4splat.models":
    raise ImportError(f"import 'diff4splat.models', not {__name__!r}: this folder is mounted")
