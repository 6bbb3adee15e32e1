"""Where given depth comes from: a network in an ONNX file, or a map beside the photograph."""

import math
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import cv2
import numpy as np

from diff4splat.errors import ConfigError, InputError
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.inputs.photo_window import PhotoWindow
from diff4splat.io.depth_maps.depth_file import DepthFile, read_depth_file
from diff4splat.io.photos.upright import upright_array
from diff4splat.models.depth_priors.kinds import KINDS, DepthKind, DepthMap
from diff4splat.models.depth_priors.onnx_prior import OnnxDepthPrior

SHAPE_TOLERANCE = 0.04
"""Of the ratio of sides: networks round both to multiples of 14 of about 518."""


@runtime_checkable
class DepthSource(Protocol):
    """Depth of a photograph."""

    @property
    def kind(self) -> DepthKind:
        """What its numbers are."""

    def depth_map(self, image: InputImage) -> DepthMap:
        """Depth of exactly what ``image`` shows, on a grid of any size."""

    def record(self) -> dict[str, Any]:
        """Which it is, for the card."""


class NetworkDepth:
    """A depth network of others."""

    def __init__(self, prior: OnnxDepthPrior) -> None:
        self.prior = prior

    @property
    def kind(self) -> DepthKind:
        """What its numbers are."""
        return self.prior.kind

    def depth_map(self, image: InputImage) -> DepthMap:
        """The network's own size; the image is upright already."""
        focal = tuple(image.camera.focal_px.tolist())
        return self.prior.predict(image.rgb, focal)

    def record(self) -> dict[str, Any]:
        """File, family and digest."""
        contract = self.prior.contract
        return {
            "source": "network",
            "file": str(self.prior.file),
            "family": contract.family,
            "sha256": self.prior.sha256(),
        }


class FileDepth:
    """A depth map of the whole photograph.

    Raises:
        InputError: the file cannot be read.
        ConfigError: it does not say what its numbers are, and nobody else does.
    """

    def __init__(self, file: Path, kind: DepthKind | None = None) -> None:
        self.file, self.found = file, read_depth_file(file)
        self._kind = kind or require_stated(file, self.found)

    @property
    def kind(self) -> DepthKind:
        """What its numbers are."""
        return self._kind

    def depth_map(self, image: InputImage) -> DepthMap:
        """The part of the map that the image shows.

        Raises:
            InputError: the map has another shape than the photograph.
        """
        height, width = image.camera.size_px
        window = image.window or PhotoWindow.full((height, width))
        values = upright_array(self.found.values, self.found.orientation)
        values = oriented(self.file, values, window)
        rows, columns = (pixel_places(window, axis, values.shape[axis]) for axis in (0, 1))
        # Beyond the photograph's edge (--fit pad) the depth of the edge goes on.
        grid = np.meshgrid(columns.astype(np.float32), rows.astype(np.float32))
        cut = cv2.remap(values, *grid, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
        return DepthMap(values=cut, kind=self.kind, source=self.file.name)

    def record(self) -> dict[str, Any]:
        """File and size."""
        height, width = self.found.values.shape
        return {"source": "map", "file": str(self.file), "map_px": [width, height]}


def open_depth(file: Path, kind: DepthKind | None = None) -> DepthSource:
    """A network where the name ends in .onnx, else a map.

    Raises:
        FileFormatError: a graph that cannot be used.
        InputError, ConfigError: a map that cannot be used.
    """
    if file.suffix.lower() == ".onnx":
        return NetworkDepth(OnnxDepthPrior(file, kind))
    return FileDepth(file, kind)


def require_stated(file: Path, content: DepthFile) -> DepthKind:
    """The kind that the file states.

    Raises:
        ConfigError: it states none.
    """
    if content.quantity:
        return content.quantity
    kinds = "; ".join(f"{name}: {meaning}" for name, meaning in KINDS.items())
    raise ConfigError(
        f"{file}: expected --depth-kind, since numbers in {file.suffix.lower()} can mean anything; "
        f"give one of {kinds}"
    )


def oriented(file: Path, values: np.ndarray, window: PhotoWindow) -> np.ndarray:
    """The map upright as the photograph is.

    A tool that ignores EXIF writes the map as the sensor had it: then its sides fit only the
    photograph's before it was turned.

    Raises:
        InputError: its shape is neither.
    """
    if shape_fits(values.shape, window.photo_px):
        return values
    turned = upright_array(values, window.orientation)
    if window.orientation > 4 and shape_fits(turned.shape, window.photo_px):
        return turned
    height, width = values.shape
    raise InputError(
        f"{file}: expected the shape of the photo, {window.photo_px[1]}×{window.photo_px[0]} at "
        f"any size, got {width}×{height}; give the depth of this photo, not cropped"
    )


def shape_fits(shape: tuple[int, ...], photo_px: tuple[int, int]) -> bool:
    """Whether two sizes have about one ratio of sides."""
    ratio = (shape[0] / shape[1]) / (photo_px[0] / photo_px[1])
    return abs(math.log(ratio)) <= SHAPE_TOLERANCE


def pixel_places(window: PhotoWindow, axis: int, length: int) -> np.ndarray:
    """Indices into a map of ``length`` of the cells that a window shows, about one per cell."""
    share = window.size_px[axis] / window.photo_px[axis]
    count = max(round(length * share), 1)
    start = window.corner_px[axis] / window.photo_px[axis] * length
    return start + (np.arange(count) + 0.5) * (length * share / count) - 0.5
