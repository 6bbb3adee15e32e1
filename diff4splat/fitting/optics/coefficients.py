"""Lens coefficients in a basis of displacement modes, each of which moves the image by one pixel.

Axes: ``c`` coefficients, ``m`` modes, ``g`` grid points. J holds the displacement of all grid
points per coefficient, N the norms of its columns, and J N⁻¹ = U S Vᵀ. The columns of N⁻¹ V S⁻¹ √g
are coefficient changes that move the image by 1 px root mean square, orthogonally to each other.
Powers of an angle or of millimetres differ by orders of magnitude and are strongly correlated;
these modes are not.
"""

from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.lenses.blender_fisheye import BlenderFisheye
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole
from diff4splat.geometry.lenses.protocol import Lens

MIN_RELATIVE_STRENGTH = 1e-2
"""Smallest strength of a learned mode, relative to the strongest mode."""
GRID_SIDE = 9
"""Grid points per side of the image."""
_ALWAYS: dict[type, dict[str, tuple[int, ...]]] = {
    OpenCVFisheye: {"coefficients": (0, 1, 2, 3)},
    OpenCVPinhole: {"radial": (0, 1, 2), "tangential": (0, 1), "thin_prism": ()},
    BlenderFisheye: {"coefficients": (1, 2, 3, 4)},
}
"""Always learned; a pinhole lens adds its non-zero coefficients."""


def learnable_indices(lens: Lens) -> dict[str, Int[Tensor, " c"]]:
    """Indices of the learned coefficients by field; empty for a lens without coefficients."""
    indices = {}
    for name, always in _ALWAYS.get(type(lens), {}).items():
        learned = torch.zeros(len(getattr(lens, name)), dtype=torch.bool)
        learned[list(always)] = True
        if isinstance(lens, OpenCVPinhole):
            learned |= getattr(lens, name).detach() != 0
        indices[name] = learned.nonzero().flatten()
    return indices


def coefficient_vector(lens: Lens) -> Float[Tensor, " c"]:
    """The learnable coefficients as one vector, float64."""
    parts = [getattr(lens, name).double()[index] for name, index in learnable_indices(lens).items()]
    return torch.cat(parts)


def with_coefficients(lens: Lens, values: Float[Tensor, " c"]) -> Lens:
    """The lens with new learnable coefficients; differentiable."""
    indices = learnable_indices(lens)
    parts = values.split([len(index) for index in indices.values()])
    changed = {
        name: getattr(lens, name).to(values).index_copy(0, index, part)
        for (name, index), part in zip(indices.items(), parts, strict=True)
    }
    rest = {
        name: value.to(values)
        for name in lens.__dataclass_fields__
        if isinstance(value := getattr(lens, name), Tensor)
    }
    return replace(lens, **(rest | changed))


def displacement_modes(lens: Lens, camera: Camera) -> Float[Tensor, "c m"]:
    """Coefficient changes that move the image by 1 px each, the strongest first."""
    directions, exist = lens.to(torch.float64).directions(image_plane_grid(camera))
    directions = directions[exist].detach()

    def points_px(values: Tensor) -> Tensor:
        points, _ = with_coefficients(lens, values).points(directions)
        return (points * camera.focal_px.double()).flatten()

    displaced = torch.autograd.functional.jacobian(points_px, coefficient_vector(lens).detach())
    norms = displaced.norm(dim=0).clamp_min(1e-30)
    _, strengths, vectors = torch.linalg.svd(displaced / norms, full_matrices=False)
    kept = strengths > MIN_RELATIVE_STRENGTH * strengths[0]
    scale = len(directions) ** 0.5 / strengths[kept]
    # The sign of a singular vector is arbitrary; here its largest component is positive.
    vectors = vectors[kept]
    largest = vectors.gather(1, vectors.abs().argmax(1, keepdim=True))
    return (vectors * largest.sign() * scale[:, None] / norms).mT.contiguous()


def image_plane_grid(camera: Camera) -> Float[Tensor, "g 2"]:
    """Grid points over the whole image, on the image plane of the lens."""
    height, width = camera.size_px
    columns = torch.linspace(0.5, width - 0.5, GRID_SIDE, dtype=torch.float64)
    rows = torch.linspace(0.5, height - 0.5, GRID_SIDE, dtype=torch.float64)
    pixels = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), -1).flatten(0, 1)
    return (pixels - camera.center_px.double()) / camera.focal_px.double()


def largest_displacement_px(lens: Lens, other: Lens, camera: Camera) -> float:
    """Largest distance between the projections of two lenses, on the grid of ``lens``."""
    directions, exist = lens.to(torch.float64).directions(image_plane_grid(camera))
    one, _ = lens.to(torch.float64).points(directions[exist])
    two, also = other.to(torch.float64).points(directions[exist])
    gap_px = ((one - two) * camera.focal_px.double())[also].norm(dim=-1)
    return float(gap_px.max()) if len(gap_px) else 0.0
