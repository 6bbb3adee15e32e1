"""Which networks a request runs, for every kind of request and model, and why others do not."""

from dataclasses import replace

import pytest

from diff4splat.errors import ConfigError
from diff4splat.generation.plan import (
    FILL_PARTS,
    UNTRAINED_FILL,
    WORSE_FILL,
    GenerationPlan,
    RequestFacts,
    plan_generation,
)
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.factory import parameter_counts
from diff4splat.models.hub.model import Model
from diff4splat.models.networks import PARTS, model_parts
from diff4splat.progress.run_log import RunLog

VIDEO = frozenset(FILL_PARTS)
SHADOW = frozenset({"object_shadow"})
PRIORS = SHADOW | {"monocular_depth", "motion_unet", "object_mask", "text_encoder"}
DEPTH = frozenset({"monocular_depth"})
CLASSIFIER = frozenset({"image_classifier"})
INPAINTING = frozenset({"image_inpainting"})
TABLE = [
    # size, trained, request, parts that run
    ("small", PARTS, {"prompt": True}, PRIORS),
    ("small", PARTS, {"prompt": False}, DEPTH),
    ("small", PARTS, {"prompt": True, "still": True}, DEPTH),
    ("small", PARTS, {"prompt": True, "frames": 1}, DEPTH),
    ("small", PARTS, {"prompt": True, "static_prompt": "no word is known"}, DEPTH),
    ("small", (), {"prompt": True, "static_prompt": "no word is known"}, PRIORS),
    ("small", PARTS, {"prompt": True, "fill": "none"}, PRIORS),
    ("small", PARTS, {"prompt": True, "fill": "video"}, PRIORS | VIDEO),
    ("small", PARTS, {"prompt": False, "fill": "video"}, (DEPTH | VIDEO) - {"deformation"}),
    (
        "small",
        PARTS,
        {"prompt": True, "fill": "video", "still": True},
        (DEPTH | VIDEO | {"text_encoder"}) - {"deformation"},
    ),
    ("small", (), {"prompt": True}, PRIORS),
    ("small", PARTS, {"prompt": True, "names_class": True}, PRIORS | CLASSIFIER),
    ("small", PARTS, {"prompt": False, "names_class": True}, DEPTH),
    ("small", PARTS, {"prompt": False, "photograph": True}, DEPTH | INPAINTING),
    ("small", (), {"prompt": True, "photograph": True}, PRIORS | INPAINTING),
    ("small", PARTS, {"prompt": False, "photograph": True, "extended": False}, DEPTH),
    ("small", DEPTH, {"prompt": False, "photograph": True}, DEPTH),
    (
        "small",
        PARTS,
        {"prompt": False, "photograph": True, "without": ("image_inpainting",)},
        DEPTH,
    ),
    (
        "small",
        PARTS,
        {"prompt": True, "names_class": True, "without": ("image_classifier",)},
        PRIORS,
    ),
    (
        "small",
        PARTS,
        {"prompt": True, "names_class": True, "without": ("object_mask",)},
        PRIORS - {"object_mask"},
    ),
    ("small", (), {"prompt": True, "fill": "video"}, PRIORS | VIDEO),
    ("small", PARTS, {"prompt": True, "without": ("monocular_depth",)}, PRIORS - DEPTH),
    ("small", PARTS, {"prompt": True, "without": ("motion_unet",)}, DEPTH),
    ("small", PARTS, {"prompt": True, "without": ("object_shadow",)}, PRIORS - SHADOW),
    ("small", PARTS, {"prompt": True, "without": ("text_encoder",)}, DEPTH),
    ("small", PARTS, {"prompt": True, "without": ("object_mask",)}, PRIORS - {"object_mask"}),
    (
        "small",
        PARTS,
        {"prompt": True, "fill": "video", "without": ("dit",)},
        (PRIORS | VIDEO) - {"dit"},
    ),
    ("small", PARTS, {"prompt": True, "fill": "video", "without": ("vae", "ldrm")}, PRIORS),
    (
        "small",
        PARTS,
        {"prompt": True, "fill": "video", "without": ("deformation",)},
        (PRIORS | VIDEO) - {"deformation"},
    ),
    # LDRM starts from the depth prior, wherever the image's depth comes from.
    (
        "small",
        PARTS,
        {"prompt": True, "fill": "video", "depth_given": True},
        PRIORS | VIDEO,
    ),
    (
        "small",
        PARTS,
        {"prompt": True, "fill": "video", "depth_given": True, "without": ("monocular_depth",)},
        (PRIORS | VIDEO) - DEPTH,
    ),
    ("test", (), {"prompt": True, "without": ("dit",)}, VIDEO - {"dit"}),
    ("test", (), {"prompt": True, "without": ("text_encoder",)}, VIDEO),
    ("small", PRIORS, {"prompt": True}, PRIORS),
    ("small", DEPTH, {"prompt": True}, DEPTH),
    ("small", ("vae", "ldrm", "deformation"), {"prompt": True}, frozenset()),
    (
        "small",
        ("text_encoder", "motion_unet"),
        {"prompt": True},
        PRIORS - DEPTH - SHADOW - {"object_mask"},
    ),
    ("small", ("text_encoder", "object_mask"), {"prompt": True}, frozenset()),
    (
        "small",
        (*FILL_PARTS, "text_encoder"),
        {"prompt": True, "fill": "video"},
        VIDEO | {"text_encoder"},
    ),
    ("test", (), {"prompt": True}, VIDEO | {"text_encoder"}),
    ("test", (), {"prompt": False}, VIDEO),
    ("test", (), {"prompt": True, "fill": "none"}, frozenset()),
    ("test", PARTS, {"prompt": False, "still": True}, VIDEO - {"deformation"}),
    ("test", ("vae", "ldrm", "deformation"), {"prompt": True}, frozenset()),
    ("paper", (), {"prompt": True}, VIDEO | {"text_encoder"}),
    ("paper", PARTS, {"prompt": True, "fill": "none"}, frozenset()),
]
STILL = {"prompt": True, "still": True}
REASONS = [
    ({"prompt": False}, PARTS, "motion_unet", "no prompt asks for motion", 0.0),
    ({"prompt": False}, PARTS, "text_encoder", "no prompt", 0.0),
    (STILL, PARTS, "motion_unet", "nothing may move", 0.0),
    (STILL, PARTS, "object_mask", "nothing may move", 0.0),
    (
        {"prompt": True, "still": True},
        PARTS,
        "text_encoder",
        "no network that runs takes text",
        0.0,
    ),
    ({"prompt": True, "frames": 1}, PARTS, "motion_unet", "the camera path has one frame", 0.0),
    ({"prompt": True}, PARTS, "dit", WORSE_FILL, None),
    ({"prompt": True, "fill": "none"}, PARTS, "dit", "--fill none", 0.0),
    ({"prompt": True}, PRIORS, "ldrm", UNTRAINED_FILL, 0.0),
    ({"prompt": True}, ("vae",), "monocular_depth", "it is not trained", 0.0),
    (
        {"prompt": True, "still": True, "fill": "video"},
        PARTS,
        "deformation",
        "nothing may move",
        0.0,
    ),
]


