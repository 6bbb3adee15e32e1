"""Networks of a stage through ``torch.compile``: the same weights, fewer passes over memory.

What is compiled is the call of a module. Weights, averages and checkpoints do not notice; results
differ by rounding.
"""

import os
import shutil

from diff4splat.errors import ConfigError
from diff4splat.training.stage import Stage


def compile_networks(stage: Stage) -> None:
    """Compile what the stage says is worth it; it happens at the first call, in half a minute.

    Raises:
        ConfigError: there is no C++ compiler that PyTorch can use.
    """
    networks = stage.compilable()
    if networks:
        _require_compiler()
    for network in networks:
        network.compile()


def _require_compiler() -> None:
    compiler = os.environ.get("CXX", "g++")
    if shutil.which(compiler) is None:
        raise ConfigError(
            f"trainer.compile: expected a C++ compiler, got no {compiler}; install one, name it in "
            "CXX, or set trainer.compile=false"
        )
