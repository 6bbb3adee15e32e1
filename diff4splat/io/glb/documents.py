"""Where the Gaussians of a glTF document are; everything in it is checked before it is used."""

from collections.abc import Mapping

import numpy as np

from diff4splat.errors import FileFormatError

EXTENSION = "KHR_gaussian_splatting"
_FLOAT = 5126
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_TRANSFORMS = ("matrix", "translation", "scale")


def primitive_of(document: object) -> tuple[Mapping, bool]:
    """The first primitive of Gaussians, and whether its node turns it by half a turn about x.

    Raises:
        FileFormatError: there is none, or it is transformed in another way.
    """
    for number, mesh in enumerate(_rows(document, "meshes")):
        for primitive in _rows(mesh, "primitives"):
            if EXTENSION in _mapping(_mapping(primitive).get("extensions", {})):
                return _mapping(primitive), _is_turned(document, number)
    raise FileFormatError(f"expected a primitive with {EXTENSION}, got none; it is a plain mesh")


def attribute_arrays(document: object, primitive: Mapping, body: bytes) -> dict[str, np.ndarray]:
    """Floats of every attribute but ``COLOR_0``, (n, width) each, finite and of one length.

    Raises:
        FileFormatError: other numbers, or bytes outside of the file.
    """
    accessors, views = _rows(document, "accessors"), _rows(document, "bufferViews")
    arrays = {}
    for name, index in _mapping(primitive.get("attributes")).items():
        if name != "COLOR_0":
            accessor = _mapping(_row(accessors, index))
            arrays[name] = _array(accessor, _mapping(_row(views, accessor.get("bufferView"))), body)
    lengths = {len(array) for array in arrays.values()}
    if len(lengths) != 1 or 0 in lengths:
        raise FileFormatError(f"expected attributes of one length, got {sorted(lengths)[:3]}")
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise FileFormatError(f"{name[:60]}: expected finite numbers, got NaN or infinity")
    return arrays


def _array(accessor: Mapping, view: Mapping, body: bytes) -> np.ndarray:
    width = _WIDTHS.get(str(accessor.get("type")))
    if width is None or accessor.get("componentType") != _FLOAT or "sparse" in accessor:
        raise FileFormatError("expected attributes of plain floats, got others; export them again")
    if view.get("byteStride", 4 * width) != 4 * width or view.get("buffer") != 0:
        raise FileFormatError("expected attributes side by side in one buffer, got others")
    start = _whole(view.get("byteOffset", 0)) + _whole(accessor.get("byteOffset", 0))
    stop = start + 4 * width * _whole(accessor.get("count"))
    if stop > len(body):
        raise FileFormatError(f"expected at least {stop} bytes, got {len(body)}; copy it again")
    return np.frombuffer(body[start:stop], "<f4").reshape(-1, width).copy()


def _is_turned(document: object, mesh: int) -> bool:
    for node in map(_mapping, _rows(document, "nodes")):
        if node.get("mesh") != mesh:
            continue
        turn = node.get("rotation", [0, 0, 0, 1])
        if any(name in node for name in _TRANSFORMS) or turn not in ([1, 0, 0, 0], [0, 0, 0, 1]):
            raise FileFormatError("expected a node without a transform, got one; apply it first")
        return turn == [1, 0, 0, 0]
    return False


def _rows(parent: object, key: str) -> list:
    found = _mapping(parent).get(key, [])
    if not isinstance(found, list):
        raise FileFormatError(f"'{key}': expected a list, got {type(found).__name__}")
    return found


def _row(rows: list, index: object) -> object:
    if _whole(index) >= len(rows):
        raise FileFormatError(f"expected one of {len(rows)} entries, got number {index}")
    return rows[index]


def _mapping(value: object) -> Mapping:
    if not isinstance(value, Mapping):
        raise FileFormatError(f"expected an object in JSON, got {type(value).__name__}")
    return value


def _whole(value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise FileFormatError(f"expected a whole number, got {str(value)[:30]}")
    return value
