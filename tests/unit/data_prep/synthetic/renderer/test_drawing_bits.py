"""The same world gives the same bits: again, with threads, in another process, on another CPU."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import oracles_drawing as oracle
import pytest

from diff4splat.data.clip import Clip
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings

SETTINGS = {"samples_per_side": 4, "tracks": 30, "shadow_px": 64}
GOLDEN = "e9d6e5c8ea46a2b8"
SUPPORT = Path(__file__).parents[4] / "support"
SCRIPT = """
import sys
sys.path[:0] = [{support!r}, {here!r}]
from test_drawing_bits import digest, small
print(digest(small()))
"""


def small(threads: int = 1) -> Clip:
    return draw_clip(oracle.still_life(3, (16, 20), 2), DrawSettings(**SETTINGS, threads=threads))


def digest(clip: Clip) -> str:
    """Of every tensor of a clip."""
    found = hashlib.sha256()
    parts = [clip.times_s, clip.tracks.positions, clip.tracks.instances, clip.tracks.found_at]
    for view in clip.views:
        flow = view.flow
        parts += [view.rgb, view.depth, view.instances, view.track_uv, view.track_visible]
        parts += [flow.to_next, flow.known, flow.visible, view.cameras.world_from_camera]
    for part in parts:
        found.update(part.contiguous().numpy().tobytes())
    return found.hexdigest()[:16]


def test_a_world_looks_the_same_forever() -> None:
    assert digest(small()) == GOLDEN


def test_threads_change_nothing() -> None:
    assert digest(small(3)) == digest(small(1))


@pytest.mark.slow
def test_a_plain_processor_gives_the_same_bits(tmp_path: Path) -> None:
    script = SCRIPT.format(support=str(SUPPORT), here=str(Path(__file__).parent))
    plain = {
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
        "NUMBA_CACHE_DIR": str(tmp_path),
        "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3",
        "ATEN_CPU_CAPABILITY": "default",
    }
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script],
        capture_output=True, text=True, timeout=900, check=True, env={**os.environ, **plain},
    )  # fmt: skip
    assert done.stdout.strip() == digest(small())
