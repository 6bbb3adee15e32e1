"""Every reader of diff4splat: how to make a small valid example, and how to read it."""

from fuzz.reader import Reader
from fuzz.readers_of_captures import CAPTURES
from fuzz.readers_of_clips import CLIPS
from fuzz.readers_of_datasets import DATASETS
from fuzz.readers_of_images import IMAGES
from fuzz.readers_of_models import MODELS
from fuzz.readers_of_scenes import SCENES
from fuzz.readers_of_settings import SETTINGS

READERS: dict[str, Reader] = SCENES | IMAGES | CAPTURES | CLIPS | DATASETS | MODELS | SETTINGS
"""By the names that ``--reader`` takes."""
