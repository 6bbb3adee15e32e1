"""``--depth`` and ``--depth-kind``, checked before torch is loaded."""

from dataclasses import dataclass
from pathlib import Path

from diff4splat.cli.options.constraints import InputPath
from diff4splat.errors import ConfigError

SUFFIXES = (".onnx", ".exr", ".png", ".npy")
STATED = (".onnx", ".exr")
"""Formats that can say what their numbers are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthFileOrName:
    """A file, or the name of a network in the cache."""

    def check(self, option: str, value: Path) -> None:
        """Refuse what is neither."""
        what = "a depth network or map, or a name of `models list`"
        InputPath(what=what, folder=False).check(option, depth_file(value))


def depth_file(depth: Path) -> Path:
    """The file that ``--depth`` names; names of the catalogue stand for their copy in the cache.

    Raises:
        ConfigError: a network of the catalogue that was not downloaded.
    """
    from diff4splat.models.registry.cache import cached_graph
    from diff4splat.models.registry.catalog import CATALOG

    for model in CATALOG:
        if str(depth) == model.name and not depth.exists():
            return cached_graph(model)
    return depth


def require_depth_kind(depth: Path | None, kind: str | None) -> None:
    """Check that a depth file has a kind where its format has none, and the other way round.

    Raises:
        ConfigError: one without the other, or another ending.
    """
    if depth is None:
        if kind is not None:
            raise ConfigError("--depth-kind: expected --depth too, got none; leave it out")
        return
    suffix = depth_file(depth).suffix.lower()
    if suffix not in SUFFIXES:
        raise ConfigError(f"--depth: expected a name ending in {', '.join(SUFFIXES)}, got {depth}")
    if suffix not in STATED and kind is None:
        raise ConfigError(
            f"--depth-kind: expected one for {depth.name}, since numbers in {suffix} can mean "
            "anything, got none; metric, millimetres, relative or distance where near is small, "
            "disparity or inverse where near is large"
        )


def require_one_photo(depth: Path | None) -> None:
    """A map belongs to one photo; a network takes any.

    Raises:
        ConfigError: a map for several photos.
    """
    if depth is not None and depth_file(depth).suffix.lower() != ".onnx":
        raise ConfigError(
            f"--depth: expected one photo for the map {depth}, got several; generate them one by "
            "one, or give a network (.onnx)"
        )
