"""A stand-in for gsplat 1.5: its signature, its checks and its formulas, on a CPU.

Written from the CUDA sources (``persp_proj``, ``add_blur``, ``sh_coeffs_to_color_fast``,
``rasterize_to_pixels_3dgs_fwd``): covariances are formed and their determinants subtracted, so that
rounding hurts where it hurts there. Tiles are left out, since no contribution above the threshold
lies outside them. Ks get no gradient, and whatever the library does not need fails an assertion.
"""

import sys
from types import ModuleType

import pytest
import torch
from torch import Tensor

ALPHA_THRESHOLD, ALPHA_MAX, LIGHT_THRESHOLD = 1 / 255, 0.999, 1e-4


def install(patch: pytest.MonkeyPatch, version: str = "1.5.3") -> list[dict]:
    """Put the stand-in where ``import gsplat`` finds it; the list gets the arguments of calls."""
    calls = []
    library, cuda = ModuleType("gsplat"), ModuleType("gsplat.cuda")
    backend, constants = ModuleType("gsplat.cuda._backend"), ModuleType("gsplat.cuda._constants")

    def recorded(**arguments: object) -> tuple[Tensor, Tensor, dict]:
        calls.append(arguments)
        return rasterization(**arguments)

    library.__version__, library.rasterization, library.cuda = version, recorded, cuda
    backend._C, cuda._backend = object(), backend
    constants.MAX_ALPHA, constants.MIN_COMPENSATION = 0.99, 0.005
    patch.delitem(sys.modules, constants.__name__, raising=False)
    if version >= "1.6":
        cuda._constants = constants
    for module in (library, cuda, backend):
        patch.setitem(sys.modules, module.__name__, module)
    return calls


def rasterization(  # noqa: PLR0917
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    colors: Tensor,
    viewmats: Tensor,
    Ks: Tensor,  # noqa: N803
    width: int,
    height: int,
    near_plane: float = 0.01,
    far_plane: float = 1e10,
    radius_clip: float = 0.0,
    eps2d: float = 0.3,
    sh_degree: int | None = None,
    packed: bool = True,
    tile_size: int = 16,
    backgrounds: Tensor | None = None,
    render_mode: str = "RGB",
    sparse_grad: bool = False,
    absgrad: bool = False,
    rasterize_mode: str = "classic",
    channel_chunk: int = 32,
    distributed: bool = False,
    camera_model: str = "pinhole",
    segmented: bool = False,
    covars: Tensor | None = None,
    with_ut: bool = False,
    with_eval3d: bool = False,
    radial_coeffs: Tensor | None = None,
    tangential_coeffs: Tensor | None = None,
    thin_prism_coeffs: Tensor | None = None,
    ftheta_coeffs: object = None,
    rolling_shutter: object = None,
    viewmats_rs: Tensor | None = None,
) -> tuple[Tensor, Tensor, dict]:
    """The image of one camera; names, order and defaults of the parameters are gsplat's."""
    _check_shapes(means=means, quats=quats, scales=scales, opacities=opacities)
    assert (viewmats.shape, Ks.shape) == ((1, 4, 4), (1, 3, 3))
    assert render_mode in ("RGB", "D", "ED", "RGB+D", "RGB+ED")
    assert rasterize_mode in ("classic", "antialiased")
    assert (radius_clip, tile_size, camera_model) == (0.0, 16, "pinhole")
    view, size = viewmats[0], (width, height)
    local = means @ view[:3, :3].mT + view[:3, 3]
    index = ((local[:, 2] >= near_plane) & (local[:, 2] <= far_plane)).nonzero().squeeze(1)
    covariances = _covariances(quats[index], scales[index], view)
    centers, covariances = _project(local[index], covariances, Ks[0].detach(), size)
    blurred, determinants, factors = _blur(covariances, eps2d)
    opacities = opacities[index] * (factors if rasterize_mode == "antialiased" else 1)
    drawn = (determinants > 0) & _touches(centers, blurred, opacities, size)
    nearest = local[index, 2].argsort(stable=True)
    nearest = nearest[drawn[nearest]]
    weights, light = _weights(centers[nearest], blurred[nearest], opacities[nearest], size)
    index = index[nearest]
    channels = _channels(colors[index], means[index], view, sh_degree)
    channels, behind = _with_depth(channels, backgrounds, local[index, 2:], render_mode)
    image, alpha = weights @ channels + light[:, None] * behind, 1 - light[:, None]
    if "ED" in render_mode:
        depth = image[:, -1:] / alpha.clamp(min=1e-10)
        image = torch.cat([image[:, :-1], depth], 1)
    return image.view(1, height, width, -1), alpha.view(1, height, width, 1), {}


def _check_shapes(**tensors: Tensor) -> None:
    """The assertions of gsplat, and that there is something to divide by."""
    count = len(tensors["means"])
    assert count > 0, "the kernels divide by the number of Gaussians"
    shapes = {"means": (3,), "quats": (4,), "scales": (3,), "opacities": ()}
    for name, tensor in tensors.items():
        assert tensor.shape == (count, *shapes[name]), name
        assert tensor.dtype == torch.float32, name


def _with_depth(
    channels: Tensor, backgrounds: Tensor | None, depth: Tensor, mode: str
) -> tuple[Tensor, Tensor]:
    """Channels and what lies behind them; depth is the last channel, before nothing."""
    behind = channels.new_zeros(1, channels.shape[1]) if backgrounds is None else backgrounds
    assert behind.shape == (1, channels.shape[1])
    if mode == "RGB":
        return channels, behind
    if "RGB" not in mode:
        return depth, behind.new_zeros(1, 1)
    return torch.cat([channels, depth], 1), torch.cat([behind, behind.new_zeros(1, 1)], 1)


