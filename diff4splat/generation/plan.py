"""Which networks one request needs, decided before any of them is loaded.

    depth prior          if the model has one and no depth is given, or LDRM runs and starts from
                         it; without any depth the image lies on a plane
    motion prior         if the model has one and a prompt asks for motion in words that it knows;
                         else the image is static
    object mask          with the motion prior
    image classifier     with the object mask, if the prompt has a noun that it knows
    text encoder         if a prompt is given and something takes it
    object shadow        with the motion prior
    image inpainting     if the image is larger than any copy that the networks see, and extended
                         layers are wanted
    VAE, DiT, LDRM       only where hidden regions are filled by the video model
    deformation          only where such a fill may move

What the plan leaves out is neither loaded nor run, and the card says why.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import Fill, ModelConfig
from diff4splat.models.hub.model import Model, parameter_counts
from diff4splat.models.networks import model_parts
from diff4splat.progress.run_log import RunLog

MOTION_PARTS = ("text_encoder", "motion_unet", "object_mask", "image_classifier", "object_shadow")
"""What a prompt that moves something needs; some models have the first two alone."""
FILL_PARTS = ("vae", "dit", "ldrm", "deformation")
"""What fills hidden regions by video; some public models also have an image encoder."""
WORSE_FILL = "with these weights it makes hidden regions worse; --fill video runs it"
DEPTH_GIVEN = "depth is given"
REMOVED = "it is left out on request"
CHOICES = (WORSE_FILL, DEPTH_GIVEN, REMOVED)
"""Reasons that are choices: the part would give another scene."""
NO_MOTION = "no prompt asks for motion"
NO_CLASS = "the prompt has no noun that it knows"
NO_PHOTOGRAPH = "the image is no larger than the copies that networks see"
NO_EXTENSION = "hidden regions stay empty"
UNTRAINED_FILL = "the video model is not trained"


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestFacts:
    """What a request has, before any file is read."""

    prompt: bool
    fill: Fill | None = None
    """None takes the model's default."""
    still: bool = False
    """Nothing may move."""
    frames: int = 2
    """Frames of the camera path as the networks see it."""
    depth_given: bool = False
    """Whether the request brings its depth along."""
    static_prompt: str = ""
    """Why a trained motion prior finds no motion in the prompt; empty where it may."""
    names_class: bool = False
    """Whether the prompt has a noun that the image classifier knows."""
    photograph: bool = False
    """Whether the image is larger than any copy that the networks see."""
    extended: bool = True
    """Whether layers extend the image into what it hides."""
    without: tuple[str, ...] = ()
    """Networks that stay out on request: ablations."""

    def removed(self, *parts: str) -> str:
        """The reason, if any of ``parts`` stays out on request; else empty."""
        return REMOVED if set(parts) & set(self.without) else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedPart:
    """A network that is neither loaded nor run."""

    part: str
    why: str
    changes_result: bool
    """Whether running it could change the scene."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GenerationPlan:
    """The networks that run, and why the others do not."""

    parts: frozenset[str]
    skipped: tuple[SkippedPart, ...]
    depth_given: bool = False

    @property
    def fills(self) -> bool:
        """Whether the video model fills what the image hides."""
        return "ldrm" in self.parts

    @property
    def moves(self) -> bool:
        """Whether the motion prior runs."""
        return "motion_unet" in self.parts

    @property
    def has_depth(self) -> bool:
        """Whether depth is predicted or given."""
        return self.depth_given or "monocular_depth" in self.parts

    @property
    def shows_image(self) -> bool:
        """Whether the image's own pixels are shown; else LDRM reconstructs every frame."""
        return self.has_depth or not self.fills

    def record(self, model: Model, log: RunLog) -> None:
        """Note what runs, and what is skipped with the weights that this saves."""
        log.networks.extend(part for part in model.parts if part in self.parts)
        counts = parameter_counts(model)
        for skipped in self.skipped:
            saved = f"{counts[skipped.part]:,} weights neither loaded nor run"
            error = None if skipped.changes_result else 0.0
            log.record_skipped(skipped.part, skipped.why, saved, error)


