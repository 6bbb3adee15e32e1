"""``--device`` and ``--dtype``: where networks run and frames are rendered, and how exactly."""

from diff4splat.errors import ConfigError

KINDS = ("cpu", "cuda", "mps", "xpu")
AUTO = "auto"


def require_device(name: str) -> str:
    """Return ``name`` if PyTorch can compute there; ``auto`` is a CUDA device if there is one.

    Raises:
        ConfigError: no such device on this machine, or PyTorch was built without it.
    """
    import torch

    if name == AUTO:
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        if torch.device(name).type not in KINDS:
            raise ConfigError(f"--device: expected one of {', '.join(KINDS)}, got {name!r}")
        torch.zeros(1, device=name)
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        raise ConfigError(
            f"--device: expected a device that this PyTorch can use, got {name!r}; leave it out "
            "for the CPU"
        ) from error
    return name


def render_device(name: str) -> str:
    """Where frames are rendered: on a CUDA device that was asked for, else on the CPU.

    Other accelerators have no renderer of their own.

    Raises:
        ConfigError: as ``require_device``.
    """
    import torch

    found = require_device(name)
    return found if torch.device(found).type == "cuda" else "cpu"