def _covariances(quats: Tensor, scales: Tensor, view: Tensor) -> Tensor:
    """``quat_scale_to_covar_preci`` and ``covarW2C``: (n, 3, 3) in camera axes."""
    w, x, y, z = (quats / quats.square().sum(-1, keepdim=True).sqrt()).unbind(-1)
    rows = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    root = torch.stack(rows, -1).view(-1, 3, 3) * scales[:, None]
    return view[:3, :3] @ (root @ root.mT) @ view[:3, :3].mT


def _project(local: Tensor, covariances: Tensor, k: Tensor, size: tuple) -> tuple[Tensor, Tensor]:
    """``persp_proj``: centres (n, 2) and covariances (n, 2, 2) on the image."""
    z, tangents, entries = local[:, 2], [], []
    for axis in (0, 1):
        focal, center = k[axis, axis], k[axis, 2]
        margin = 0.3 * (0.5 * size[axis] / focal)
        highest, lowest = (size[axis] - center) / focal + margin, -(center / focal + margin)
        tangents.append(z * (local[:, axis] / z).clamp(lowest, highest))
        entries.append(focal / z)
    zero = torch.zeros_like(z)
    slopes = [-k[axis, axis] * tangents[axis] / (z * z) for axis in (0, 1)]
    rows = [entries[0], zero, slopes[0], zero, entries[1], slopes[1]]
    jacobian = torch.stack(rows, -1).view(-1, 2, 3)
    centers = k[[0, 1], [0, 1]] * local[:, :2] / z[:, None] + k[:2, 2]
    return centers, jacobian @ covariances @ jacobian.mT


def _blur(covariances: Tensor, eps2d: float) -> tuple[Tensor, Tensor, Tensor]:
    """``add_blur``: (xx, xy, yy), determinants, and what they lost."""
    xx, xy, yy = covariances[:, 0, 0], covariances[:, 0, 1], covariances[:, 1, 1]
    before = xx * yy - xy * xy
    xx, yy = xx + eps2d, yy + eps2d
    after = xx * yy - xy * xy
    return torch.stack([xx, xy, yy], -1), after, (before / after).clamp_min(0).sqrt()


def _touches(centers: Tensor, blurred: Tensor, opacities: Tensor, size: tuple) -> Tensor:
    """Whether the box around the support meets the image."""
    extent = (2 * (opacities / ALPHA_THRESHOLD).log()).clamp_min(0).sqrt().clamp(max=3.33)
    reach = (extent[:, None] * blurred[:, [0, 2]].sqrt()).ceil()
    inside = (centers + reach > 0) & (centers - reach < centers.new_tensor(size)) & (reach > 0)
    return inside.all(1) & (opacities >= ALPHA_THRESHOLD)


def _weights(
    centers: Tensor, blurred: Tensor, opacities: Tensor, size: tuple
) -> tuple[Tensor, Tensor]:
    """``rasterize_to_pixels_3dgs_fwd``: weights (p, n), nearest first, and the light behind all."""
    x, y = torch.meshgrid(torch.arange(size[0]) + 0.5, torch.arange(size[1]) + 0.5, indexing="xy")
    dx, dy = centers[:, 0] - x.reshape(-1, 1), centers[:, 1] - y.reshape(-1, 1)
    xx, xy, yy = blurred.unbind(-1)
    determinants = xx * yy - xy * xy
    a, b, c = yy / determinants, -xy / determinants, xx / determinants
    sigma = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
    alphas = (opacities * torch.exp(-sigma)).clamp(max=ALPHA_MAX)
    alphas = torch.where((sigma < 0) | (alphas < ALPHA_THRESHOLD), 0.0, alphas)
    # The Gaussian that would end the light is not drawn, nor is anything behind it.
    alphas = torch.where((1 - alphas).cumprod(1) > LIGHT_THRESHOLD, alphas, 0.0)
    passed = torch.cat([alphas.new_ones(len(alphas), 1), (1 - alphas).cumprod(1)], 1)
    return alphas * passed[:, :-1], passed[:, -1]


def _channels(colors: Tensor, means: Tensor, view: Tensor, degree: int | None) -> Tensor:
    """Colours as they are, or ``sh_coeffs_to_color_fast`` seen from the camera centre."""
    if degree is None:
        assert colors.shape == (len(means), colors.shape[1])
        return colors
    assert colors.shape == (len(means), colors.shape[1], 3)
    assert (degree + 1) ** 2 <= colors.shape[1]
    directions = means - torch.linalg.inv(view)[:3, 3]
    x, y, z = (directions / directions.square().sum(-1, keepdim=True).sqrt()).unbind(-1)
    c1, s1 = x * x - y * y, 2 * x * y
    c2, s2 = x * c1 - y * s1, x * s1 + y * c1
    outer = -2.285228997322329 * z * z + 0.4570457994644658
    basis = [torch.full_like(x, 0.2820947917738781)]
    basis += [0.48860251190292 * value for value in (-y, z, -x)]
    basis += [0.5462742152960395 * s1, -1.092548430592079 * z * y]
    basis += [0.9461746957575601 * z * z - 0.3153915652525201]
    basis += [-1.092548430592079 * z * x, 0.5462742152960395 * c1]
    basis += [-0.5900435899266435 * s2, 1.445305721320277 * z * s1, outer * y]
    basis += [z * (1.865881662950577 * z * z - 1.119528997770346)]
    basis += [outer * x, 1.445305721320277 * z * c1, -0.5900435899266435 * c2]
    used = (degree + 1) ** 2
    return torch.clamp_min(
        (torch.stack(basis[:used], 1)[..., None] * colors[:, :used]).sum(1) + 0.5, 0
    )
