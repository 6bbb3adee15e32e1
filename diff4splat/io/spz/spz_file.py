"""SPZ, versions 3 and 4 written, 2 to 4 read; ``gzip_container`` and ``zstd_container`` differ.

Columns: positions, opacities, colours, scales, rotations, harmonics. Axes: x right, y up, z back.
"""

from pathlib import Path

import numpy as np
import torch

from diff4splat.errors import FileFormatError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.require_file import read_bytes
from diff4splat.io.splats.axes import half_turn_about_x
from diff4splat.io.splats.content import SplatContent
from diff4splat.io.splats.require_finite import require_finite
from diff4splat.io.spz import gzip_container, zstd_container
from diff4splat.io.spz import spz_columns as columns
from diff4splat.io.spz.spz_header import HARMONICS, SpzHeader
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import BAND_SIZES

DEFAULT_VERSION = 3
"""Needs no further package, and every program reads it."""


def write_spz(gaussians: Gaussians, file: Path, version: int = DEFAULT_VERSION) -> None:
    """Write one state, whole or not at all; positions keep 2⁻²⁰ or what their range leaves.

    Raises:
        InputError: a value is NaN or infinite.
        MissingExtraError: version 4 without zstandard.
        OutputError: the folder cannot be made or written.
    """
    require_finite(gaussians, str(file))
    turned = half_turn_about_x(gaussians)
    means = turned.means.double().numpy()
    bits = columns.fraction_bits(means)
    header = SpzHeader(
        version=version,
        count=len(means),
        harmonics=HARMONICS[turned.degree],
        fraction_bits=bits,
    )
    container = gzip_container if version == DEFAULT_VERSION else zstd_container
    packed = (columns.pack_positions(means, bits).tobytes(), *_packed(turned))
    encoded = container.encode(packed, header, turned.degree)
    with atomic_path(file) as temporary:
        temporary.write_bytes(encoded)


def _packed(gaussians: Gaussians) -> tuple[bytes, ...]:
    """Every column after the positions."""
    sh = gaussians.sh.double().numpy()
    quats = torch.nn.functional.normalize(gaussians.quats.double(), dim=-1).numpy()
    logs = gaussians.scales.double().clamp_min(1e-30).log().numpy()
    numbers = (
        columns.pack_bytes(gaussians.opacities.double().numpy() * 255),
        columns.pack_bytes((sh[:, 0] * columns.COLOR_SCALE + 0.5) * 255),
        columns.pack_bytes((logs + columns.SCALE_SHIFT) * columns.SCALE_STEPS),
        columns.pack_smallest_three(quats).astype("<u4"),
        columns.pack_harmonics(sh[:, 1:]),
    )
    return tuple(np.ascontiguousarray(array).tobytes() for array in numbers)


def read_spz(file: Path) -> Gaussians:
    """The Gaussians of ``read_spz_content``."""
    return read_spz_content(file).gaussians


def read_spz_content(file: Path) -> SplatContent:
    """Read Gaussians in our axes, in float32.

    Raises:
        FileFormatError: not SPZ, another version, cut off, or larger than its header says.
        MissingExtraError: version 4 without zstandard.
    """
    try:
        return _decoded(read_bytes(file, "an SPZ file"))
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error


def _decoded(data: bytes) -> SplatContent:
    notes: tuple[str, ...] = ()
    if data.startswith(zstd_container.START):
        header, body, notes = zstd_container.decode(data)
    else:
        header, body = gzip_container.decode(data)
    parts, start = [], 0
    for width in header.widths():
        stop = start + width * header.count
        parts.append(np.frombuffer(body[start:stop], np.uint8).reshape(header.count, width))
        start = stop
    if header.harmonics >= BAND_SIZES[-1]:
        notes = (*notes, "not imported: harmonics of degree 4")
    return SplatContent(gaussians=half_turn_about_x(_gaussians(header, parts)), notes=notes)


def _gaussians(header: SpzHeader, parts: list[np.ndarray]) -> Gaussians:
    positions, opacities, colors, scales, rotations, rest = parts
    if header.version >= 3:
        quats = columns.unpack_smallest_three(rotations.copy().view("<u4")[:, 0])
    else:
        quats = columns.unpack_vector_part(rotations)
    first = (colors / 255 - 0.5) / columns.COLOR_SCALE
    kept = rest.reshape(header.count, header.harmonics, 3)[:, : BAND_SIZES[-1] - 1]
    arrays = {
        "means": columns.unpack_positions(positions, header.fraction_bits),
        "quats": quats,
        "scales": np.exp(scales / columns.SCALE_STEPS - columns.SCALE_SHIFT),
        "opacities": opacities[:, 0] / 255,
        "sh": np.concatenate([first[:, None], (kept - 128.0) / 128], 1),
    }
    return Gaussians(**{name: torch.from_numpy(a).float() for name, a in arrays.items()})