def config(name: str = "small") -> ModelConfig:
    return size_by_name(name)


def planned(name: str, trained: tuple[str, ...], request: dict) -> GenerationPlan:
    return plan_generation(config(name), frozenset(trained), RequestFacts(**request))


@pytest.mark.parametrize(("name", "trained", "request_", "parts"), TABLE)
def test_these_networks_run(
    name: str, trained: tuple[str, ...], request_: dict, parts: frozenset[str]
) -> None:
    plan = planned(name, trained, request_)
    assert plan.parts == parts
    skipped = [part.part for part in plan.skipped]
    assert sorted([*skipped, *plan.parts]) == sorted(model_parts(config(name)))
    assert plan.fills == ("ldrm" in parts) and plan.moves == ("motion_unet" in parts)
    has_depth = "monocular_depth" in parts or request_.get("depth_given", False)
    assert plan.has_depth == has_depth
    assert plan.shows_image == (has_depth or "ldrm" not in parts)


@pytest.mark.parametrize(("request_", "trained", "part", "why", "error"), REASONS)
def test_the_log_says_why_a_network_does_not_run(
    request_: dict, trained: tuple[str, ...], part: str, why: str, error: float | None
) -> None:
    log = RunLog()
    planned("small", trained, request_).record(Model(config=config()), log)
    (entry,) = [entry for entry in log.skipped if entry.what == part]
    assert (entry.why, entry.error) == (why, error)
    assert entry.saved == f"{parameter_counts(config())[part]:,} weights neither loaded nor run"


def test_a_model_may_fill_by_default() -> None:
    filling = replace(config(), default_fill="video")
    plan = plan_generation(
        filling, PARTS, RequestFacts(prompt=True, names_class=True, photograph=True)
    )
    assert plan.parts == frozenset(model_parts(filling)) and plan.skipped == ()
    assert not plan_generation(filling, PARTS, RequestFacts(prompt=True, fill="none")).fills


@pytest.mark.parametrize("name", ["small", "test"])
def test_an_untrained_video_model_among_trained_parts_cannot_fill(name: str) -> None:
    with pytest.raises(ConfigError, match=r"--fill video: .* got deformation, dit untrained"):
        planned(name, ("vae", "ldrm"), {"prompt": True, "fill": "video"})


def test_the_default_never_refuses() -> None:
    for trained in [(), *((part,) for part in PARTS), PARTS]:
        for name in ("test", "small", "paper"):
            for fill in (None, "none"):
                planned(name, trained, {"prompt": True, "fill": fill})


@pytest.mark.parametrize("prompt", [True, False])
def test_an_imported_model_runs_with_a_fresh_ldrm_and_always_reads_text(prompt: bool) -> None:
    plain = config("test")
    imported = replace(
        plain,
        vae=replace(plain.vae, layout="wan2.1"),
        dit=replace(plain.dit, padded_text_tokens=512),
    )
    trained = frozenset({"vae", "text_encoder", "dit"})
    plan = plan_generation(imported, trained, RequestFacts(prompt=prompt, fill="video"))
    assert plan.parts == VIDEO | {"text_encoder"}
    still = plan_generation(imported, trained, RequestFacts(prompt=prompt, fill="none"))
    assert not still.fills
