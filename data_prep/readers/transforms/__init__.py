"""Captures in transforms.json files: nerfstudio and D-NeRF."""
