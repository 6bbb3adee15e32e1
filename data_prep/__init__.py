"""Mounted as ``diff4splat.data_prep``."""

if __name__ != "diff4splat.data_prep":
    raise ImportError(f"import 'diff4splat.data_prep', not {__name__!r}: this folder is mounted")
