"""Real spherical harmonics up to degree 3, in the order and signs of the INRIA files.

Axes: ``n`` Gaussians or directions, ``k`` coefficients, degree-major (Kerbl et al. 2023; the
constants are those of the real orthonormal basis with the Condon–Shortley phase).
"""

import torch
from jaxtyping import Float
from torch import Tensor

BAND_SIZES = (1, 4, 9, 16)
"""Number of coefficients up to degree 0, 1, 2, 3."""
DEGREE_ZERO = 0.28209479177387814


def color_from_dc(dc: Float[Tensor, "*b 3"]) -> Float[Tensor, "*b 3"]:
    """RGB of a degree-0 coefficient."""
    return 0.5 + DEGREE_ZERO * dc


def dc_from_color(rgb: Float[Tensor, "*b 3"]) -> Float[Tensor, "*b 3"]:
    """Degree-0 coefficient of an RGB colour."""
    return (rgb - 0.5) / DEGREE_ZERO


def basis(directions: Float[Tensor, "n 3"], degree: int) -> Float[Tensor, "n k"]:
    """Values of the first (degree + 1)² basis functions in unit ``directions``."""
    x, y, z = directions.unbind(-1)
    xx, yy, zz = x * x, y * y, z * z
    values = [torch.full_like(x, DEGREE_ZERO)]
    if degree >= 1:
        values += [-0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x]
    if degree >= 2:
        values += [
            1.0925484305920792 * x * y,
            -1.0925484305920792 * y * z,
            0.31539156525252005 * (2 * zz - xx - yy),
            -1.0925484305920792 * x * z,
            0.5462742152960396 * (xx - yy),
        ]
    if degree >= 3:
        values += [
            -0.5900435899266435 * y * (3 * xx - yy),
            2.890611442640554 * x * y * z,
            -0.4570457994644658 * y * (4 * zz - xx - yy),
            0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy),
            -0.4570457994644658 * x * (4 * zz - xx - yy),
            1.445305721320277 * z * (xx - yy),
            -0.5900435899266435 * x * (xx - 3 * yy),
        ]
    return torch.stack(values, -1)


def color(sh: Float[Tensor, "n k 3"], directions: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """RGB seen along unit ``directions`` (camera to Gaussian), clamped at 0 from below."""
    degree = BAND_SIZES.index(sh.shape[1])
    if degree == 0:
        return color_from_dc(sh[:, 0]).clamp_min(0)
    return (0.5 + (basis(directions, degree)[..., None] * sh).sum(1)).clamp_min(0)


def rotate(sh: Float[Tensor, "n k 3"], rotation: Float[Tensor, "3 3"]) -> Float[Tensor, "n k 3"]:
    """Coefficients of the same lobes after the world is turned by ``rotation``.

    Each band is closed under rotation, so its matrix is the exact solution of Y(R d) M = Y(d) over
    a set of directions in general position; solved in float64.
    """
    degree = BAND_SIZES.index(sh.shape[1])
    if degree == 0:
        return sh
    generator = torch.Generator().manual_seed(0)
    probes = torch.nn.functional.normalize(
        torch.randn(64, 3, generator=generator, dtype=torch.float64), dim=-1
    )
    before = basis(probes, degree)
    after = basis(probes @ rotation.detach().double().cpu().mT, degree)
    bands = [sh[:, :1]]
    for low in range(1, degree + 1):
        band = slice(low**2, (low + 1) ** 2)
        matrix = torch.linalg.lstsq(after[:, band], before[:, band]).solution
        bands.append(torch.einsum("ij,njc->nic", matrix.to(sh), sh[:, band]))
    return torch.cat(bands, 1)
