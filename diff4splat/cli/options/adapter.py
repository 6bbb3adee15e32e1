"""``--lora``: a folder with what a stage taught the video model, checked before torch is loaded."""

from dataclasses import dataclass
from pathlib import Path

from diff4splat.errors import ConfigError
from diff4splat.models.config.tuning import ADAPTER_FILE


@dataclass(frozen=True, slots=True, kw_only=True)
class AdapterFolder:
    """A folder that a stage with ``tuning`` lora or adapters wrote."""

    def check(self, option: str, value: Path) -> None:
        """Refuse a folder without an adapter."""
        from diff4splat.io.require_file import is_file

        if is_file(value / ADAPTER_FILE):
            return
        got = "no folder" if not value.is_dir() else "a folder without one"
        raise ConfigError(
            f"{option} {value}: expected a folder with {ADAPTER_FILE}, got {got}; a "
            "video_diffusion stage with tuning lora or adapters writes RUN/STAGE/adapter"
        )


def require_video_model(lora: Path | None, model: str, fill: str | None) -> None:
    """Refuse an adapter where the video model would not run.

    Raises:
        ConfigError: the fill is not the video model's.
    """
    if lora is None:
        return
    from diff4splat.models.hub.folders import find_config

    used = fill or find_config(model).default_fill
    if used != "video":
        raise ConfigError(
            f"--lora: expected --fill video, which runs the video model, got {used}; add it"
        )
