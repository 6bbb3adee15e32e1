"""Gaussians as a glTF 2.0 binary file with the extension ``KHR_gaussian_splatting`` (Khronos).

Axes: ``n`` Gaussians. Positions, linear scales, quaternions (x, y, z, w), opacities and harmonics
are floats as we have them; a node turns our axes to those of glTF, x right, y up, z back. Colours
are a second time in ``COLOR_0``, for programs that show only points.
"""

from pathlib import Path

import numpy as np
import torch

from diff4splat import __version__
from diff4splat.errors import FileFormatError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.glb.container import decode, encode
from diff4splat.io.glb.documents import EXTENSION, attribute_arrays, primitive_of
from diff4splat.io.require_file import read_bytes
from diff4splat.io.splats.axes import half_turn_about_x
from diff4splat.io.splats.require_finite import require_finite
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import BAND_SIZES, DEGREE_ZERO

FLOAT, UNSIGNED_BYTE = 5126, 5121
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
WIDTHS = {
    "POSITION": 3,
    f"{EXTENSION}:ROTATION": 4,
    f"{EXTENSION}:SCALE": 3,
    f"{EXTENSION}:OPACITY": 1,
}
"""Numbers per Gaussian of the attributes beside harmonics, in our order."""
HALF_TURN = [1.0, 0.0, 0.0, 0.0]
"""About x, as (x, y, z, w)."""


def write_glb(gaussians: Gaussians, file: Path) -> None:
    """Write one state, in float32, whole or not at all.

    Raises:
        InputError: a value is NaN or infinite.
        OutputError: the folder cannot be made or written.
    """
    require_finite(gaussians, str(file))
    arrays = _arrays(gaussians)
    views, accessors, start = [], [], 0
    for name, array in arrays.items():
        views.append({"buffer": 0, "byteOffset": start, "byteLength": array.nbytes})
        accessors.append(_accessor(name, array, len(accessors)))
        start += array.nbytes
    document = _document(list(arrays), views, accessors, start)
    body = b"".join(array.tobytes() for array in arrays.values())
    with atomic_path(file) as temporary:
        temporary.write_bytes(encode(document, body))


def read_glb(file: Path) -> Gaussians:
    """Read the Gaussians of the first primitive that has some, in our axes.

    Raises:
        FileFormatError: no such file, no Gaussians in it, a node with another transform than half
            a turn, or bytes that are not there.
    """
    try:
        document, body = decode(read_bytes(file, "a GLB file"))
        primitive, turned = primitive_of(document)
        gaussians = _gaussians(attribute_arrays(document, primitive, body))
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
    return gaussians if turned else half_turn_about_x(gaussians)


def _arrays(gaussians: Gaussians) -> dict[str, np.ndarray]:
    quats = torch.nn.functional.normalize(gaussians.quats.double(), dim=-1)
    rgb = (0.5 + DEGREE_ZERO * gaussians.sh[:, 0]).clamp(0, 1)
    rgba = torch.cat([rgb, gaussians.opacities[:, None].clamp(0, 1)], 1)
    values = (gaussians.means, quats.roll(-1, 1), gaussians.scales, gaussians.opacities)
    floats = dict(zip(WIDTHS, values, strict=True))
    for index in range(gaussians.sh.shape[1]):
        floats[harmonic_name(index)] = gaussians.sh[:, index]
    arrays = {name: value.float().contiguous().numpy() for name, value in floats.items()}
    return arrays | {"COLOR_0": (rgba * 255).round().byte().contiguous().numpy()}


def harmonic_name(index: int) -> str:
    """Attribute of a coefficient: degree, and place within it."""
    degree = int(index**0.5)
    return f"{EXTENSION}:SH_DEGREE_{degree}_COEF_{index - degree**2}"


def _accessor(name: str, array: np.ndarray, view: int) -> dict:
    width = 1 if array.ndim == 1 else array.shape[1]
    kind = {"bufferView": view, "count": len(array), "type": TYPES[width]}
    if array.dtype == np.uint8:
        return kind | {"componentType": UNSIGNED_BYTE, "normalized": True}
    kind |= {"componentType": FLOAT}
    if name != "POSITION":
        return kind
    return kind | {"min": array.min(0).tolist(), "max": array.max(0).tolist()}


def _document(names: list[str], views: list, accessors: list, length: int) -> dict:
    extension = {
        "kernel": "ellipse",
        "colorSpace": "srgb_rec709_display",
        "projection": "perspective",
        "sortingMethod": "cameraDistance",
    }
    primitive = {
        "mode": 0,
        "attributes": {name: index for index, name in enumerate(names)},
        "extensions": {EXTENSION: extension},
    }
    return {
        "asset": {"version": "2.0", "generator": f"diff4splat {__version__}"},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "rotation": HALF_TURN}],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [{"byteLength": length}],
        "bufferViews": views,
        "accessors": accessors,
    }


def _gaussians(arrays: dict[str, np.ndarray]) -> Gaussians:
    count = max((n for n in BAND_SIZES if harmonic_name(n - 1) in arrays), default=1)
    harmonics = {harmonic_name(index): 3 for index in range(count)}
    tensors = {}
    for name, width in (WIDTHS | harmonics).items():
        if name not in arrays or arrays[name].shape[1] != width:
            raise FileFormatError(
                f"expected {name} of {width} numbers, got others; export it again"
            )
        tensors[name] = torch.from_numpy(arrays[name])
    means, quats, scales, opacities = (tensors[name] for name in WIDTHS)
    return Gaussians(
        means=means,
        quats=quats.roll(1, 1),
        scales=scales,
        opacities=opacities[:, 0],
        sh=torch.stack([tensors[name] for name in harmonics], 1),
    )