def plan_generation(
    config: ModelConfig, trained: Collection[str], facts: RequestFacts
) -> GenerationPlan:
    """The networks that this request needs.

    Raises:
        ConfigError: the video model is asked to fill, but it is not trained and other parts are.
    """
    fill = _fill_reason(config, trained, facts)
    # LDRM may start from the depth prior, wherever the depth of the image comes from.
    starts_ldrm = config.refinement.depth_prior and not fill
    reasons = {
        "monocular_depth": (DEPTH_GIVEN if facts.depth_given and not starts_ldrm else "")
        or _untrained("monocular_depth", trained)
        or facts.removed("monocular_depth"),
        "motion_unet": _untrained("motion_unet", trained)
        or facts.removed("motion_unet", "text_encoder")
        or _motion_reason(trained, facts)
        or ("the text encoder is not trained" if _untrained("text_encoder", trained) else ""),
    }
    reasons |= _with_motion(reasons["motion_unet"], trained, facts)
    reasons["image_inpainting"] = (
        _untrained("image_inpainting", trained)
        or facts.removed("image_inpainting")
        or ("" if facts.photograph else NO_PHOTOGRAPH)
        or ("" if facts.extended else NO_EXTENSION)
    )
    reasons |= dict.fromkeys((*FILL_PARTS, "image_encoder"), fill)
    if not fill:
        # Without the video model its condition is reconstructed as it is.
        reasons["dit"] = facts.removed("dit")
        reasons["deformation"] = facts.removed("deformation") or _deformation_reason(
            config, trained, facts
        )
    users = [part for part in ("motion_unet", "dit") if part in model_parts(config)]
    unread = "no network that runs takes text" if all(reasons[u] for u in users) else ""
    asked = unread or _untrained("text_encoder", trained) or facts.removed("text_encoder")
    # Models that pad prompts attend to the empty one where there is none.
    padded = bool(config.dit.padded_text_tokens) and not reasons["dit"]
    reasons["text_encoder"] = asked if facts.prompt or padded else "no prompt"
    parts = model_parts(config)
    skipped = [
        SkippedPart(part=part, why=reasons[part], changes_result=reasons[part] in CHOICES)
        for part in parts
        if reasons[part]
    ]
    running = frozenset(part for part in parts if not reasons[part])
    return GenerationPlan(parts=running, skipped=tuple(skipped), depth_given=facts.depth_given)


def _with_motion(motion: str, trained: Collection[str], facts: RequestFacts) -> dict[str, str]:
    """Of what only a motion prior asks for; ``motion`` is why that does not run."""
    mask, classifier, shadow = (
        motion or _untrained(part, trained) or facts.removed(part)
        for part in ("object_mask", "image_classifier", "object_shadow")
    )
    classifier = mask or classifier or ("" if facts.names_class else NO_CLASS)
    return {"object_mask": mask, "image_classifier": classifier, "object_shadow": shadow}


def _untrained(part: str, trained: Collection[str]) -> str:
    """Random models run whole; in others a part that is not trained stays out."""
    return "it is not trained" if trained and part not in trained else ""


def _motion_reason(trained: Collection[str], facts: RequestFacts) -> str:
    if facts.still:
        return "nothing may move"
    if facts.frames < 2:
        return "the camera path has one frame"
    if not facts.prompt:
        return NO_MOTION
    return facts.static_prompt if "motion_unet" in trained else ""


def _deformation_reason(config: ModelConfig, trained: Collection[str], facts: RequestFacts) -> str:
    """Without a motion prior, motion is the video model's alone, prompted or not."""
    if facts.still:
        return "nothing may move"
    one_frame = replace(facts, frames=max(facts.frames, 2))
    return _motion_reason(trained, one_frame) if config.motion_unet.used else ""


def _fill_reason(config: ModelConfig, trained: Collection[str], facts: RequestFacts) -> str:
    """Why the video model does not fill; empty where it does."""
    usable = not trained or set(FILL_PARTS) <= set(trained) or _is_imported(config, trained)
    if facts.fill == "video" and not usable:
        missing = ", ".join(sorted(set(FILL_PARTS) - set(trained)))
        raise ConfigError(
            f"--fill video: expected a trained video model, got {missing} untrained; "
            "train these parts or leave out --fill"
        )
    if facts.fill == "none":
        return "--fill none"
    if facts.removed("vae", "ldrm"):
        return REMOVED
    if not usable:
        return UNTRAINED_FILL
    wanted = facts.fill or config.default_fill
    return "" if wanted == "video" else WORSE_FILL


def _is_imported(config: ModelConfig, trained: Collection[str]) -> bool:
    """A public video model whose LDRM is fresh: what it adds is zero, which is the image."""
    return config.vae.layout != "plain" and {"vae", "dit"} <= set(trained)
