"""Print the tables of docs/results/alignment.md: ``python -m benchmarks.alignment``."""

from collections.abc import Callable

import numpy as np

from benchmarks.alignment.scenes import SHAPE, Scene, make_scene
from diff4splat.data_prep.alignment.align_clip import metric_depth
from diff4splat.data_prep.alignment.disparity_fit import fit_disparity
from diff4splat.data_prep.alignment.other_fits import (
    grid_regions,
    least_squares,
    paper_depth_space,
    quantile_least_squares,
)
from diff4splat.data_prep.alignment.samples import (
    FitSamples,
    SampleSettings,
    candidate_pixels,
    choose_samples,
)

SEEDS = range(8)
FARTHEST = 655.0
CONTAMINATIONS = (("none", 0.0, 0.0), ("20 % sky", 0.2, 0.0), ("25 % moving", 0.0, 0.25))
CONTAMINATIONS += (("20 % sky, 25 % moving", 0.2, 0.25),)
SHIFTS = (0.0, 0.05, 0.3, -0.1)

Method = Callable[[Scene, FitSamples], np.ndarray]


def _line(fit: Callable[[FitSamples], tuple[float, float]]) -> Method:
    def depth(scene: Scene, samples: FitSamples) -> np.ndarray:
        return metric_depth(scene.disparity, *fit(samples), FARTHEST)

    return depth


def _robust(samples: FitSamples) -> tuple[float, float]:
    fit = fit_disparity(samples.disparity, samples.inverse_depth)
    return fit.scale, fit.shift


def _paper(scene: Scene, samples: FitSamples) -> np.ndarray:
    fit = paper_depth_space(samples, grid_regions(samples, SHAPE[1:]))
    return fit.scale / np.maximum(scene.disparity, 1e-6) + fit.shift


METHODS: dict[str, Method] = {
    "least squares": _line(least_squares),
    "10–90 % least squares": _line(quantile_least_squares),
    "paper's Algorithm 1, depth": _paper,
    "RANSAC + IRLS": _line(_robust),
}


def relative_errors(scene: Scene, masked: bool) -> list[float]:
    """Median |z − z_true| / z_true over uncontaminated pixels, per method."""
    settings = SampleSettings()
    excluded = scene.contaminated if masked else np.zeros(SHAPE, bool)
    candidates = candidate_pixels(scene.disparity, scene.reference, excluded, settings)
    samples = choose_samples(scene.disparity, scene.reference, candidates, settings)
    good = ~scene.contaminated & (scene.disparity > 0)
    return [
        float(np.median(np.abs(method(scene, samples)[good] / scene.depth[good] - 1)))
        for method in METHODS.values()
    ]


def _row(label: str, scenes: list[Scene], masked: bool) -> str:
    errors = np.array([relative_errors(scene, masked) for scene in scenes])
    cells = [f"{np.median(column):.1%} ({column.max():.1%})" for column in errors.T]
    return f"| {label} | {' | '.join(cells)} |"


def _table(title: str, rows: list[str]) -> str:
    header = f"| {title} | {' | '.join(METHODS)} |"
    return "\n".join([header, "|---" * (len(METHODS) + 1) + "|", *rows, ""])


def main() -> None:
    """Both tables: median over seeds, and the worst in brackets."""
    rows = [
        _row(f"{kind}, {name}{', masked' * masked}", scenes, masked)
        for kind in ("indoor", "outdoor")
        for name, sky, moving in CONTAMINATIONS
        for scenes in [[make_scene(kind, sky, moving, 0.1, seed) for seed in SEEDS]]
        for masked in ((False, True) if sky and moving else (False,))
    ]
    hazy = [make_scene("outdoor", 0.2, 0.25, 0.1, seed, 0.12) for seed in SEEDS]
    rows += [_row(f"outdoor, both, hazy sky{', masked' * m}", hazy, m) for m in (False, True)]
    print(_table("contamination", rows))
    rows = [
        _row(f"{shift:+.2f}", [make_scene("outdoor", 0, 0, shift, s) for s in SEEDS], False)
        for shift in SHIFTS
    ]
    print(_table("shift over median 1/z", rows))


if __name__ == "__main__":
    main()
