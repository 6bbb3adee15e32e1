"""Endings of files that other programs read; imports no library."""

SPLAT_SUFFIXES = (".ply", ".spz", ".glb")
"""Gaussians at one moment."""
USD_SUFFIXES, ONNX_SUFFIX, SCENE_SUFFIX = (".usdc", ".usda", ".usd"), ".onnx", ".safetensors"
MOVING_SUFFIXES = (SCENE_SUFFIX, *USD_SUFFIXES, ONNX_SUFFIX)
"""Gaussians at all times."""
