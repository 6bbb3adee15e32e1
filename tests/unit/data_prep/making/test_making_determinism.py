import json
import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import numpy as np
from made_worlds import SPLITS, made_world

from diff4splat.data_prep.synthetic.world import World

GOLDEN = {
    "training 0": "7e6f1c56d947ad09",
    "training 1": "4e731266f3de1768",
    "training 2": "5a28cb4c4141c2b2",
    "held_out 0": "3a70b730c4f74d48",
    "held_out 1": "10347ba603c0cf7e",
    "held_out 2": "b94cf6c6187dc586",
}
PROGRAM = """
import json, sys
sys.path[:0] = sys.argv[1:]
from test_making_determinism import digests
print(json.dumps(digests()))
"""


def digest(made: World) -> str:
    """Of every number and word of a world."""
    total = sha256(repr(made.note).encode())
    arrays = [made.times_s, made.light.color, made.light.toward, made.light.sky, made.light.ground]
    arrays += [made.sky.zenith, made.sky.horizon]
    numbers = [made.light.softness, made.sky.clouds, made.sky.haze_per_m, made.sky.seed]
    for thing in made.objects:
        look = thing.texture
        arrays += [
            thing.positions,
            thing.mesh.rest,
            thing.mesh.uv,
            thing.mesh.triangles,
            look.colors,
        ]
        numbers += [look.family, look.scale, look.seed, look.solid, look.relief, look.gloss]
    for view in made.views:
        arrays += [t.numpy() for t in (view.focal_px, view.center_px, view.world_from_camera)]
    for array in arrays:
        total.update(np.ascontiguousarray(array).tobytes())
    total.update(repr(numbers).encode())
    return total.hexdigest()[:16]


def digests() -> dict[str, str]:
    return {
        f"{split} {index}": digest(made_world(split, index))
        for split in SPLITS
        for index in range(3)
    }


def test_worlds_are_what_they_have_always_been() -> None:
    assert digests() == GOLDEN


def test_other_processors_make_the_same_worlds() -> None:
    plain = {
        **os.environ,
        "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX",
        "ATEN_CPU_CAPABILITY": "default",
        "OPENBLAS_CORETYPE": "Nehalem",
        "MKL_ENABLE_INSTRUCTIONS": "SSE4_2",
    }
    here = Path(__file__).parent
    folders = [str(here), str(here.parents[2] / "support")]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PROGRAM, *folders],
        env=plain, capture_output=True, text=True, check=True, timeout=600,
    )  # fmt: skip
    assert json.loads(done.stdout.splitlines()[-1]) == GOLDEN
