"""Raw reconstruction maps and a base scene to Gaussians, one per grid cell.

Axes: ``t h w`` frames, rows and columns of the Gaussian grid, flattened in this order into ``n``.
Lengths in scene units, distance along the unit ray. The base scene is colour, distance and opacity
per cell of a camera. With raw = 0 the result is exactly the base:

    mean  = camera centre + distance · ray
    scale = footprint_px · z / focal_px · exp(L tanh(raw / L)), z = distance · cos(ray, view axis)
    quat  = camera rotation ⊗ normalize((1, 0, 0, 0) + raw)
    colour, opacity and distance: see activations.py
"""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.depth import depth_from_distance
from diff4splat.geometry.rays import world_rays
from diff4splat.models.config.networks import GAUSSIAN_SPLIT, ActivationConfig
from diff4splat.models.ldrm import activations
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelBase:
    """Colour, distance and opacity of every grid cell before the network corrects them."""

    rgb: Float[Tensor, "t h w 3"]
    distance: Float[Tensor, "t h w"]
    """Along the unit ray, above 0."""
    opacity: Float[Tensor, "t h w"]
    """In [0, 1]; 0 for invisible cells."""
    cameras: Camera
    """A batch of shape (t,) for images of size (h, w): resize cameras to a half grid first."""

    def __post_init__(self) -> None:
        grid = tuple(self.distance.shape)
        want = {"rgb": (*grid, 3), "opacity": grid}
        for name, shape in want.items():
            got = tuple(getattr(self, name).shape)
            if got != shape:
                raise ShapeError(f"PixelBase.{name}: expected {shape} (from distance), got {got}")
        got = (*self.cameras.batch_shape, *self.cameras.size_px)
        if got != grid:
            raise ShapeError(
                f"PixelBase.cameras: expected frames and size {grid}, got {got}; resize them"
            )


def activate(
    raw: Float[Tensor, "12 t h w"], base: PixelBase, config: ActivationConfig
) -> Gaussians:
    """Canonical Gaussians in t, h, w order, with plain colour (harmonic degree 0).

    Raises:
        ShapeError: the maps and the base differ in shape, or a tensor is in half precision.
    """
    _require_fit(raw, base)
    rows = raw.movedim(0, -1).flatten(0, -2)
    rgb, scale, rotation, opacity, distance = rows.split(GAUSSIAN_SPLIT, -1)
    factor = activations.bounded_factor(distance[:, 0], config.log_distance_limit)
    far = base.distance.flatten() * factor
    origins, directions = world_rays(base.cameras)
    # Neighbouring rays of a pinhole are z / focal apart on a plane that faces the camera.
    depth = depth_from_distance(base.cameras, far.unflatten(0, base.distance.shape)).flatten()
    footprint = config.footprint_px * depth / _focal_px(base)
    return Gaussians(
        means=origins.flatten(0, 2) + far[:, None] * directions.flatten(0, 2),
        quats=quaternion.multiply(_camera_quats(base), activations.rotation(rotation)),
        scales=footprint[:, None] * activations.bounded_factor(scale, config.log_scale_limit),
        opacities=activations.opacity(opacity[:, 0], base.opacity.flatten()),
        sh=dc_from_color(activations.color(rgb, base.rgb.flatten(0, 2)))[:, None],
    )


def _focal_px(base: PixelBase) -> Float[Tensor, " n"]:
    """Geometric mean of the two focal lengths, per cell."""
    focal_px = base.cameras.focal_px.prod(-1).sqrt()
    return focal_px[:, None, None].expand(base.distance.shape).flatten()


def _camera_quats(base: PixelBase) -> Float[Tensor, "n 4"]:
    quats = quaternion.from_matrix(base.cameras.world_from_camera[:, :3, :3])
    return quats[:, None, None].expand(*base.distance.shape, 4).flatten(0, 2)


def _require_fit(raw: Tensor, base: PixelBase) -> None:
    channels = sum(GAUSSIAN_SPLIT)
    want = (channels, *base.distance.shape)
    if tuple(raw.shape) != want:
        raise ShapeError(f"raw maps: expected {want} (from the base), got {tuple(raw.shape)}")
    tensors = {"raw maps": raw, "base colour": base.rgb, "base distance": base.distance}
    tensors |= {"base opacity": base.opacity, "camera poses": base.cameras.world_from_camera}
    tensors |= {"camera focal lengths": base.cameras.focal_px}
    for what, tensor in tensors.items():
        activations.require_full_precision(tensor, what)
