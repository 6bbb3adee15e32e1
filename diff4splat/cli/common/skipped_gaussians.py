"""Report of the Gaussians that no back end can render."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from diff4splat.scene.scene import Scene


def skipped_gaussians(scene: "Scene", time_s: float) -> str | None:
    """One line with the number of invalid Gaussians at ``time_s`` and the reason, or None."""
    from diff4splat.render.support import renderable_gaussians

    _, dropped = renderable_gaussians(scene.state_at(time_s))
    if not dropped:
        return None
    parts = ", ".join(f"{count:,} with {name}" for name, count in dropped.items())
    return (
        f"{sum(dropped.values()):,} Gaussians left out of the first frame: "
        f"{parts} that are not finite or too large"
    )
