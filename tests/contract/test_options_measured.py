"""Every option that changes a result is measured in a report, or is what a user asks for."""

from dataclasses import fields

import pytest

from diff4splat.cli.export_onnx import ExportOnnx
from diff4splat.cli.fit import Fit
from diff4splat.cli.generate import Generate
from diff4splat.cli.scenes.bake import Bake
from diff4splat.cli.scenes.convert import Convert
from diff4splat.cli.scenes.export_html import ExportHtml
from diff4splat.cli.scenes.reconstruct import Reconstruct
from diff4splat.cli.scenes.render import Render
from diff4splat.error_time.known_knobs import known_knobs

COMMANDS = (Generate, Reconstruct, Render, Bake, ExportHtml, ExportOnnx, Fit, Convert)
MEASURED = {
    "Generate.resolution": "network-resolution",
    "Generate.runtime": "runtime",
    "Generate.steps": "video-sampling",
    "Generate.sampler": "video-sampling",
    "Generate.latent_tolerance": "video-sampling",
    "Generate.shift": "video-shift",
    "Generate.guidance": "video-guidance",
    "Generate.color_matching_steps": "color-matching",
    "Generate.infill": "subpixel-infill",
    "Generate.min_opacity": "fill-pruning",
    "Generate.compression": "scene-compression",
    "Generate.dtype": "precision-dit",
    "Reconstruct.compression": "scene-compression",
    "Bake.tolerance_px": "bake-tolerance",
    "Bake.keys": "bake-tolerance",
    "ExportOnnx.precision": "runtime",
    "Fit.budget": "fit-budget",
    "Fit.steps": "fit-steps",
    "Fit.compression": "scene-compression",
    "Convert.compression": "scene-compression",
    "Convert.bake": "bake-tolerance",
}
"""Option to the setting of ``report error-time`` that measures it."""
ASKED, WHERE = "what is asked for: another result, not a coarser one", "where things are"
LIMITS = "chooses among measured settings"
CHOICES = {
    ASKED: (
        *(
            "Generate.camera",
            "Generate.prompt",
            "Generate.options",
            "Generate.seed",
            "Generate.fit",
        ),
        *("Generate.fov", "Generate.fill", "Generate.still", "Generate.negative_prompt"),
        *("Generate.model", "Generate.depth_kind", "Generate.convert", "Generate.skip_depth"),
        *("Render.camera", "Render.time", "Render.frame", "Render.resolution", "Render.options"),
        *("Render.optics", "Fit.motion", "Fit.options", "Fit.minutes", "Fit.no_depth"),
        *("Fit.learn", "Fit.seed", "Fit.set", "Convert.time", "Convert.fps", "Convert.time_range"),
        *("Convert.target", "Convert.spz_version", "ExportOnnx.model", "ExportOnnx.shapes_only"),
        *("ExportOnnx.triton", "ExportOnnx.skip_parity", "Generate.video", "Generate.ply"),
        *("Generate.lora", "Render.dtype", "Fit.dtype"),
        *("Reconstruct.camera", "Reconstruct.frames", "Reconstruct.resolution"),
        *("Reconstruct.median_depth", "Reconstruct.photometric_steps", "Reconstruct.model"),
        "Reconstruct.options",
    ),
    WHERE: (
        *("Generate.images", "Generate.out", "Generate.depth", "Generate.device", "Render.scene"),
        *("Render.out", "Render.dataset", "Render.device", "Bake.scene", "Bake.out"),
        *("ExportHtml.scene", "ExportHtml.out", "ExportOnnx.out", "Fit.data", "Fit.out"),
        *("Fit.init", "Fit.renderer", "Fit.live", "Fit.restart", "Convert.scene", "Convert.out"),
        *("Fit.device", "Reconstruct.data", "Reconstruct.out", "Reconstruct.device"),
    ),
    LIMITS: ("Generate.limits", "Render.limits", "Bake.limits", "ExportHtml.limits"),
}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.__name__)
def test_every_option_is_measured_or_asked_for(command: type) -> None:
    asked = {name for names in CHOICES.values() for name in names}
    for field in fields(command):
        name = f"{command.__name__}.{field.name}"
        assert (name in MEASURED) != (name in asked), (
            f"{name}: expected a setting of the report that measures it, or a reason"
        )


def test_what_is_named_exists() -> None:
    options = {f"{one.__name__}.{field.name}" for one in COMMANDS for field in fields(one)}
    assert {*MEASURED, *(name for names in CHOICES.values() for name in names)} <= options
    assert set(MEASURED.values()) <= {knob.name for knob in known_knobs()}
