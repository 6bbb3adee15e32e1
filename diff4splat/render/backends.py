"""The table of renderers.

A back end is a module with ``unsupported_reason(job)`` and ``render(job)``. To add one, write the
module and name it here. A back end is imported when it is first chosen.
"""

import warnings
from importlib import import_module
from typing import Protocol, cast, runtime_checkable

from diff4splat.errors import ConfigError
from diff4splat.render.settings import RenderJob, RenderOutput

BACKENDS = {
    "gsplat": "diff4splat.render.gsplat.backend",
    "raster": "diff4splat.render.raster.backend",
    "reference": "diff4splat.render.reference",
}
"""Name to module, the preferred one first; ``reference`` stays last because it refuses nothing."""


@runtime_checkable
class Backend(Protocol):
    """What the module of a back end offers.

    It may also have ``open_sequence(scene, first_job)``, which gives a function of camera and time
    that draws frames of one scene with shared work, or None where it cannot. And
    ``open_view(job)``, which gives a function of harmonics that draws one view in these colours.
    """

    def unsupported_reason(self, job: RenderJob) -> str | None:
        """Why ``job`` cannot be done here ("expected X, got Y"), or None."""
        ...

    def render(self, job: RenderJob) -> RenderOutput:
        """Make the images that ``job`` asks for."""
        ...


def choose(name: str, job: RenderJob) -> Backend:
    """The back end called ``name``, or with "auto" the first that can do ``job``.

    Raises:
        ConfigError: the name is unknown, or the back end refuses.
    """
    if name == "auto":
        return _first(job)
    if name not in BACKENDS:
        raise ConfigError(f"backend: expected auto, {', '.join(BACKENDS)}, got {name!r}")
    found = _load(name)
    reason = found.unsupported_reason(job)
    if reason is not None:
        raise ConfigError(f"backend {name!r}: {reason}; use backend='auto'")
    return found


def _first(job: RenderJob) -> Backend:
    """The preferred one of those that do not refuse; says why it is a slow one on a GPU."""
    reasons = []
    for name in BACKENDS:
        found = _load(name)
        reason = found.unsupported_reason(job)
        if reason is None:
            break
        reasons.append(f"{name}: {reason}")
    if job.gaussians.means.is_cuda and name == "reference" and reasons:
        warnings.warn(f"rendering with the slow reference; {reasons[0]}", stacklevel=4)
    return found


def _load(name: str) -> Backend:
    return cast(Backend, import_module(BACKENDS[name]))
