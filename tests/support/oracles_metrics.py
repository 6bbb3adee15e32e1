"""Measures in float64, written from their formulas with numpy and loops."""

import math

import numpy as np
import torch
from scipy import ndimage, signal
from torch import Tensor, nn

VGG16_LAYERS = (64, 64, "M", 128, 128, "M", 256, 256, 256, "M", *(512, 512, 512, "M") * 2)
VGG16_TAPS = (3, 8, 15, 22, 29)
"""Which of torchvision's ``features`` end a slice, counted from the published class."""
ALEXNET_TAPS = (1, 4, 7, 9, 11)


def vgg16_features() -> nn.Sequential:
    """Laid out as torchvision's vgg16().features."""
    layers: list[nn.Module] = []
    inputs = 3
    for width in VGG16_LAYERS:
        if width == "M":
            layers.append(nn.MaxPool2d(2, 2))
        else:
            layers += [nn.Conv2d(inputs, width, 3, padding=1), nn.ReLU()]
            inputs = width
    return nn.Sequential(*layers)


def alexnet_features() -> nn.Sequential:
    """Laid out as torchvision's alexnet().features."""
    return nn.Sequential(
        *(nn.Conv2d(3, 64, 11, stride=4, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2)),
        *(nn.Conv2d(64, 192, 5, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2)),
        *(nn.Conv2d(192, 384, 3, padding=1), nn.ReLU()),
        *(nn.Conv2d(384, 256, 3, padding=1), nn.ReLU()),
        *(nn.Conv2d(256, 256, 3, padding=1), nn.ReLU(), nn.MaxPool2d(3, 2)),
    )


def lpips(features: nn.Sequential, taps, heads, image: Tensor, reference: Tensor) -> list[float]:
    """LPIPS 0.1 of ``n 3 h w`` images in [0, 1], one pair and one slice after the other."""
    shift = torch.tensor([-0.030, -0.088, -0.188]).double()[:, None, None]
    scale = torch.tensor([0.458, 0.448, 0.450]).double()[:, None, None]
    distances = []
    for pair in zip(image, reference, strict=True):
        found = []
        for side in pair:
            state = ((side.double() * 2 - 1) - shift) / scale
            outputs = []
            for index, layer in enumerate(features[: taps[-1] + 1].double()):
                state = layer(state)
                if index in taps:
                    outputs.append(state.detach().numpy())
            found.append(outputs)
        total = 0.0
        for outputs, head in zip(zip(*found, strict=True), heads, strict=True):
            one, other = (part / (np.sqrt((part**2).sum(0)) + 1e-10) for part in outputs)
            weighed = np.tensordot(np.asarray(head, dtype=float), (one - other) ** 2, 1)
            total += weighed.mean()
        distances.append(total)
    return distances


def gradient_pyramid(image: np.ndarray, reference: np.ndarray) -> float:
    """The stand-in's distance of two ``3 h w`` images, from its module's formulas."""
    opponent = np.array([[1 / 3, 1 / 3, 1 / 3], [0.5, -0.5, 0], [0.25, 0.25, -0.5]])
    window = np.outer([1, 4, 6, 4, 1], [1, 4, 6, 4, 1]) / 256

    def halved(plane: np.ndarray) -> np.ndarray:
        return ndimage.correlate(plane, window, mode="nearest")[::2, ::2]

    def strengths(colors: list[np.ndarray]) -> list[np.ndarray]:
        found = []
        for plane in colors:
            smooth = np.array([3, 10, 3]) / 16
            along = ndimage.correlate(plane, np.outer(smooth, [-0.5, 0, 0.5]), mode="nearest")
            down = ndimage.correlate(plane, np.outer([-0.5, 0, 0.5], smooth), mode="nearest")
            for k in range(8):
                turned = math.cos(k * math.pi / 4) * along + math.sin(k * math.pi / 4) * down
                energy = halved(np.maximum(turned, 0) ** 2)
                found.append(np.sqrt(energy + 0.02**2) - 0.02)
        return found

    pair = [[np.tensordot(row, side, 1) for row in opponent] for side in (image, reference)]
    structures = []
    while True:
        one, other = strengths(pair[0]), strengths(pair[1])
        apart = sum((a - b) ** 2 for a, b in zip(one, other, strict=True))
        contrast = sum(a**2 + b**2 for a, b in zip(one, other, strict=True)) + 0.02**2
        structures.append((apart / contrast).mean())
        if len(structures) == 4 or min(pair[0][0].shape) < 6:
            break
        pair = [[halved(plane) for plane in side] for side in pair]
    rest = np.mean([(a - b) ** 2 for a, b in zip(*pair, strict=True)])
    return float(np.mean(structures) + rest)


def ssim(image: np.ndarray, reference: np.ndarray) -> float:
    """Of two ``h w 3`` images, window by window."""
    ticks = np.arange(-5, 6)
    line = np.exp(-0.5 * (ticks / 1.5) ** 2)
    window = np.outer(line, line) / line.sum() ** 2
    values = []
    for c in range(3):
        x, y = image[..., c], reference[..., c]

        def mean(plane: np.ndarray) -> np.ndarray:
            return signal.correlate2d(plane, window, mode="valid")

        mx, my = mean(x), mean(y)
        vx, vy, vxy = mean(x * x) - mx**2, mean(y * y) - my**2, mean(x * y) - mx * my
        c1, c2 = 0.01**2, 0.03**2
        values.append((2 * mx * my + c1) * (2 * vxy + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2)))
    return float(np.mean(values))


def quaternion_angle_deg(one: np.ndarray, other: np.ndarray) -> float:
    """Angle between two rotation matrices, by scipy's rotation vectors."""
    from scipy.spatial.transform import Rotation

    return math.degrees(Rotation.from_matrix(one.T @ other).magnitude())


def umeyama_by_search(own: np.ndarray, true: np.ndarray) -> float:
    """Least root mean square distance over all similarities, by numerical minimisation."""
    from scipy.optimize import minimize
    from scipy.spatial.transform import Rotation

    def distance(parameters: np.ndarray) -> float:
        rotation = Rotation.from_rotvec(parameters[:3]).as_matrix()
        moved = np.exp(parameters[3]) * own @ rotation.T + parameters[4:]
        return float(((moved - true) ** 2).sum(1).mean())

    starts = np.random.default_rng(0).normal(size=(12, 7))
    return math.sqrt(min(minimize(distance, start, tol=1e-14).fun for start in starts))
