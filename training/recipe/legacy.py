"""Recipes of the first release, whose JSON has no version key, as those of this release.

Upgrading renames keys and kinds, keeps the names of stages (folders and random draws follow from
them), and keeps of the loss weights those that a stage's kind uses. Stages of kinds that no longer
exist are left out and listed in ``removed_stages``.
"""

from collections.abc import Mapping
from typing import Any

KINDS = {
    "sight": "posed_video_pretrain",
    "depth": "monocular_depth",
    "branch": "motion_diffusion",
    "generator": "video_diffusion",
}
REMOVED_KINDS = ("told", "generated")
TRAINED = {"depth": ("monocular_depth",), "branch": ("motion_unet",)}
"""What kinds train that are parts of their own now."""
STAGE_KEYS = {
    "true_pictures": "use_ground_truth_frames",
    "single_share": "single_image_probability",
    "vary_captions": "augment_captions",
    "level_shift": "timestep_shift",
}
DATA_KEYS = {
    "moments": "keyframes_only",
    "moving_targets": "supervise_motion",
    "least_depth_share": "min_valid_depth",
    "track_stride": "keyframe_stride",
}
LOSS_DEFAULTS = {
    "flow": 1.0,
    "flow_level": 0.0,
    "flow_motion": 1.0,
    "moves": 0.0,
    "flow_energy": 0.0,
    "photometric": 1.0,
    "perceptual": 0.5,
    "depth": 0.5,
    "depth_log": 0.0,
    "depth_edges": 0.0,
    "depth_shift": 0.0,
    "sky": 0.0,
    "smoothness": 0.1,
    "motion": 2.0,
    "motion_distance": 2.0,
    "motion_size": 1.0,
    "motion_width": 0.0,
    "divergence": 1e-4,
}
"""Every key of the one class of weights that all kinds shared."""
_FLOW = {"flow": "flow", "flow_level": "min_level_weighting"}
_VIDEO_FLOW = _FLOW | {"flow_energy": "channel_power_exponent"}
_RECONSTRUCTION = {
    key: key for key in ("photometric", "perceptual", "depth", "depth_log", "smoothness")
}
_MOTION = {
    "motion": "weight",
    "motion_distance": "distance",
    "motion_size": "displacement_l1",
    "motion_width": "huber_delta",
}
LOSS_KEYS: Mapping[str, Mapping[str, Any]] = {
    "vae": {"photometric": "photometric", "perceptual": "perceptual", "divergence": "kl"},
    "posed_video_pretrain": _RECONSTRUCTION,
    "static": _RECONSTRUCTION,
    "motion": _MOTION,
    "dynamic": {"reconstruction": _RECONSTRUCTION, "motion": _MOTION},
    "monocular_depth": {
        "depth_log": "depth_log",
        "depth_edges": "depth_gradient",
        "depth_shift": "inverse_depth",
        "sky": "sky_margin",
    },
    "motion_diffusion": _FLOW | {"moves": "motion_mask"},
    "video_diffusion": _VIDEO_FLOW,
    "joint": {"flow": _VIDEO_FLOW, "reconstruction": _RECONSTRUCTION, "motion": _MOTION},
}
"""For each kind the new key of each weight; groups of weights by the new key of the group."""


def upgraded(recipe: Mapping[str, Any]) -> dict[str, Any]:
    """A recipe of the first release in the keys of this one.

    Values that are not what they should be are passed on, for the reader to refuse.
    """
    stages = recipe.get("stages")
    if not isinstance(stages, list) or not all(isinstance(stage, dict) for stage in stages):
        return dict(recipe)
    removed = [stage.get("name") for stage in stages if stage.get("kind") in REMOVED_KINDS]
    kept = [upgraded_stage(stage) for stage in stages if stage.get("kind") not in REMOVED_KINDS]
    return {**recipe, "stages": kept} | ({"removed_stages": removed} if removed else {})


def upgraded_stage(stage: Mapping[str, Any]) -> dict[str, Any]:
    """One stage of such a recipe."""
    found = _renamed(stage, STAGE_KEYS)
    found["kind"] = KINDS.get(str(stage.get("kind")), stage.get("kind"))
    if (trained := TRAINED.get(str(stage.get("kind")))) is not None:
        found["trained"] = list(trained)
    if isinstance(stage.get("data"), dict):
        found["data"] = _renamed(stage["data"], DATA_KEYS)
    losses = stage.get("losses", {})
    keys = LOSS_KEYS.get(str(found["kind"]))
    if isinstance(losses, dict) and keys is not None:
        unknown = {key: value for key, value in losses.items() if key not in LOSS_DEFAULTS}
        chosen = _chosen(LOSS_DEFAULTS | losses, keys)
        found["losses"] = chosen | unknown
    return found


def _renamed(values: Mapping[str, Any], keys: Mapping[str, str]) -> dict[str, Any]:
    return {keys.get(key, key): value for key, value in values.items()}


def _chosen(values: Mapping[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """The weights that ``keys`` names, in its groups."""
    found = {}
    for key, new in keys.items():
        if isinstance(new, Mapping):
            found[key] = _chosen(values, new)
        else:
            found[new] = values[key]
    return found
