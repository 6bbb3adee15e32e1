"""Model configurations of version 1, written before the priors were parts of their own.

Version 1 kept the depth prior in ``detail`` and the motion prior in ``dit``. Anything that does not
look like version 1 passes unchanged and is refused when the current version is read.
"""

from collections.abc import Mapping
from typing import Any

RENAMED: Mapping[str, Mapping[str, str]] = {
    "vae": {"linear_code": "pca_shortcut"},
    "text": {"buckets": "relative_position_buckets"},
    "dit": {"predicts": "prediction_type", "draft": "render_condition"},
    "ldrm": {"reads": "input"},
    "deformation": {"octaves": "time_frequencies", "noise_px": "static_threshold_px"},
    "refinement": {
        "width": "channels",
        "depths": "cost_volume_depths",
        "range": "depth_range",
        "surroundings": "border_cells",
    },
}
"""Section → old field → field of version 2."""

HEADS = 4
"""Of a motion prior that is absent; one that exists had as many as the video model."""


def upgrade_config(data: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of version 2 for those of version 1."""
    fresh = dict(data)
    refinement, dit = (_copy(fresh.pop(name, {})) for name in ("detail", "dit"))
    if not (isinstance(refinement, dict) and isinstance(dit, dict)):
        return dict(data)
    depth_channels = refinement.pop("picture_width", 0)
    motion_width = dit.pop("motion_width", 0)
    refiner_width = dit.pop("motion_outline", 0)
    dit.pop("motion", None)
    fresh |= {"refinement": refinement, "dit": dit}
    for section, names in RENAMED.items():
        if isinstance(fresh.get(section), Mapping):
            fresh[section] = {names.get(key, key): value for key, value in fresh[section].items()}
    fresh["monocular_depth"] = {"channels": depth_channels}
    fresh["motion_unet"] = {
        "width": motion_width,
        "heads": dit.get("heads", HEADS) if motion_width else HEADS,
        "mask_refiner_width": refiner_width,
    }
    # Version 1 never filled what one image hides where it had a depth prior.
    fresh["default_fill"] = "none" if depth_channels else "video"
    return fresh


def _copy(value: Any) -> Any:
    return dict(value) if isinstance(value, Mapping) else value
