import json
import os
import subprocess
import sys
from hashlib import sha256

import numpy as np

from diff4splat.data_prep.synthetic.world import World
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world

GOLDEN = {
    "training 0": "caef8920ab9c52f9",
    "training 1": "915f676f5259f923",
    "training 2": "ecd68a235776d18e",
    "held_out 0": "3d12bc03863cf3d9",
    "held_out 1": "427b3423a9d17efc",
    "held_out 2": "b1191b5001226169",
}
PROGRAM = """
import json, sys
sys.path.insert(0, sys.argv[1])
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
        f"{split} {index}": digest(make_world(WorldRecipe(split=split, seed=1), index))
        for split in ("training", "held_out")
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
    folder = os.path.dirname(__file__)
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PROGRAM, folder],
        env=plain, capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    assert json.loads(done.stdout.splitlines()[-1]) == GOLDEN
