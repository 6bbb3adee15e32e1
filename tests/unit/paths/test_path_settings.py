import math
from typing import Any

import pytest
import torch

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry.camera import pinhole
from diff4splat.paths.settings import PathFrame, PathSettings

CAMERA = pinhole(50.0, (8, 8))


@pytest.mark.parametrize(
    ("near", "focus"),
    [
        (0.0, 1.0),
        (-1.0, 1.0),
        (2.0, 1.0),
        (1.0, math.inf),
        (math.nan, 1.0),
        (1.0, math.nan),
        (math.inf, math.inf),
    ],
)
def test_depths_must_be_ordered_and_finite(near: float, focus: float) -> None:
    with pytest.raises(InputError, match="expected 0 < near depth <= focus depth < infinity"):
        PathFrame(camera=CAMERA, near_depth=near, focus_depth=focus)


def test_equal_depths_are_fine() -> None:
    assert PathFrame(camera=CAMERA, near_depth=1.0, focus_depth=1.0).focus_depth == 1.0


def test_a_batch_of_cameras_is_refused() -> None:
    batch = CAMERA.with_pose(torch.eye(4).expand(3, 4, 4))
    with pytest.raises(ShapeError, match=r"PathFrame.camera: expected one camera"):
        PathFrame(camera=batch, near_depth=1.0, focus_depth=1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frames": 0}, "frames: expected 1 to 100000, got 0"),
        ({"frames": -3}, "got -3"),
        ({"frames": 100_001}, "got 100001"),
        ({"fps": 0.0}, "fps: expected a finite rate above 0, got 0"),
        ({"fps": math.inf}, "got inf"),
        ({"fps": math.nan}, "got nan"),
        ({"amplitude": math.nan}, "expected an amplitude from -100 to 100, got nan"),
        ({"amplitude": 1e9}, "got 1e"),
        ({"easing": "bouncy"}, "easing: expected one of linear, smooth, ease-in, ease-out"),
    ],
)
def test_settings_are_checked(as_shipped: None, change: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        PathSettings(**({"frames": 5, "fps": 24.0} | change))
