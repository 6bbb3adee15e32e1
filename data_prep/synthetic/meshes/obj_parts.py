"""OBJ files as parts of one material each; the only module that imports trimesh.

Axes: ``v`` vertices, ``f`` triangles. OBJ files have y up and their front at +z; here the front is
at +x and y is down.
"""

import importlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float32, Int64, UInt8

from diff4splat.errors import FileFormatError, MissingExtraError

IMAGE_SIDE_PX = 128
"""Of every texture: an object is shown with fewer pixels."""
MOST_IMAGE_PX = 100_000_000
TRANSPARENT = 0.9
"""Materials with a lower opacity are left out: depth behind glass has no one answer."""
_CUT_OUT_SHARE = 0.02
"""Textures with a larger share of transparent pixels are outlines (leaves), and left out too."""
_AXES = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]], np.float32)
_LEAST_GLOSSY, _GLOSSIEST = 2.0, 500.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjPart:
    """Triangles of one material."""

    vertices: Float32[np.ndarray, "v 3"]
    triangles: Int64[np.ndarray, "f 3"]
    uv: Float32[np.ndarray, "v 2"]
    """In repeats of the image, downwards."""
    color: UInt8[np.ndarray, "3"]
    """sRGB; the mean of the image where there is one."""
    image: UInt8[np.ndarray, "128 128 3"] | None
    gloss: float
    """0 to 1."""


def read_obj(obj: bytes, beside: Mapping[str, bytes]) -> list[ObjPart]:
    """Opaque parts of an OBJ file; ``beside`` holds material files and images by name.

    Raises:
        FileFormatError: no OBJ file, or an image of it is damaged.
        MissingExtraError: trimesh is not installed.
    """
    trimesh = _trimesh()
    resolver = trimesh.resolvers.ZipResolver({k: io.BytesIO(v) for k, v in beside.items()})
    try:
        loaded = trimesh.load(
            io.BytesIO(obj), file_type="obj", resolver=resolver, process=False, group_material=True
        )
        meshes = list(getattr(loaded, "geometry", {"": loaded}).values())
        parts = [_part(mesh) for mesh in meshes if hasattr(mesh, "faces") and len(mesh.faces)]
    # A parser of free text ends in errors of every kind.
    except Exception as error:
        raise FileFormatError(f"expected an OBJ file, got {error}") from error
    return [part for part in parts if part is not None]


def _trimesh() -> Any:
    try:
        importlib.import_module("trimesh.resolvers")
        return importlib.import_module("trimesh")
    except ImportError as error:
        raise MissingExtraError(
            "OBJ files: expected the package trimesh, got none; pip install 'diff4splat[meshes]'"
        ) from error


def _part(mesh: Any) -> ObjPart | None:
    """None where the material is transparent."""
    material = getattr(mesh.visual, "material", None)
    kwargs = getattr(material, "kwargs", {})
    if float(kwargs.get("d", ["1"])[0]) < TRANSPARENT:
        return None
    image, uv = getattr(material, "image", None), getattr(mesh.visual, "uv", None)
    color = np.asarray(material.diffuse if material is not None else (128, 128, 128, 255))[:3]
    pixels = None
    if image is not None and uv is not None and len(uv) == len(mesh.vertices):
        pixels = _square(image)
        if pixels is None:
            return None
        color = pixels.reshape(-1, 3).mean(0)
    else:
        uv = np.zeros((len(mesh.vertices), 2))
    flipped = np.stack([uv[:, 0], 1.0 - uv[:, 1]], -1)
    return ObjPart(
        vertices=(np.asarray(mesh.vertices, np.float32) @ _AXES.T),
        triangles=np.asarray(mesh.faces, np.int64),
        uv=np.nan_to_num(flipped).astype(np.float32),
        color=color.astype(np.uint8),
        image=pixels,
        gloss=_gloss(getattr(material, "glossiness", 0.0)),
    )


def _square(image: Any) -> UInt8[np.ndarray, "128 128 3"] | None:
    """The image, reduced; None where it cuts an outline out."""
    if image.size[0] * image.size[1] > MOST_IMAGE_PX:
        raise ValueError(f"an image of at most {MOST_IMAGE_PX} pixels, got {image.size}")
    rgba = np.asarray(image.convert("RGBA"))
    if float((rgba[..., 3] < 128).mean()) > _CUT_OUT_SHARE:
        return None
    side = (IMAGE_SIDE_PX, IMAGE_SIDE_PX)
    return cv2.resize(np.ascontiguousarray(rgba[..., :3]), side, interpolation=cv2.INTER_AREA)


def _gloss(exponent: Any) -> float:
    """Phong's exponent as a share, by its logarithm."""
    value = float(np.clip(exponent or 0.0, _LEAST_GLOSSY, _GLOSSIEST))
    return 0.6 * float(np.log(value / _LEAST_GLOSSY) / np.log(_GLOSSIEST / _LEAST_GLOSSY))
