"""``diff4splat export onnx``: a model as ONNX graphs."""

from dataclasses import dataclass
from typing import Annotated, Literal

from diff4splat.cli.options.constraints import OutFolder
from diff4splat.cli.options.models import ModelName


@dataclass(frozen=True, kw_only=True)
class ExportOnnx:
    """Write every network of a model as ONNX graphs, with a manifest and a parity report.

    `diff4splat generate --model OUT` then runs them with ONNX Runtime.
    """

    out: OutFolder
    """Folder for the graphs."""
    model: Annotated[str, ModelName()] = "small"
    """Model folder, or a size: test, small or paper. A size takes its bundled weights, or random
    ones."""
    precision: Literal["float32", "float16", "int8", "int8-dynamic"] = "float32"
    """float16 and int8 store weights in a half and a quarter of the size; int8-dynamic also
    multiplies matrices in int8."""
    shapes_only: bool = False
    """Write graphs without weights; allocates nothing, so paper works on any machine."""
    triton: bool = False
    """Also write a model repository for Triton Inference Server: OUT/triton."""
    skip_parity: bool = False
    """Do not compare ONNX Runtime with PyTorch."""

    def run(self) -> None:
        """Export, compare, say where it is."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.limits.stopwatch import Stopwatch
        from diff4splat.cli.limits.tracing import promise
        from diff4splat.models.hub.model import load_model
        from diff4splat.models.onnx_export.export import require_exporter
        from diff4splat.models.onnx_export.folder import (
            ExportSettings,
            export_model,
            graph_names,
        )

        require_exporter()
        promised, watch = promise(self), Stopwatch.of_process()
        for line in promised.lines() if promised else ():
            note(line)
        settings = ExportSettings(
            precision=self.precision,
            shapes_only=self.shapes_only,
            parity=not self.skip_parity,
            triton=self.triton,
        )
        model = load_model(self.model, parts=())
        with ConsolePhases().phase("export graphs", len(graph_names(model))) as advance:
            rows = export_model(model, self.out, settings, advance)
        for row in rows:
            note(f"{row.graph}: relative error {max(row.errors.values()):.1e}")
        for line in promised.after(watch.read()) if promised else ():
            note(line)
        use = f"diff4splat generate PHOTO --model {self.out} runs it"
        note(
            f"wrote {self.out}; " + ("shapes alone, which cannot run" if self.shapes_only else use)
        )
