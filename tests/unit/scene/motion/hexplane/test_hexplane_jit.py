"""How the kernels of the field are compiled, kept and spread over threads."""

import os
import subprocess
import sys
from threading import get_ident

import pytest
import torch

from diff4splat.scene.motion.hexplane import jit


def test_every_part_is_worked_on_once_and_errors_come_back() -> None:
    done: list[tuple[int, int]] = []
    before = torch.get_num_threads()
    try:
        for threads in (1, 3):
            torch.set_num_threads(threads)
            done.clear()
            jit.spread(lambda part: done.append((part, get_ident())), [(k,) for k in range(20)])
            assert sorted(part for part, _ in done) == list(range(20))
            assert len({thread for _, thread in done}) <= threads
            with pytest.raises(ZeroDivisionError):
                jit.spread(lambda part: 1 // part, [(1,), (0,), (2,)])
    finally:
        torch.set_num_threads(before)


def test_numba_is_loaded_by_the_first_compiled_features_and_not_before() -> None:
    code = (
        "import sys, torch\n"
        "from diff4splat.scene.motion.hexplane import motion, planes, regularisers\n"
        "from diff4splat.scene.motion import bake\n"
        "made = planes.make_planes(planes.HexPlaneSize(), torch.eye(3)[:2], (0.0, 1.0))\n"
        "made.to(torch.float64).features(torch.zeros(1, 3, dtype=torch.float64), 0.5)\n"
        "assert 'numba' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))
