"""Steps that all formats share: intrinsics, test splits and assembly of a capture."""
