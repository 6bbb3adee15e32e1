"""gsplat's own PyTorch functions on the CPU (gsplat 1.5.3, Apache-2.0).

gsplat keeps a PyTorch twin of its CUDA kernels for tests. Projection, harmonics and ``accumulate``
are called as they are. Three pieces do not run on a CPU as shipped and are replaced, always in its
favour: the lists of tiles (there a Python loop over Gaussians, here vectorised), the pairs of pixel
and Gaussian (a CUDA kernel, here per tile in PyTorch), and nerfacc's packed weights (CUDA, here an
exclusive sum of log(1 - alpha) in float64).
"""

import importlib.util
import sys
import types
from functools import partial

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch_backward import TorchPrepared

from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians

NAME = "gsplat-torch"
NOTE = "its PyTorch functions, with what needs CUDA replaced; stops at light 1e-4"
TILE_PX, LEAST_ALPHA, LARGEST_ALPHA, LEAST_LIGHT = 16, 1 / 255, 0.999, 1e-4


def unavailable() -> str | None:
    """It needs gsplat, without its extension."""
    if importlib.util.find_spec("gsplat") is None:
        return "needs gsplat; pip install --no-deps gsplat==1.5.3"
    return None


def prepare(gaussians: Gaussians, camera: Camera) -> TorchPrepared:
    """Put the CPU versions in place of what needs CUDA."""
    import gsplat.cuda._wrapper

    gsplat.cuda._wrapper.rasterize_to_indices_in_range = pairs_in_range
    nerfacc = types.ModuleType("nerfacc")
    nerfacc.render_weight_from_alpha = weights_from_alpha
    nerfacc.accumulate_along_rays = sums_along_rays
    sys.modules["nerfacc"] = nerfacc
    return TorchPrepared(gaussians=gaussians, draw=partial(draw, camera=camera))


def draw(gaussians: Gaussians, camera: Camera) -> Float[Tensor, "h w 3"]:
    """The image, as ``gsplat.rasterization`` puts the pieces together."""
    from gsplat.cuda import _torch_impl as gsplat

    height, width = camera.size_px
    matrix = torch.eye(3)
    matrix[[0, 1], [0, 1]], matrix[:2, 2] = camera.focal_px, camera.center_px
    covariances, _ = gsplat._quat_scale_to_covar_preci(
        gaussians.quats, gaussians.scales, compute_preci=False
    )
    view = camera.camera_from_world[None]
    radii, means, depths, conics, _ = gsplat._fully_fused_projection(
        gaussians.means, covariances, view, matrix[None], width, height
    )
    directions = gaussians.means - camera.position
    colors = gsplat._spherical_harmonics(gaussians.degree, directions, gaussians.sh)
    offsets, members = tile_lists(means[0].detach(), radii[0], depths[0].detach(), camera.size_px)
    rgb, _ = gsplat._rasterize_to_pixels(
        means,
        conics,
        (colors + 0.5).clamp_min(0)[None],
        gaussians.opacities[None],
        width,
        height,
        TILE_PX,
        offsets,
        members,
    )
    return rgb[0]


