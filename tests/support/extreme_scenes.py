"""Random scenes, cameras and rays whose numbers go from 0 to the largest float32."""

import torch
from torch import Generator, Tensor

SIZES = torch.tensor(
    [
        0,
        1e-38,
        1e-30,
        1e-20,
        1e-10,
        1e-6,
        1e-3,
        0.1,
        1,
        10,
        1e3,
        1e6,
        1e10,
        1e15,
        1e19,
        1e20,
        1e30,
        3e38,
    ]
)
OPACITIES = torch.tensor([0, 1, 1e-38, 1e-20, 0.5, 0.999999, 1.0])
LARGEST, EXTREME_SHARE = 3e38, 0.4
Leaves = dict[str, Tensor]


class ExtremeNumbers:
    """Draws tensors that are plain, extreme in some entries, or extreme as a whole."""

    def __init__(self, seed: int) -> None:
        self.generator = Generator().manual_seed(seed)

    def gaussians(self) -> Leaves:
        """Parameters of 1 to 11 Gaussians in front of the origin, which ask for gradients."""
        count = 1 + self.integer(11)
        leaves = {
            "means": self.spoilt(self.normal(count, 3) + torch.tensor([0, 0, 4.0])),
            "quats": self.spoilt(self.normal(count, 4)),
            "scales": self.spoilt(0.3 * self.normal(count, 3).abs() + 0.01).abs(),
            "opacities": self.opacities(count),
            "sh": self.spoilt(self.normal(count, 4, 3)),
        }
        return {name: value.requires_grad_() for name, value in leaves.items()}

    def camera(self) -> Leaves:
        """A small image's camera, which may be far away or have any lens."""
        pose = torch.eye(4)
        pose[:3, 3] = self.spoilt(torch.zeros(3))
        leaves = {
            "focal_px": self.spoilt(torch.full((2,), 16.0)).abs().clamp_min(1e-30),
            "center_px": self.spoilt(torch.tensor([7.0, 6.0])),
            "world_from_camera": pose,
        }
        return {name: value.requires_grad_() for name, value in leaves.items()}

    def rays(self) -> Leaves:
        """Sixteen rays from near the origin, most of them forward."""
        ahead = 0.3 * self.normal(16, 3) + torch.tensor([0, 0, 1.0])
        leaves = {
            "origins": self.spoilt(0.1 * self.normal(16, 3)),
            "directions": self.spoilt(ahead),
        }
        return {name: value.requires_grad_() for name, value in leaves.items()}

    def opacities(self, count: int) -> Tensor:
        """Some in [0, 1], or those at its ends."""
        if self.chance() < EXTREME_SHARE:
            return OPACITIES[[self.integer(len(OPACITIES)) for _ in range(count)]].clone()
        return torch.rand(count, generator=self.generator)

    def spoilt(self, plain: Tensor) -> Tensor:
        """``plain``, or the same with other sizes."""
        if self.chance() > EXTREME_SHARE:
            return plain
        if self.chance() < 0.3:
            return (plain * SIZES[self.integer(len(SIZES))]).clamp(-LARGEST, LARGEST)
        picked = torch.randint(len(SIZES), plain.shape, generator=self.generator)
        sizes = SIZES[picked] * self.normal(*plain.shape).sign()
        chosen = torch.rand(plain.shape, generator=self.generator) < 0.3 * self.chance()
        return torch.where(chosen, sizes, plain)

    def normal(self, *shape: int) -> Tensor:
        """Standard normal numbers."""
        return torch.randn(shape, generator=self.generator)

    def integer(self, count: int) -> int:
        """Below ``count``."""
        return int(torch.randint(count, (1,), generator=self.generator))

    def chance(self) -> float:
        """In [0, 1)."""
        return float(torch.rand(1, generator=self.generator))


def not_finite(values: Leaves) -> list[str]:
    """Names of tensors that hold NaN or infinity."""
    return [name for name, value in values.items() if not bool(torch.isfinite(value).all())]


def gradients(*groups: Leaves) -> Leaves:
    """Those that were computed, by the name of their leaf."""
    pairs = [pair for group in groups for pair in group.items()]
    return {f"gradient of {name}": leaf.grad for name, leaf in pairs if leaf.grad is not None}
