"""Camera paths: presets, key frames and file formats."""
