"""Mounted as ``diff4splat.configs``."""

if __name__ != "diff4splat.configs":
    raise ImportError(f"import 'diff4splat.configs', not {__name__!r}: this folder is mounted")
