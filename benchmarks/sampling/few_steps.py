"""What few evaluations of the video model give: hidden pixels, and the distribution of samples.

    python -m benchmarks.sampling.few_steps --student RUN/model --out few-steps.md

Worlds of ``benchmarks.sampling`` (training split, a seed that nobody trains on), with their
captions. Columns, over pixels and latent cells that the first frame hides:

    calls      evaluations of the network, both branches of guidance counted
    PSNR       decoded video against the true one; the mean of what is possible is best here
    distance   energy distance between generated and true latent cells, whitened by the true ones;
               a blur or too much contrast costs here. That of the truth with itself is below 0.

Axes: ``n`` cells, ``c`` channels.
"""

import argparse
import json
import statistics
from collections.abc import Sequence
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from benchmarks.sampling.scenes import kept_back
from benchmarks.sampling.video import Prepared, prepared
from diff4splat.flow.fitted import FittedSteps, integrate_fitted
from diff4splat.flow.guidance import DEFAULT_GUIDANCE, UNGUIDED, CallCount
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.video_sampling import (
    initial_noise,
    sample_video,
    video_velocity,
)
from diff4splat.io.atomic import write_text
from diff4splat.models.hub.model import Model, load_model
from diff4splat.training.latents.video_latents import image_video

CELLS = 3000
HEADER = (
    "| model | sampler | guidance | calls | PSNR [dB] | distance |\n|---|---|---:|---:|---:|---:|"
)
STEPS = (("euler", 25), ("multistep2", 8), ("euler", 4), ("multistep2", 4), ("euler", 1))
SETTINGS = tuple(
    GenerationSettings(steps=steps, sampler=sampler, schedule="uniform", guidance=guidance)
    for guidance in (UNGUIDED, DEFAULT_GUIDANCE)
    for sampler, steps in STEPS
)


def hidden_cells(clip: Prepared) -> Bool[Tensor, "1 t h w"]:
    """Latent cells of later frames of which the first frame hides most."""
    latent, validity = clip.conditions.render.latent, clip.conditions.render.validity
    frames = latent.shape[2]
    later = torch.nn.functional.adaptive_avg_pool3d(
        validity[:, :, 1:].float(), (frames - 1, *latent.shape[3:])
    )
    return torch.cat([torch.zeros_like(later[:, 0, :1]), 1 - later[:, 0]], 1) > 0.5


def hidden_psnr(model: Model, clip: Prepared, latent: Tensor) -> float | None:
    """None where nothing is hidden."""
    shown = image_video(model.networks.vae.decode(latent)).clamp(0, 1)
    hidden = clip.conditions.render.validity[:, 0] == 0
    hidden[:, 0] = False
    if not hidden.any():
        return None
    error = (shown - clip.truth)[hidden].square().mean()
    return float(-10 * error.clamp_min(1e-10).log10())


def energy_distance(one: Float[Tensor, "n c"], other: Float[Tensor, "m c"]) -> float:
    """2 E|X - Y| - E|X - X'| - E|Y - Y'|."""
    spread = [torch.cdist(a, a).sum() / (len(a) * (len(a) - 1)) for a in (one, other)]
    return float(2 * torch.cdist(one, other).mean() - spread[0] - spread[1])


def cells_of(latents: Sequence[Tensor], masks: Sequence[Tensor]) -> Float[Tensor, "n c"]:
    """At most ``CELLS`` hidden cells, evenly."""
    rows = [latent.movedim(1, -1)[mask] for latent, mask in zip(latents, masks, strict=True)]
    cells = torch.cat(rows)
    return cells[torch.linspace(0, len(cells) - 1, min(CELLS, len(cells))).long()]


class Table:
    """Rows over the same worlds."""

    def __init__(self, model: Model, worlds: int, seeds: int) -> None:
        self.model, self.seeds = model, seeds
        self.clips = prepared(model, kept_back(worlds))
        self.masks = [hidden_cells(clip) for clip in self.clips]
        vae = model.networks.vae
        self.truth = [vae.encode(clip.truth.movedim(-1, 1) * 2 - 1).mean for clip in self.clips]
        cells = cells_of(self.truth, self.masks)
        self.center, self.unit = cells.mean(0), cells.std(0)

    def row(self, name: str, latents: Sequence[Sequence[Tensor]], how: str) -> str:
        """Of samples per seed and world."""
        values = [
            hidden_psnr(self.model, clip, latent)
            for one in latents
            for clip, latent in zip(self.clips, one, strict=True)
        ]
        quality = statistics.fmean(value for value in values if value is not None)
        distance = statistics.fmean(self._distance(one) for one in latents)
        return f"| {name} | {how} | {quality:.2f} | {distance:.4f} |"

    def _distance(self, latents: Sequence[Tensor]) -> float:
        one, other = (cells_of(each, self.masks) for each in (latents, self.truth))
        return energy_distance((one - self.center) / self.unit, (other - self.center) / self.unit)

    def samples(self, model: Model, settings: GenerationSettings) -> tuple[list[list[Tensor]], int]:
        """Latents per seed and world, and calls per sample."""
        found, calls = [], 0
        for seed in range(self.seeds):
            row = []
            for number, clip in enumerate(self.clips):
                video = sample_video(
                    model.networks.dit, clip.conditions, settings, 100 * seed + number
                )
                row.append(video.latent)
                calls = video.calls.conditional + video.calls.unconditional
            found.append(row)
        return found, calls

    def fitted(self, steps: FittedSteps) -> tuple[list[list[Tensor]], int]:
        """The same with the sampler ``fitted``, under the guidance that it was fitted to."""
        found, calls = [], CallCount()
        for seed in range(self.seeds):
            row = []
            for number, clip in enumerate(self.clips):
                calls = CallCount()
                dit, given = self.model.networks.dit, clip.conditions
                velocity = video_velocity(dit, given, DEFAULT_GUIDANCE, calls)
                noise = initial_noise(given, 100 * seed + number)
                row.append(integrate_fitted(velocity, noise, steps))
            found.append(row)
        return found, calls.conditional + calls.unconditional


@torch.no_grad()
def main() -> None:
    """A row per sampler, and one for the student."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--student", nargs="*", default=[], help="model folders of few steps")
    parser.add_argument("--fitted", type=Path, help="JSON of benchmarks.sampling.fit_steps")
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True, help="markdown file")
    options = parser.parse_args()
    table = Table(load_model(options.model), options.worlds, options.seeds)
    lines = [HEADER]

    def add(line: str) -> None:
        lines.append(line)
        print(line, flush=True)

    add(table.row("truth", [table.truth], "autoencoder | | 0"))
    renders = [[clip.conditions.render.latent for clip in table.clips]]
    add(table.row("render condition", renders, " | | 0"))
    for student in options.student:
        settings = next(one for one in SETTINGS if (one.sampler, one.steps) == ("euler", 4))
        found, calls = table.samples(load_model(student), settings)
        add(table.row(Path(student).name, found, f"euler 4 | 1 | {calls}"))
    for settings in SETTINGS:
        found, calls = table.samples(table.model, settings)
        how = f"{settings.sampler} {settings.steps} | {settings.guidance.weight:g} | {calls}"
        add(table.row(options.model, found, how))
    if options.fitted:
        for one in json.loads(options.fitted.read_text()):
            rows = tuple(map(tuple, one["weights"]))
            steps = FittedSteps(levels=tuple(one["levels"]), weights=rows)
            found, calls = table.fitted(steps)
            how = f"fitted {len(steps.levels)} | {DEFAULT_GUIDANCE.weight:g} | {calls}"
            add(table.row(options.model, found, how))
    write_text(options.out, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