@torch.no_grad()
def tile_lists(
    means: Float[Tensor, "n 2"],
    radii: Int[Tensor, "n 2"],
    depths: Float[Tensor, " n"],
    size_px: tuple[int, int],
) -> tuple[Int[Tensor, "1 rows columns"], Int[Tensor, " m"]]:
    """Where each tile's list starts, and the lists, nearest first: ``_isect_tiles`` vectorised."""
    rows, columns = (-(-side // TILE_PX) for side in size_px)
    most = torch.tensor([columns, rows])
    low = ((means - radii) / TILE_PX).floor().long().clamp_min(0).minimum(most)
    high = ((means + radii) / TILE_PX).ceil().long().clamp_min(0).minimum(most)
    spans = (high - low) * (radii > 0).all(-1, keepdim=True)
    order = depths.argsort(stable=True)
    counts = spans.prod(-1)[order]
    members = order.repeat_interleave(counts)
    within = torch.arange(len(members)) - (counts.cumsum(0) - counts).repeat_interleave(counts)
    span_x = spans[members, 0]
    tile = (low[members, 1] + within // span_x) * columns + low[members, 0] + within % span_x
    tile, by_tile = tile.sort(stable=True)
    sizes = torch.bincount(tile, minlength=rows * columns)
    return (sizes.cumsum(0) - sizes).view(1, rows, columns), members[by_tile]


@torch.no_grad()
def pairs_in_range(  # noqa: PLR0913, PLR0917  the signature is gsplat's
    first_block: int,
    last_block: int,
    light: Float[Tensor, "1 h w"],
    means: Float[Tensor, "1 n 2"],
    conics: Float[Tensor, "1 n 3"],
    opacities: Float[Tensor, "1 n"],
    width: int,
    height: int,
    tile_px: int,
    offsets: Int[Tensor, "1 rows columns"],
    members: Int[Tensor, " m"],
) -> tuple[Int[Tensor, " p"], Int[Tensor, " p"], Int[Tensor, " p"]]:
    """(Gaussian, pixel, image) of all contributions, as ``RasterizeToIndices3DGS.cu`` does."""
    starts = [*offsets.flatten().tolist(), len(members)]
    block, columns = tile_px * tile_px, offsets.shape[-1]
    gaussians, pixels = [members[:0]], [members[:0]]
    for tile in range(len(starts) - 1):
        begin = starts[tile] + first_block * block
        ids = members[begin : min(starts[tile + 1], starts[tile] + last_block * block)]
        if len(ids) == 0:
            continue
        top, left = tile // columns * tile_px, tile % columns * tile_px
        y = torch.arange(top, min(top + tile_px, height))
        x = torch.arange(left, min(left + tile_px, width))
        flat = (y[:, None] * width + x).flatten()
        alpha = _alphas(x + 0.5, y + 0.5, means[0, ids], conics[0, ids], opacities[0, ids])
        left_over = torch.cumprod(1 - alpha, 1).mul_(light.flatten()[flat, None])
        pixel, index = ((alpha > 0) & (left_over > LEAST_LIGHT)).nonzero(as_tuple=True)
        gaussians.append(ids[index])
        pixels.append(flat[pixel])
    found = torch.cat(gaussians)
    return found, torch.cat(pixels), torch.zeros_like(found)


def _alphas(
    x: Float[Tensor, " columns"],
    y: Float[Tensor, " rows"],
    means: Float[Tensor, "n 2"],
    conics: Float[Tensor, "n 3"],
    opacities: Float[Tensor, " n"],
) -> Float[Tensor, "pixels n"]:
    """Alphas of one tile, 0 below the least; what depends on one axis is computed once for it."""
    dx, dy = x[:, None] - means[:, 0], y[:, None] - means[:, 1]
    a, b, c = conics.unbind(-1)
    power = dy[:, None] * (-b * dx)
    power.sub_(0.5 * a * dx * dx).sub_((0.5 * c * dy * dy)[:, None])
    alpha = power.exp_().mul_(opacities).clamp_max_(LARGEST_ALPHA).flatten(0, 1)
    return torch.nn.functional.threshold_(alpha, LEAST_ALPHA, 0.0)


def weights_from_alpha(
    alpha: Float[Tensor, " p"], *, ray_indices: Int[Tensor, " p"], n_rays: int
) -> tuple[Float[Tensor, " p"], Float[Tensor, " p"]]:
    """nerfacc's packed weights and light: pairs of one pixel stand together, nearest first."""
    del n_rays
    passed = torch.log1p(-alpha.double())
    before = passed.cumsum(0) - passed
    _, counts = torch.unique_consecutive(ray_indices, return_counts=True)
    first = counts.cumsum(0) - counts
    light = (before - before[first].repeat_interleave(counts)).exp().to(alpha.dtype)
    return alpha * light, light


def sums_along_rays(
    weights: Float[Tensor, " p"],
    values: Float[Tensor, "p c"] | None,
    *,
    ray_indices: Int[Tensor, " p"],
    n_rays: int,
) -> Float[Tensor, "rays c"]:
    """nerfacc's sums of weighted values over the pairs of every pixel."""
    terms = weights[:, None] if values is None else weights[:, None] * values
    return terms.new_zeros(n_rays, terms.shape[1]).index_add(0, ray_indices, terms)
