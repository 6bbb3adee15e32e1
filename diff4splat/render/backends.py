"""The table of renderers. A back end is a module with ``refusal(job)`` and ``render(job)``.

To add one, write the module and name it here; nothing is imported before it is asked for.
"""

from importlib import import_module
from typing import Protocol, cast, runtime_checkable

from diff4splat.errors import ConfigError
from diff4splat.render.settings import RenderJob, RenderOutput

BACKENDS = {
    "gsplat": "diff4splat.render.gsplat_backend",
    "raster": "diff4splat.render.raster.backend",
    "reference": "diff4splat.render.reference",
}
"""Name to module, the preferred one first; ``reference`` stays last because it refuses nothing."""


@runtime_checkable
class Backend(Protocol):
    """What the module of a back end offers.

    It may also have ``open_sequence(scene, first_job)``, which gives a function of camera and time
    that draws frames of one scene with shared work, or None where it cannot.
    """

    def refusal(self, job: RenderJob) -> str | None:
        """Why ``job`` cannot be done here ("expected X, got Y"), or None."""
        ...

    def render(self, job: RenderJob) -> RenderOutput:
        """Make the pictures that ``job`` asks for."""
        ...


def choose(name: str, job: RenderJob) -> Backend:
    """The back end called ``name``, or with "auto" the first that can do ``job``.

    Raises:
        ConfigError: the name is unknown, or the back end refuses.
    """
    if name == "auto":
        return next(found for found in map(_load, BACKENDS) if found.refusal(job) is None)
    if name not in BACKENDS:
        raise ConfigError(f"backend: expected auto, {', '.join(BACKENDS)}, got {name!r}")
    found = _load(name)
    reason = found.refusal(job)
    if reason is not None:
        raise ConfigError(f"backend {name!r}: {reason}; use backend='auto'")
    return found


def _load(name: str) -> Backend:
    return cast(Backend, import_module(BACKENDS[name]))
