"""``--device``: where networks run."""

from diff4splat.errors import ConfigError

KINDS = ("cpu", "cuda", "mps", "xpu")


def require_device(name: str) -> str:
    """Return ``name`` if PyTorch can compute there.

    Raises:
        ConfigError: no such device on this machine, or PyTorch was built without it.
    """
    import torch

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
