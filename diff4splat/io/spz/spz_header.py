"""What an SPZ file says of itself, in every version (https://github.com/nianticlabs/spz, MIT)."""

from dataclasses import dataclass

from diff4splat.errors import FileFormatError

MAGIC = 0x5053474E
GZIP_VERSIONS, ZSTD_VERSION = (2, 3), 4
READ_VERSIONS = (*GZIP_VERSIONS, ZSTD_VERSION)
WRITE_VERSIONS = (3, 4)
HARMONICS = (0, 3, 8, 15, 24)
"""Coefficients after the first, by degree; we use those up to degree 3."""
HAS_EXTENSIONS = 2
MAX_GAUSSIANS = 10_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SpzHeader:
    """The fields that every version has."""

    version: int
    count: int
    harmonics: int
    """Coefficients after the first."""
    fraction_bits: int

    def widths(self) -> tuple[int, ...]:
        """Bytes per Gaussian of positions, opacities, colours, scales, rotations, harmonics."""
        return (9, 1, 3, 3, 4 if self.version >= 3 else 3, 3 * self.harmonics)


def checked_header(magic: int, version: int, count: int, degree: int, bits: int) -> SpzHeader:
    """The header, once its numbers are known to be possible.

    Raises:
        FileFormatError: another kind of file, another version, or too many Gaussians.
    """
    if magic != MAGIC or version not in READ_VERSIONS:
        got = f"version {version}" if magic == MAGIC else "another kind of file"
        raise FileFormatError(f"expected SPZ of version 2, 3 or 4, got {got}")
    if not (0 < count <= MAX_GAUSSIANS and degree < len(HARMONICS) and bits < 24):
        raise FileFormatError(
            f"expected 1 to {MAX_GAUSSIANS:,} Gaussians of degree 0 to 4, got {count:,} of {degree}"
        )
    return SpzHeader(version=version, count=count, harmonics=HARMONICS[degree], fraction_bits=bits)
