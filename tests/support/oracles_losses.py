"""Losses in float64, written from their formulas with loops over elements, maps and points."""

import math

import numpy as np


def flow_matching(velocity: np.ndarray, clean: np.ndarray, noise: np.ndarray, first: int):
    """Per element, over latent frames from ``first`` on."""
    losses = []
    for predicted, data, random in zip(velocity, clean, noise, strict=True):
        squares = (predicted - (random - data))[:, first:] ** 2
        losses.append(squares.mean() if squares.size else 0.0)
    return np.array(losses)


def weighted_flow_matching(velocity, clean, noise, cells, channels, first: int) -> list[float]:
    """Per element: sum over cells and channels of weight · square, over the sum of cell weights."""
    losses = []
    for predicted, data, random, weights in zip(velocity, clean, noise, cells, strict=True):
        total, share = 0.0, 0.0
        for c, t, y, x in np.ndindex(data.shape):
            if t >= first:
                error = predicted[c, t, y, x] - (random[c, t, y, x] - data[c, t, y, x])
                total += weights[t, y, x] * channels[c] * error**2
                share += weights[t, y, x]
        losses.append(total / share if share else 0.0)
    return losses


def hidden_share(validity: np.ndarray, grid: tuple[int, int, int]) -> np.ndarray:
    """Of ``validity`` (f, hh, ww): the hidden part of every latent cell, pixel by pixel."""
    rows, columns = validity.shape[1] // grid[1], validity.shape[2] // grid[2]
    hidden, count = np.zeros(grid), np.zeros(grid)
    for frame, row, column in np.ndindex(validity.shape):
        # Latent frame 0 is video frame 0; every other one is four video frames.
        cell = (-(-frame // 4), row // rows, column // columns)
        hidden[cell] += validity[frame, row, column] == 0
        count[cell] += 1
    return hidden / count


def correlation_loss(rendered: np.ndarray, truth: np.ndarray, valid: np.ndarray) -> float:
    """Of one map, over its valid pixels, by numpy's own correlation."""
    return 1 - np.corrcoef(rendered[valid], truth[valid])[0, 1]


def smoothness(depth: np.ndarray, valid: np.ndarray) -> float:
    """Of one element ``k h w``: each map in units of its mean, pairs gathered one by one."""
    along, across = [], []
    maps, height, width = depth.shape
    for k in range(maps):
        known = depth[k][valid[k]]
        unit = known.mean() if known.size else 1.0
        for y in range(height):
            for x in range(width):
                if not valid[k, y, x]:
                    continue
                if x + 1 < width and valid[k, y, x + 1]:
                    along.append(abs(depth[k, y, x + 1] - depth[k, y, x]) / unit)
                if y + 1 < height and valid[k, y + 1, x]:
                    across.append(abs(depth[k, y + 1, x] - depth[k, y, x]) / unit)
    return sum(float(np.mean(steps)) for steps in (along, across) if steps)


def motion(predicted, truth, valid, distance_weight: float, l1_weight: float) -> float:
    """Of one element ``... n 3``."""
    total, count = 0.0, 0
    for own, true, keep in zip(
        predicted.reshape(-1, 3), truth.reshape(-1, 3), valid.reshape(-1), strict=True
    ):
        if keep:
            apart = math.sqrt(sum((a - b) ** 2 for a, b in zip(own, true, strict=True)))
            total += distance_weight * apart + l1_weight * sum(abs(a) for a in own)
            count += 1
    return total / count if count else 0.0


def normal_divergence(mean: float, std: float) -> float:
    """KL(N(mean, std²) ‖ N(0, 1)) by quadrature of p log(p / q)."""
    points = np.linspace(mean - 14 * std, mean + 14 * std, 400_001)
    log_p = -0.5 * ((points - mean) / std) ** 2 - math.log(std)
    log_q = -0.5 * points**2
    density = np.exp(log_p) / math.sqrt(2 * math.pi)
    return float(np.sum(density * (log_p - log_q)) * (points[1] - points[0]))
