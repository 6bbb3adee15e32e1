"""``diff4splat inspect``: contents of a scene, a model, or a network size."""

from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Annotated

import tyro

from diff4splat.cli.options.constraints import InputPath
from diff4splat.cli.options.models import ModelName
from diff4splat.errors import ConfigError

WORDS = "words"


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOrWords:
    """A scene file, or the word for the list of words."""

    def check(self, option: str, value: Path) -> None:
        """Refuse what is neither."""
        if not is_words(value):
            InputPath(what="a scene file", folder=False).check(option, value)


def is_words(given: Path | None) -> bool:
    """Whether the list of words is asked for, and no file of that name."""
    return given == Path(WORDS) and not given.exists()


@dataclass(frozen=True, kw_only=True)
class Inspect:
    """Show a scene file, the words of prompts, a network size, or the parts of a model."""

    scene: Annotated[Path | None, tyro.conf.Positional, SceneOrWords()] = None
    """A scene file, or `words`: the words that prompts may have."""
    config: str | None = None
    """Network size: test, small or paper. No memory is allocated."""
    model: Annotated[str | None, ModelName()] = None
    """Model folder or size: trained parts, hash, licence and origin."""

    def check(self) -> None:
        """Require exactly one thing to show, and a size that there is."""
        from diff4splat.models.config.sizes import size_by_name

        count = 3 - (self.scene, self.config, self.model).count(None)
        if count != 1:
            raise ConfigError(
                "inspect: expected one of a scene file, --config NAME and --model NAME, "
                f"got {count}"
            )
        if self.config is not None:
            size_by_name(self.config)

    def run(self) -> None:
        """Print a table to standard output."""
        from diff4splat.progress.plain_text import plain_text

        lines_of = word_lines if is_words(self.scene) else scene_lines
        asked = ((self.scene, lines_of), (self.config, size_lines), (self.model, model_lines))
        ((value, lines),) = [(value, lines) for value, lines in asked if value is not None]
        print("\n".join(map(plain_text, lines(value))))


def word_lines(_: Path) -> list[str]:
    """What the motion prior knows, by kind."""
    from diff4splat.captions.image_classes.class_nouns import classes_of_nouns
    from diff4splat.captions.known_words import known_words

    lists = (f"{kind:<12}{', '.join(words)}" for kind, words in known_words().items())
    lines = [part for line in lists for part in wrap(line, 100, subsequent_indent=12 * " ")]
    example = "the red car moves to the left"
    count = len(classes_of_nouns())
    return [
        *lines,
        f"{count:,} nouns of ImageNet's classes count as objects, too: kangaroo, teapot",
        f"A prompt names an object or a colour, and a motion or a direction: {example}",
    ]


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
        "depth": f"near {depths.near:.3g}, focus {depths.focus:.3g} scene units",
        **{key: str(value) for key, value in asdict(scene.provenance).items()},
    }
    return [f"{name:<16}{value}" for name, value in facts.items()]
