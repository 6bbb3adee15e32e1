"""Where tokens and noise levels are, as CogVideoX's weights expect it.

Axes: ``t h w`` frames, rows and columns of tokens, ``d`` width, ``p`` pairs of head channels. Sines
are taken of the same float32 or float64 numbers as in diffusers: 998 in float32 turns by 6e-5.
"""

import math

import torch
from jaxtyping import Complex, Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.models.blocks.rope import BASE
from diff4splat.models.config.joint import JointConfig

Grid = tuple[int, int, int]


def step_embedding(step: Float[Tensor, "*b"], width: int) -> Float[Tensor, "*b {width}"]:
    """cos, then sin, of a step at geometrically spaced frequencies, in float32."""
    half = width // 2
    exponent = -math.log(BASE) * torch.arange(half, dtype=torch.float32, device=step.device)
    angle = step.float()[..., None] * (exponent / half).exp()
    return torch.cat([angle.cos(), angle.sin()], -1)


def added_positions(
    grid: Grid, width: int, config: JointConfig, device: torch.device
) -> Float[Tensor, "t h w d"]:
    """Sinusoids of frames (a quarter of the width), columns and rows (three eighths each)."""
    scales = (config.time_scale, config.space_scale, config.space_scale)
    widths = (width // 4, 3 * width // 8, 3 * width // 8)
    frames, rows, columns = (
        _sinusoids(count, side, scale, device)
        for count, side, scale in zip(grid, widths, scales, strict=True)
    )
    parts = (frames[:, None, None], columns[None, None], rows[None, :, None])
    return torch.cat([part.expand(*grid, -1) for part in parts], -1)


def _sinusoids(
    count: int, width: int, scale: float, device: torch.device
) -> Float[Tensor, "n {width}"]:
    """sin, then cos, of positions 0, 1, … divided by ``scale``."""
    position = torch.arange(count, dtype=torch.float32, device=device) / scale
    exponent = torch.arange(width // 2, dtype=torch.float64, device=device) / (width / 2)
    angle = position.double()[:, None] / BASE**exponent
    return torch.cat([angle.sin(), angle.cos()], -1).float()


def rotary_turns(
    grid: Grid, head_width: int, text_tokens: int, config: JointConfig, device: torch.device
) -> Complex[Tensor, "n 1 p"]:
    """By which channels turn: not for text, and by their positions for the grid behind it."""
    widths = (head_width // 4, head_width // 8 * 3, head_width // 8 * 3)
    angles = []
    for axis, (position, width) in enumerate(
        zip(_rotary_positions(grid, config, device), widths, strict=True)
    ):
        exponent = torch.arange(0, width, 2, dtype=torch.float32, device=device) / width
        shape = [1, 1, 1, width // 2]
        shape[axis] = grid[axis]
        # Multiplication, not einsum: automatic mixed precision must leave the angles alone.
        angle = position[:, None] * (1 / BASE**exponent)
        angles.append(angle.reshape(shape).expand(*grid, -1))
    flat = torch.cat(angles, -1).flatten(0, 2)
    flat = torch.cat([flat.new_zeros(text_tokens, flat.shape[1]), flat])
    return torch.complex(flat.cos(), flat.sin())[:, None]


def _rotary_positions(
    grid: Grid, config: JointConfig, device: torch.device
) -> tuple[Tensor, Tensor, Tensor]:
    """Whole numbers with two frames per token; else rows and columns fill the trained grid."""
    options = {"dtype": torch.float32, "device": device}
    frames, rows, columns = (torch.arange(count, **options) for count in grid)
    if config.patch_frames == 1:
        (top, left), (bottom, right) = _fitted_grid(grid[1:], config.base_grid[1:])
        rows = torch.linspace(top, bottom * (grid[1] - 1) / grid[1], grid[1], **options)
        columns = torch.linspace(left, right * (grid[2] - 1) / grid[2], grid[2], **options)
    return frames, rows, columns


def _fitted_grid(
    size: tuple[int, int], base: tuple[int, int]
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Corners of the largest area of the trained grid that has the sides' ratio."""
    (rows, columns), (most_rows, most_columns) = size, base
    if rows / columns > most_rows / most_columns:
        fitted = (most_rows, round(most_rows / rows * columns))
    else:
        fitted = (round(most_columns / columns * rows), most_columns)
    top, left = (round((most - side) / 2) for most, side in zip(base, fitted, strict=True))
    return (top, left), (top + fitted[0], left + fitted[1])


def learned_positions(
    table: Float[Tensor, "n d"], grid: Grid, base: Grid
) -> Float[Tensor, "t h w d"]:
    """The trained table, its first frames; other sides than the trained ones are interpolated.

    Raises:
        ShapeError: more frames than the table has.
    """
    if grid[0] > base[0]:
        raise ShapeError(
            f"video: expected at most {base[0]} latent frames, as many as this model has learned "
            f"positions for, got {grid[0]}; use fewer frames"
        )
    trained = table.unflatten(0, base)[: grid[0]]
    if grid[1:] == base[1:]:
        return trained
    resized = torch.nn.functional.interpolate(
        trained.movedim(-1, 1).float(), size=grid[1:], mode="bilinear", antialias=True
    )
    return resized.movedim(1, -1).to(table.dtype)
