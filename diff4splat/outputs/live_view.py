"""A scene in the browser while it is still being fitted, with viser (extra ``live``).

The page is served to this machine alone. A scene is sent only when the last one is old enough, so
that the view takes a small share of the fit's time.
"""

import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from diff4splat.errors import MissingExtraError, OutputError
from diff4splat.geometry import quaternion
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import color_from_dc
from diff4splat.scene.scene import Scene

HOST = "127.0.0.1"
EVERY_S = 2.0
LARGEST_SHARE = 0.05
"""Of the fit's time that the view may take."""
LEAST_OPACITY = 1 / 255


class LiveView:
    """A page on ``port`` that shows the last scene it was offered, at the time of its slider."""

    def __init__(self, port: int, time_range_s: tuple[float, float]) -> None:
        """Start to serve.

        Raises:
            MissingExtraError: viser is not installed.
            OutputError: no such port can be opened.
        """
        viser = require_viser()
        try:
            self._server = viser.ViserServer(host=HOST, port=port, verbose=False)
        except (OSError, OverflowError) as error:
            raise OutputError(
                f"--live: expected a free port, got {port} ({error}); name another"
            ) from error
        self._scene: Scene | None = None
        self._splats: Any = None
        self._next_s = 0.0
        self._lock = threading.Lock()
        start_s, stop_s = time_range_s
        self._server.scene.set_up_direction("-y")
        self._slider = self._server.gui.add_slider(
            "time, s",
            start_s,
            max(stop_s, start_s + 1e-3),
            (stop_s - start_s) / 100 or 1e-3,
            start_s,
        )
        self._slider.on_update(lambda _: self._show())
        self._server.on_client_connect(self._place_camera)

    def __enter__(self) -> "LiveView":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._server.stop()

    @property
    def address(self) -> str:
        """Where a browser finds it; viser takes the next port if one is in use."""
        return f"http://localhost:{self._server.get_port()}"

    def offer(self, scene: Callable[[], Scene]) -> None:
        """Show what ``scene`` makes, unless the last one was shown a moment ago."""
        start_s = time.perf_counter()
        if start_s < self._next_s:
            return
        with torch.no_grad():
            self._scene = scene()
        self._show()
        stop_s = time.perf_counter()
        self._next_s = stop_s + max(EVERY_S, (stop_s - start_s) / LARGEST_SHARE)

    def _show(self) -> None:
        if self._scene is None:
            return
        with self._lock, torch.no_grad():
            arrays = splat_arrays(self._scene.state_at(float(self._slider.value)))
            if self._splats is None:
                self._splats = self._server.scene.add_gaussian_splats("/scene", **arrays)
            else:
                self._splats.set_gaussians(**arrays)

    def _place_camera(self, client: Any) -> None:
        """Where the first camera of the path is."""
        if self._scene is None:
            return
        pose = self._scene.path.cameras.world_from_camera[0].double().cpu().numpy()
        client.camera.up_direction = -pose[:3, 1]
        client.camera.position = pose[:3, 3]
        means = self._scene.gaussians.means.detach().double().cpu().numpy()
        depth = (
            float(np.median(np.linalg.norm(means - pose[:3, 3], axis=-1))) if len(means) else 1.0
        )
        client.camera.look_at = pose[:3, 3] + depth * pose[:3, 2]


def require_viser() -> Any:
    """The library.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import viser
    except ImportError as error:
        raise MissingExtraError(
            "--live: expected viser, got none installed; pip install 'diff4splat[live]'"
        ) from error
    return viser


def splat_arrays(gaussians: Gaussians) -> dict[str, Float[np.ndarray, "n *s"]]:
    """What viser draws: centres, covariances, constant colour and opacity of what can be seen."""
    gaussians = gaussians.select(gaussians.opacities >= LEAST_OPACITY)
    axes = quaternion.to_matrix(gaussians.quats) * gaussians.scales[:, None]
    rgb = color_from_dc(gaussians.sh[:, 0]).clamp(0, 1)
    tensors = {
        "centers": gaussians.means,
        "covariances": axes @ axes.mT,
        "rgbs": rgb,
        "opacities": gaussians.opacities[:, None],
    }
    return {name: value.detach().float().cpu().numpy() for name, value in tensors.items()}
