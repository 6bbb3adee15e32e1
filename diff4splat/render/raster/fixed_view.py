"""One view that is drawn again and again in other colours.

Places, order and the lists of tiles do not depend on colours and take most of an image's time.
Images are those of ``rasterize``, in every bit.

Axes: ``n`` Gaussians, ``k`` harmonics.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.render.raster import forward as stages
from diff4splat.render.raster.forward import Filled
from diff4splat.render.raster.function import Raster
from diff4splat.render.raster.padded_image import PaddedImage
from diff4splat.render.raster.raster_settings import RasterSettings, make_view
from diff4splat.render.raster.tables import Cloud
from diff4splat.scene.gaussians import Gaussians

BYTES_PER_PAIR = 8
"""Of a list, where nothing is kept for gradients."""


class FixedView:
    """Gaussians from one camera; lists of tiles beyond ``memory_bytes`` are made for each image."""

    def __init__(
        self, plan: RasterSettings, gaussians: Gaussians, camera: Camera, memory_bytes: int
    ) -> None:
        self._plan = replace(plan, pair_limit=memory_bytes // BYTES_PER_PAIR)
        self._view = make_view(
            plan.grid, camera.world_from_camera, camera.focal_px, camera.center_px
        )
        self._cloud = Cloud(*(_array(getattr(gaussians, name)) for name in Cloud._fields))
        self._found = stages.footprints(self._cloud, _array(gaussians.sh), self._view, self._plan)
        self._binned = stages.bin_footprints(self._found, self._plan)
        self._kept = list(self._fill()) if len(self._binned.regions) == 1 else None

    def draw(self, sh: Float[Tensor, "n k 3"]) -> Raster:
        """The image with these harmonics, which are finite, as those at first were."""
        harmonics = _array(sh)
        nothing = np.zeros((len(harmonics), 0), np.float32)
        values = stages.channel_table(
            self._plan, self._cloud, harmonics, nothing, self._view, self._found.visible
        )
        image = PaddedImage(self._plan.grid, values.shape[1], medians=False)
        for filled in self._kept or self._fill():
            stages.blend_region(self._plan, filled, self._found, values, image)
        return Raster(
            planes=image.cropped(image.planes)[:3],
            light=image.cropped(image.light)[0],
            medians=image.cropped(image.medians),
            unusable=tuple(self._found.unusable.tolist()),
        )

    def _fill(self) -> Iterator[Filled]:
        for region in self._binned.regions:
            yield stages.fill_region(self._found, self._plan.grid, self._binned, region)


def _array(tensor: Tensor) -> np.ndarray:
    return tensor.detach().contiguous().numpy()
