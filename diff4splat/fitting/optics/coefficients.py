"""Coefficients of a lens as steps of displacement, each of which moves the picture by a pixel.

Axes: ``c`` coefficients, ``m`` modes, ``g`` places in the picture. With the displacements J of all
places per coefficient and the norms N of its columns, J N⁻¹ = U S Vᵀ: the columns of N⁻¹ V S⁻¹ √g
are changes of the coefficients that move the picture by 1 px in the quadratic mean, and no two of
them in the same way. Powers of an angle or of millimetres differ by orders of magnitude and
resemble each other; these do not.
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

FAINTEST = 1e-2
"""Of the strongest mode: what moves the picture less per coefficient is left as it is."""
GRID = 9
"""Places per side of the picture."""
_ALWAYS: dict[type, dict[str, tuple[int, ...]]] = {
    OpenCVFisheye: {"coefficients": (0, 1, 2, 3)},
    OpenCVPinhole: {"radial": (0, 1, 2), "tangential": (0, 1), "thin_prism": ()},
    BlenderFisheye: {"coefficients": (1, 2, 3, 4)},
}
"""Learned in any case; of a pinhole lens, others where they are not 0."""


def learnable(lens: Lens) -> dict[str, Int[Tensor, " c"]]:
    """Which coefficients are learned, by field; empty for a lens without any."""
    found = {}
    for name, always in _ALWAYS.get(type(lens), {}).items():
        learned = torch.zeros(len(getattr(lens, name)), dtype=torch.bool)
        learned[list(always)] = True
        if isinstance(lens, OpenCVPinhole):
            learned |= getattr(lens, name).detach() != 0
        found[name] = learned.nonzero().flatten()
    return found


def taken(lens: Lens) -> Float[Tensor, " c"]:
    """The learnable coefficients in a row, float64."""
    parts = [getattr(lens, name).double()[index] for name, index in learnable(lens).items()]
    return torch.cat(parts)


def placed(lens: Lens, values: Float[Tensor, " c"]) -> Lens:
    """The lens with other learnable coefficients; differentiable."""
    chosen = learnable(lens)
    parts = values.split([len(index) for index in chosen.values()])
    changed = {
        name: getattr(lens, name).to(values).index_copy(0, index, part)
        for (name, index), part in zip(chosen.items(), parts, strict=True)
    }
    rest = {
        name: value.to(values)
        for name in lens.__dataclass_fields__
        if isinstance(value := getattr(lens, name), Tensor)
    }
    return replace(lens, **(rest | changed))


def modes(lens: Lens, camera: Camera) -> Float[Tensor, "c m"]:
    """Changes of the coefficients that move the picture by 1 px each; the strongest first."""
    directions, exist = lens.to(torch.float64).directions(grid(camera))
    directions = directions[exist].detach()

    def places_px(values: Tensor) -> Tensor:
        points, _ = placed(lens, values).points(directions)
        return (points * camera.focal_px.double()).flatten()

    displaced = torch.autograd.functional.jacobian(places_px, taken(lens).detach())
    norms = displaced.norm(dim=0).clamp_min(1e-30)
    _, strengths, turned = torch.linalg.svd(displaced / norms, full_matrices=False)
    kept = strengths > FAINTEST * strengths[0]
    scale = len(directions) ** 0.5 / strengths[kept]
    # The sign of a singular vector is anybody's; the largest number of each is positive here.
    turned = turned[kept]
    largest = turned.gather(1, turned.abs().argmax(1, keepdim=True))
    return (turned * largest.sign() * scale[:, None] / norms).mT.contiguous()


def grid(camera: Camera) -> Float[Tensor, "g 2"]:
    """Places all over the picture on the image plane of the lens."""
    height, width = camera.size_px
    columns = torch.linspace(0.5, width - 0.5, GRID, dtype=torch.float64)
    rows = torch.linspace(0.5, height - 0.5, GRID, dtype=torch.float64)
    pixels = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), -1).flatten(0, 1)
    return (pixels - camera.center_px.double()) / camera.focal_px.double()


def largest_displacement_px(lens: Lens, other: Lens, camera: Camera) -> float:
    """How far apart two lenses put anything that ``lens`` sees on a grid over the picture."""
    directions, exist = lens.to(torch.float64).directions(grid(camera))
    one, _ = lens.to(torch.float64).points(directions[exist])
    two, also = other.to(torch.float64).points(directions[exist])
    gap_px = ((one - two) * camera.focal_px.double())[also].norm(dim=-1)
    return float(gap_px.max()) if len(gap_px) else 0.0
