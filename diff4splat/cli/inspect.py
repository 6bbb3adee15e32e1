"""``diff4splat inspect``: contents of a scene, a model, or a network size."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class Inspect:
    """Show a scene file, the parameter counts of a network size, or which parts are trained."""

    scene: Annotated[Path | None, tyro.conf.Positional] = None
    """A scene file."""
    config: str | None = None
    """Network size: test, small or paper. No memory is allocated."""
    model: str | None = None
    """Model folder or size: trained parts, hash, licence and origin."""

    def run(self) -> None:
        """Print a table to standard output."""
        asked = ((self.scene, scene_lines), (self.config, size_lines), (self.model, model_lines))
        given = [(value, lines) for value, lines in asked if value is not None]
        if len(given) != 1:
            raise ConfigError(
                "inspect: expected one of a scene file, --config NAME and --model NAME, "
                f"got {len(given)}"
            )
        ((value, lines),) = given
        print("\n".join(lines(value)))


def size_lines(name: str) -> list[str]:
    """Parameters per network, counted on the meta device."""
    from diff4splat.models.config.sizes import size_by_name
    from diff4splat.models.factory import parameter_counts

    counts = parameter_counts(size_by_name(name))
    width = max(map(len, counts))
    rows = [f"{part:<{width}}  {count:>16,}" for part, count in counts.items()]
    return [
        f"{'network':<{width}}  {'parameters':>16}",
        *rows,
        f"{'total':<{width}}  {sum(counts.values()):>16,}",
    ]


def model_lines(name: str) -> list[str]:
    """Parts with their state; folder, hash, licence and origin of the weights."""
    from diff4splat.models.factory import parameter_counts
    from diff4splat.models.hub.model_info import model_info

    facts = model_info(name)
    counts = parameter_counts(facts.config)
    rows = [f"{part:<16}{count:>16,}  {facts.states[part]}" for part, count in counts.items()]
    properties = {
        "weights": facts.location,
        "weights_sha256": facts.weights_sha256,
        "license": facts.provenance.license,
        "origin": facts.provenance.origin,
    }
    return [
        f"{'network':<16}{'parameters':>16}  state",
        *rows,
        *(f"{key:<16}{value}" for key, value in properties.items()),
    ]


def scene_lines(file: Path) -> list[str]:
    """Counts, times, cameras and provenance of a scene file."""
    from dataclasses import asdict

    from diff4splat.io.scene_files.scene_file import load_scene
    from diff4splat.scene.extent import depth_range

    scene = load_scene(file)
    depths, (start_s, stop_s) = depth_range(scene), scene.motion.time_range_s
    height, width = scene.path.cameras.size_px
    facts = {
        "gaussians": f"{len(scene.gaussians):,}",
        "moving": f"{len(scene.motion.moving_index):,} ({type(scene.motion).__name__})",
        "harmonics": f"degree {scene.gaussians.degree}",
        "time": f"{start_s:g} to {stop_s:g} s",
        "dilation": f"{scene.dilation_px2:g} px²",
        "cameras": f"{len(scene.path)} of {width} by {height} px",
        "depth": f"near {depths.near:.3g}, median {depths.focus:.3g} scene units",
        **{key: str(value) for key, value in asdict(scene.provenance).items()},
    }
    return [f"{name:<16}{value}" for name, value in facts.items()]
