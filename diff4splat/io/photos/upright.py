"""EXIF orientations as flips and turns of arrays, as photographs are turned upright."""

import numpy as np


def upright_array(values: np.ndarray, orientation: int) -> np.ndarray:
    """``values`` (h, w, ...) as they look upright; orientations beyond 2 to 8 change nothing.

    1 is upright, 2 mirrored, 3 turned by 180 degrees, 4 upside down, 5 transposed, 6 needs a turn
    clockwise, 7 is transposed along the other diagonal, 8 needs a turn anticlockwise (EXIF 2.32).
    """
    steps = {
        2: lambda a: a[:, ::-1],
        3: lambda a: a[::-1, ::-1],
        4: lambda a: a[::-1],
        5: lambda a: a.swapaxes(0, 1),
        6: lambda a: np.rot90(a, -1),
        7: lambda a: a[::-1, ::-1].swapaxes(0, 1),
        8: lambda a: np.rot90(a, 1),
    }
    return np.ascontiguousarray(steps.get(orientation, lambda a: a)(values))
