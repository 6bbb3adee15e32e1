"""Mounted as ``diff4splat.training``."""

if __name__ != "diff4splat.training":
    raise ImportError(f"import 'diff4splat.training', not {__name__!r}: this folder is mounted")
