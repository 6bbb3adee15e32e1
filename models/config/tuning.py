"""Which weights of the video model learn: all, the added layers alone, or these and LoRA."""

from typing import Literal

Tuning = Literal["full", "adapters", "lora"]
TUNINGS = ("full", "adapters", "lora")
ADAPTER_FILE = "adapter.safetensors"
"""In a folder: what a stage taught a video model beside its own weights."""
