"""What a user decides about an import, because the public model does not."""

from dataclasses import dataclass

DEFAULT_FRAMES = 49


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """What the public model does not decide."""

    reconstruction: str = "paper"
    """The size whose LDRM and deformation network the model gets."""
    frames: int = DEFAULT_FRAMES
    size_px: tuple[int, int] | None = None
    """(height, width); None: what the public model was trained at."""
    tile_px: tuple[int, int] | None = None
    """(height, width) of the tiles of an autoencoder that can work in tiles; None: none."""
    seed: int = 0
    """Of the new layers that are not zero."""
