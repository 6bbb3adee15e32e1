"""The argument parser: every command and subcommand as types."""

from typing import Annotated

import tyro

from diff4splat.cli.calibration.all_reports import AllReports
from diff4splat.cli.calibration.calibrate import Calibrate
from diff4splat.cli.calibration.skipped import Skipped
from diff4splat.cli.datasets.prepare_curation import (
    PrepareAlign,
    PrepareCaptions,
    PrepareCurate,
    PreparePoses,
)
from diff4splat.cli.datasets.prepare_datasets import (
    PrepareDoctor,
    PrepareImport,
)
from diff4splat.cli.datasets.prepare_images import PrepareCutouts, PreparePanoramas
from diff4splat.cli.datasets.prepare_meshes import PrepareMeshCutouts, PrepareMeshes
from diff4splat.cli.datasets.prepare_pipeline import PreparePipeline
from diff4splat.cli.doctor import Doctor
from diff4splat.cli.evaluate import Evaluate
from diff4splat.cli.export_onnx import ExportOnnx
from diff4splat.cli.fit import Fit
from diff4splat.cli.generate import Generate
from diff4splat.cli.inspect import Inspect
from diff4splat.cli.limits.forecast import Forecasts, forecasts
from diff4splat.cli.models import GetModel, ListModels
from diff4splat.cli.pack import Pack
from diff4splat.cli.paths import ListPaths, PreviewPath
from diff4splat.cli.prepare import PrepareCheck, PrepareLatents, PrepareSynthetic
from diff4splat.cli.public_models.image_inpainting import AddInpainting
from diff4splat.cli.public_models.import_model import CheckModel, ImportModel
from diff4splat.cli.report import ErrorTime, ListKnobs, Stability
from diff4splat.cli.scenes.bake import Bake
from diff4splat.cli.scenes.convert import Convert
from diff4splat.cli.scenes.export_html import ExportHtml, View
from diff4splat.cli.scenes.reconstruct import Reconstruct
from diff4splat.cli.scenes.render import Render
from diff4splat.cli.serve import Serve
from diff4splat.cli.train import Train

subcommand = tyro.conf.subcommand
Paths = Annotated[PreviewPath, subcommand("preview")] | Annotated[ListPaths, subcommand("list")]
Models = (
    Annotated[ListModels, subcommand("list")]
    | Annotated[GetModel, subcommand("get")]
    | Annotated[ImportModel, subcommand("import")]
    | Annotated[CheckModel, subcommand("check")]
    | Annotated[AddInpainting, subcommand("inpainting")]
)
Prepare = (
    Annotated[PrepareSynthetic, subcommand("synth")]
    | Annotated[PrepareLatents, subcommand("latents")]
    | Annotated[PrepareImport, subcommand("import")]
    | Annotated[PrepareDoctor, subcommand("doctor")]
    | Annotated[PreparePanoramas, subcommand("panoramas")]
    | Annotated[PrepareCutouts, subcommand("cutouts")]
    | Annotated[PrepareMeshes, subcommand("meshes")]
    | Annotated[PrepareMeshCutouts, subcommand("mesh-cutouts")]
    | Annotated[PreparePoses, subcommand("poses")]
    | Annotated[PrepareAlign, subcommand("align")]
    | Annotated[PrepareCaptions, subcommand("captions")]
    | Annotated[PrepareCurate, subcommand("curate")]
    | Annotated[PreparePipeline, subcommand("pipeline")]
    | Annotated[PrepareCheck, subcommand("check")]
)
Export = Annotated[ExportHtml, subcommand("html")] | Annotated[ExportOnnx, subcommand("onnx")]
Report = (
    Annotated[AllReports, subcommand("all")]
    | Annotated[ErrorTime, subcommand("error-time")]
    | Annotated[ListKnobs, subcommand("knobs")]
    | Annotated[Stability, subcommand("stability")]
    | Annotated[Calibrate, subcommand("calibrate")]
    | Annotated[Skipped, subcommand("skipped")]
)
Command = (
    Annotated[Generate, subcommand("generate")]
    | Annotated[Reconstruct, subcommand("reconstruct")]
    | Annotated[Fit, subcommand("fit")]
    | Annotated[Render, subcommand("render")]
    | Annotated[Bake, subcommand("bake")]
    | Annotated[Convert, subcommand("convert")]
    | Annotated[Export, subcommand("export", description="Scenes and models for other programs.")]
    | Annotated[View, subcommand("view")]
    | Annotated[Serve, subcommand("serve")]
    | Annotated[Paths, subcommand("paths", description="Camera paths: list and draw them.")]
    | Annotated[Models, subcommand("models", description="Public models: list, get, import.")]
    | Annotated[Inspect, subcommand("inspect")]
    | Annotated[Forecasts, subcommand("forecast")]
    | Annotated[
        Report, subcommand("report", description="Error against run time; stability; calibration.")
    ]
    | Annotated[Prepare, subcommand("prepare", description="Training clips: make, import, check.")]
    | Annotated[Train, subcommand("train")]
    | Annotated[Pack, subcommand("pack")]
    | Annotated[Evaluate, subcommand("eval")]
    | Annotated[Doctor, subcommand("doctor")]
)


def parse(arguments: list[str]) -> Command:
    """The command that ``arguments`` name, with its options; help and bad usage exit."""
    if arguments[:1] == ["forecast"] and not {"-h", "--help"} & set(arguments[1:2]):
        # What follows belongs to another command.
        return forecasts(arguments[1:])
    return tyro.cli(
        Command,
        prog="diff4splat",
        description="One image, a camera path and optional text to an explicit 4D Gaussian scene. "
        "`diff4splat --version` prints the version.",
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff),
    )
