"""SPZ version 3 is written, versions 2 and 3 are read: one gzip stream of columns.

Header: magic, version, count (4 bytes each), harmonic degree, bits after the point, flags, 0.
Then positions, opacities, colours, scales, rotations and harmonics of all Gaussians. Axes: x right,
y up, z back.
"""

import gzip
import io
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from diff4splat.errors import FileFormatError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.require_file import read_bytes
from diff4splat.io.splats.axes import half_turn_about_x
from diff4splat.io.splats.require_finite import require_finite
from diff4splat.io.spz import spz_columns as columns
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import BAND_SIZES

MAGIC, VERSION, READ_VERSIONS = 0x5053474E, 3, (2, 3)
HEADER = struct.Struct("<IIIBBBB")
ANTIALIASED = 1
MAX_GAUSSIANS = 10_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SpzHeader:
    """What the first 16 bytes say."""

    version: int
    count: int
    harmonics: int
    """Coefficients after the first."""
    fraction_bits: int

    def widths(self) -> tuple[int, ...]:
        """Bytes per Gaussian of each column, in order."""
        return (9, 1, 3, 3, 4 if self.version == VERSION else 3, 3 * self.harmonics)


def write_spz(gaussians: Gaussians, file: Path) -> None:
    """Write one state, whole or not at all; positions keep 2⁻²⁰ or what their range leaves.

    Raises:
        InputError: a value is NaN or infinite.
        OutputError: the folder cannot be made or written.
    """
    require_finite(gaussians, str(file))
    turned = half_turn_about_x(gaussians)
    means = turned.means.double().numpy()
    bits = columns.fraction_bits(means)
    rest = turned.sh.shape[1] - 1
    header = HEADER.pack(MAGIC, VERSION, len(means), BAND_SIZES.index(rest + 1), bits, 0, 0)
    with atomic_path(file) as temporary:
        packed = (header, columns.pack_positions(means, bits).tobytes(), *_packed(turned))
        temporary.write_bytes(gzip.compress(b"".join(packed), mtime=0))


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
    """Read Gaussians in our axes, in float32.

    Raises:
        FileFormatError: not SPZ, another version, cut off, or larger than its header says.
    """
    try:
        return _decoded(read_bytes(file, "an SPZ file"))
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error


def _decoded(data: bytes) -> Gaussians:
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
            header = _header(stream.read(HEADER.size))
            size = header.count * sum(header.widths())
            body = stream.read(size + 1)  # never more than the header says, whatever follows
    except (OSError, EOFError, zlib.error) as error:
        raise FileFormatError("expected a gzip stream, got a damaged one; copy it again") from error
    if len(body) != size:
        raise FileFormatError(f"expected {size} bytes for {header.count} Gaussians, got others")
    parts, start = [], 0
    for width in header.widths():
        stop = start + width * header.count
        parts.append(np.frombuffer(body[start:stop], np.uint8).reshape(header.count, width))
        start = stop
    return half_turn_about_x(_gaussians(header, parts))


def _header(data: bytes) -> SpzHeader:
    if len(data) < HEADER.size:
        raise FileFormatError("expected 16 bytes of SPZ header, got fewer; copy the file again")
    magic, version, count, degree, bits, _, _ = HEADER.unpack(data)
    if magic != MAGIC or version not in READ_VERSIONS:
        got = f"version {version}" if magic == MAGIC else "another kind of file"
        raise FileFormatError(f"expected SPZ of version 2 or 3, got {got}")
    if not (0 < count <= MAX_GAUSSIANS and degree < len(BAND_SIZES) and bits < 24):
        raise FileFormatError(
            f"expected 1 to {MAX_GAUSSIANS:,} Gaussians of degree 0 to 3, got {count:,} of {degree}"
        )
    harmonics = BAND_SIZES[degree] - 1
    return SpzHeader(version=version, count=count, harmonics=harmonics, fraction_bits=bits)


def _gaussians(header: SpzHeader, parts: list[np.ndarray]) -> Gaussians:
    positions, opacities, colors, scales, rotations, rest = parts
    if header.version == VERSION:
        quats = columns.unpack_smallest_three(rotations.copy().view("<u4")[:, 0])
    else:
        quats = columns.unpack_vector_part(rotations)
    first = (colors / 255 - 0.5) / columns.COLOR_SCALE
    others = (rest.reshape(header.count, header.harmonics, 3) - 128.0) / 128
    arrays = {
        "means": columns.unpack_positions(positions, header.fraction_bits),
        "quats": quats,
        "scales": np.exp(scales / columns.SCALE_STEPS - columns.SCALE_SHIFT),
        "opacities": opacities[:, 0] / 255,
        "sh": np.concatenate([first[:, None], others], 1),
    }
    return Gaussians(**{name: torch.from_numpy(a).float() for name, a in arrays.items()})
