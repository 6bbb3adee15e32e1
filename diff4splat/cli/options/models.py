"""``--model``, ``--prompt`` and ``--features``, checked before torch is loaded."""

import sys
from dataclasses import dataclass
from pathlib import Path

from diff4splat.cli.options.constraints import InputPath
from diff4splat.errors import ConfigError

FEATURE_NETWORKS = ("vgg", "alex")


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelName:
    """A model folder, or the name of a size."""

    def check(self, option: str, value: str) -> None:
        """Refuse what is neither."""
        from diff4splat.models.config.sizes import size_by_name

        del option
        try:
            is_folder = Path(value).is_dir()
        except OSError:
            is_folder = False  # longer than any name
        if not is_folder:
            size_by_name(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureFiles:
    """Weights of a perceptual distance: ``vgg:FILE`` or ``alex:BACKBONE,HEADS``."""

    def check(self, option: str, value: str) -> None:
        """Refuse other forms, and files that are not there."""
        network, _, rest = value.partition(":")
        files = rest.split(",")
        if network not in FEATURE_NETWORKS or not all(files) or len(files) > 2:
            raise ConfigError(
                f"{option}: expected {' or '.join(f'{name}:FILE' for name in FEATURE_NETWORKS)}, "
                f"or two files joined by a comma, got {value!r}"
            )
        for file in files:
            InputPath(what="a file of weights", folder=False).check(option, Path(file))


def require_prompt_for(model: str, prompt: str) -> None:
    """Check a prompt for a model; only the model itself knows the limit if it is a folder.

    Raises:
        InputError: empty, not text, or too long.
    """
    from diff4splat.models.config.sizes import SIZES
    from diff4splat.models.text_encoder.prompt import require_prompt

    require_prompt(prompt, SIZES[model]().text.max_bytes if model in SIZES else sys.maxsize)


def prompt_notes(prompt: str | None, model: str) -> list[str]:
    """What a trained motion prior does not know of the prompt."""
    from diff4splat.captions.events import why_static
    from diff4splat.captions.known_words import read_prompt
    from diff4splat.models.hub.folders import find_provenance

    if prompt is None or "motion_unet" not in find_provenance(model).trained:
        return []
    if reason := why_static(prompt):
        return [f"nothing moves: {reason}; diff4splat inspect words lists what it knows"]
    unknown = ", ".join(read_prompt(prompt).unknown)
    return [f"words of the prompt that the model does not know: {unknown}"] if unknown else []


def require_runtime(model: str, runtime: str | None, device: str) -> None:
    """Check that the model folder holds what the runtime runs.

    Raises:
        ConfigError: graphs where weights are asked for, or the other way round, or not on a CPU.
    """
    from diff4splat.models.onnx.manifest import has_graphs

    graphs = has_graphs(Path(model))
    if runtime == "onnx" and not graphs:
        raise ConfigError(
            f"--runtime onnx: expected --model with a folder of ONNX graphs, got {model}; "
            f"write one with diff4splat export onnx --model {model} --out FOLDER"
        )
    if runtime == "torch" and graphs:
        raise ConfigError(
            f"--runtime torch: expected --model with PyTorch weights, got ONNX graphs in {model}; "
            "leave out --runtime, or name the model that was exported"
        )
    if graphs and device not in ("cpu", "auto"):
        raise ConfigError(f"--device: expected cpu for ONNX graphs, got {device}; use cpu")
