import json
import os
import subprocess
import sys
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from made_worlds import SPLITS, made_world

from diff4splat.data_prep.synthetic.world import World

GOLDEN = {
    "training 0": "be782fe49260ec9c",
    "training 1": "e38ad8f85b585104",
    "training 2": "49400fa1aeed0f65",
    "held_out 0": "a493b1c1d9fcb1c5",
    "held_out 1": "d55f2bed981e9c33",
    "held_out 2": "6aa18a7a12f2c651",
}
PROGRAM = """
import json, sys
sys.path[:0] = sys.argv[1:]
from test_world_determinism import digests
print(json.dumps(digests()))
"""


NOTE_FIELDS = ("identifier", "source", "license", "caption", "metric", "is_static", "objects")


def digest(made: World) -> str:
    """Of every number and word of a world; what clips learnt to say later is not among them."""
    note = asdict(made.note)
    for each in note["objects"]:
        del each["object_number"]
    total = sha256(repr({name: note[name] for name in NOTE_FIELDS}).encode())
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


@pytest.mark.slow
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
