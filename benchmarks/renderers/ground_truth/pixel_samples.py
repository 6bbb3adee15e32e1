"""Which pixels are looked at, and the truth about them, kept in a file for the workers.

Half of the pixels are uniform over the image: they alone count blended pairs. The other half lie
within a standard deviation or so of random Gaussians, so that a scene that covers little of the
image is looked at where it is. The loss of the gradients is Σ rgb · grad over a few of them,
grad standard normal; doubtful pixels come last, because there the true gradient jumps.
"""

from dataclasses import dataclass, fields
from pathlib import Path

import torch
from jaxtyping import Float, Int
from scenes import Scene
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians
from ground_truth.brute_force import Pixels, gradients, look, project

EVALUATIONS = 200_000_000
"""Pairs of pixel and Gaussian that looking may evaluate."""
MOST_PIXELS, LEAST_PIXELS, GRADIENT_PIXELS = 2_000, 128, 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """The true image and gradients of one scene, at some pixels."""

    index: Int[Tensor, " p"]
    """Row-major pixel numbers; uniform ones first."""
    pixels: Pixels
    blended_pairs: float
    """Pairs of pixel and Gaussian blended in the whole image, estimated."""
    grad_index: Int[Tensor, " g"]
    grad: Float[Tensor, "g 3"]
    gradients: Gaussians | None
    """Float64; None where nobody asked."""

    def grad_rgb(self, size_px: tuple[int, int]) -> Float[Tensor, "h w 3"]:
        """The gradient of the loss in the image: 0 but for a few pixels."""
        flat = torch.zeros(size_px[0] * size_px[1], 3)
        flat[self.grad_index] = self.grad
        return flat.unflatten(0, size_px)


def find_truth(scene: Scene, with_gradients: bool = True) -> Truth:
    """Sample pixels of ``scene`` and evaluate them by brute force."""
    gaussians, camera = scene.build()
    generator = torch.Generator().manual_seed(0)
    count = min(MOST_PIXELS, max(LEAST_PIXELS, EVALUATIONS // len(gaussians)))
    index, uniform = sample(gaussians, camera, count, generator)
    pixels = look(gaussians, camera, index)
    sure_first = index[pixels.doubtful.int().argsort(stable=True)]
    shuffled = torch.randperm(int((~pixels.doubtful).sum()), generator=generator)
    chosen = torch.cat([sure_first[shuffled], sure_first[len(shuffled) :]])
    chosen = chosen[: min(GRADIENT_PIXELS, count // 2)]
    grad = torch.randn(len(chosen), 3, generator=generator)
    per_pixel = float(pixels.blended[:uniform].double().mean())
    return Truth(
        index=index,
        pixels=pixels,
        blended_pairs=per_pixel * camera.size_px[0] * camera.size_px[1],
        grad_index=chosen,
        grad=grad,
        gradients=gradients(gaussians, camera, chosen, grad) if with_gradients else None,
    )


def sample(
    gaussians: Gaussians, camera: Camera, count: int, generator: torch.Generator
) -> tuple[Int[Tensor, " p"], int]:
    """Distinct pixel numbers, and how many of the first are uniform over the image."""
    height, width = camera.size_px
    uniform = torch.randperm(height * width, generator=generator)[: count // 2]
    splats = project(gaussians, camera)
    which = torch.randint(len(splats.opacity), (count - len(uniform),), generator=generator)
    spread = splats.precision[which][:, [0, 2]].rsqrt()
    at = splats.center[which] + spread * torch.randn(len(which), 2, generator=generator)
    inside = ((at >= 0) & (at < torch.tensor([width, height]))).all(1)
    column, row = at[inside].long().unbind(-1)
    near = torch.unique(row * width + column)
    near = near[~torch.isin(near, uniform)]
    return torch.cat([uniform, near]), len(uniform)


def save(truth: Truth, file: Path) -> None:
    """Write for another process of this run."""
    torch.save({field.name: getattr(truth, field.name) for field in fields(truth)}, file)


def read(file: Path) -> Truth:
    """Read what another process of this run wrote."""
    with torch.serialization.safe_globals([Gaussians, Pixels]):
        return Truth(**torch.load(file))
