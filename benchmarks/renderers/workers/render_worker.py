"""What happens in a worker: one renderer, one scene; and the desk that finds the truth.

Methods are called by name from the parent (``process.Worker``), one at a time.
"""

import time
from pathlib import Path

import torch
from adapter import Adapter, Prepared, judged, note, refusal
from ground_truth.comparison import gradient_errors, image_error
from ground_truth.pixel_samples import find_truth, read, save
from loading import load
from records import GradientError, ImageError, Kind, Work
from scenes import TINY, Scene
from torch import Tensor

from diff4splat.geometry.camera import Camera
from workers.memory import peak_bytes, reset_peak


class RenderWorker:
    """One renderer with one scene prepared."""

    def __init__(self) -> None:
        self._adapter: Adapter | None = None
        self._prepared: Prepared | None = None
        self._camera: Camera | None = None
        self._grad_rgb: Tensor | None = None

    def load(self, file: Path) -> tuple[str, bool]:
        """Load the adapter; its note, and whether its image is evaluated."""
        self._adapter = load(file)
        return note(self._adapter), judged(self._adapter)

    def prepare(self, scene: Scene) -> str | None:
        """Why the scene is refused; otherwise compile on a tiny scene, then prepare this one."""
        assert self._adapter is not None
        reason = refusal(self._adapter, scene)
        if reason is not None:
            return reason
        for each in (TINY[scene.degree], scene):
            gaussians, self._camera = each.build()
            generator = torch.Generator().manual_seed(0)
            self._grad_rgb = torch.randn(*each.size_px, 3, generator=generator)
            self._prepared = self._adapter.prepare(gaussians, self._camera)
            if each is not scene:
                self._call("forward")
                self._call("both")
        return None

    def first(self, kind: Kind) -> tuple[float, int] | None:
        """Seconds and growth of memory of one call; None without a backward."""
        before = reset_peak()
        seconds = self._timed(kind)
        return None if seconds is None else (seconds, peak_bytes() - before)

    def window(self, kind: Kind, least_s: float) -> float:
        """Seconds per call, over as many calls as fill ``least_s``."""
        calls, began = 0, time.perf_counter()
        while (spent := time.perf_counter() - began) < least_s or calls == 0:
            self._call(kind)
            calls += 1
        return spent / calls

    def check_image(self, truth_file: Path) -> ImageError:
        """The image against the truth."""
        assert self._prepared is not None
        return image_error(self._prepared.forward(), read(truth_file))

    def check_gradients(self, truth_file: Path) -> tuple[GradientError, ...]:
        """The gradients against the truth; empty without a backward."""
        assert self._prepared is not None
        assert self._camera is not None
        truth = read(truth_file)
        assert truth.gradients is not None
        found = self._prepared.forward_backward(truth.grad_rgb(self._camera.size_px))
        return () if found is None else gradient_errors(found, truth.gradients)

    def _timed(self, kind: Kind) -> float | None:
        began = time.perf_counter()
        return time.perf_counter() - began if self._call(kind) else None

    def _call(self, kind: Kind) -> bool:
        """One call; False where there is no backward."""
        assert self._prepared is not None
        if kind == "forward":
            self._prepared.forward()
            return True
        return self._prepared.forward_backward(self._grad_rgb) is not None


class GroundTruthWorker:
    """Finds what is true about a scene."""

    def find(self, scene: Scene, file: Path, with_gradients: bool) -> Work:
        """Write the truth to ``file``."""
        truth = find_truth(scene, with_gradients)
        save(truth, file)
        return Work(
            scene=scene.name,
            gaussians=scene.count,
            pixels=scene.size_px[0] * scene.size_px[1],
            blended_pairs=truth.blended_pairs,
        )
