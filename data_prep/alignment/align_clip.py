"""A clip with metric depth out of relative disparity and a reference.

Axes: ``t`` frames, ``h w`` pixels. Lengths of the clip (poses, tracks) are multiplied by the factor
of the reference alone. The shift of disparity is never applied to positions.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float

from diff4splat.data.clip import Clip, View
from diff4splat.data.scale_record import ScaleRecord
from diff4splat.data_prep.alignment.disparity_fit import (
    DisparityFit,
    FitSettings,
    described_fit,
    fit_disparity,
)
from diff4splat.data_prep.alignment.gates import AlignmentGates, refused_because
from diff4splat.data_prep.alignment.other_fits import (
    DepthFit,
    grid_regions,
    least_squares,
    paper_depth_space,
)
from diff4splat.data_prep.alignment.references.reference import Reference
from diff4splat.data_prep.alignment.samples import (
    FitSamples,
    SampleSettings,
    candidate_pixels,
    choose_samples,
)
from diff4splat.data_prep.alignment.scaling import scaled_clip
from diff4splat.errors import InputError

Method = Literal["disparity", "paper_depth_space", "least_squares"]
"""RANSAC and reweighting in disparity; the paper's Algorithm 1 read literally; for comparison."""
_NAMES = {"disparity": "disparity ransac irls", "least_squares": "disparity least squares"}


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentSettings:
    """How depth is fitted, accepted and cut off."""

    method: Method = "disparity"
    samples: SampleSettings = field(default_factory=SampleSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    gates: AlignmentGates = field(default_factory=AlignmentGates)
    farthest: float = 655.0
    """Depth beyond is 0, no depth: there the line says nothing any more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """The clip as it became, and whether it may be used."""

    clip: Clip
    refused: tuple[str, ...]
    """Reasons; none if every gate is passed."""


def align_clip(
    clip: Clip,
    disparity: Float[np.ndarray, "t h2 w2"],
    reference: Reference,
    settings: AlignmentSettings | None = None,
) -> Alignment:
    """Fit the disparity of the input view to ``reference`` and give the view its depth.

    Raises:
        InputError: other frames than the clip has, or too few samples for a fit.
    """
    settings = _in_units_of(reference, settings or AlignmentSettings())
    view = clip.views[0]
    relative = fitted_size(disparity, (clip.frames, *clip.size_px))
    candidates = candidate_pixels(relative, reference.depth, _excluded(view), settings.samples)
    samples = choose_samples(relative, reference.depth, candidates, settings.samples)
    depth, scale, refused = _fitted(relative, samples, settings)
    depth = np.where(_sky(view), 0, depth).astype(np.float32)
    scale = replace(
        scale,
        factor=reference.factor,
        normaliser=reference.normaliser,
        reference=reference.name,
    )
    aligned = scaled_clip(clip, reference.factor)
    first = replace(aligned.views[0], depth=torch.from_numpy(depth))
    note = replace(clip.note, metric=reference.metric, scale=scale)
    return Alignment(
        clip=replace(aligned, note=note, views=(first, *aligned.views[1:])), refused=refused
    )


def fitted_size(
    maps: Float[np.ndarray, "t h2 w2"], shape: tuple[int, int, int]
) -> Float[np.ndarray, "t h w"]:
    """Maps of another size, resampled to that of the clip; frames must be as many.

    Raises:
        InputError: another number of frames.
    """
    if maps.ndim != 3 or len(maps) != shape[0] or not maps.size:
        raise InputError(
            f"disparity: expected {shape[0]} frames like the clip, got shape {maps.shape}; it may "
            "be of another clip, or cut otherwise"
        )
    if maps.shape == shape:
        return np.asarray(maps, np.float32)
    size = (shape[2], shape[1])
    frames = [np.asarray(each, np.float32) for each in maps]
    return np.stack([cv2.resize(each, size, interpolation=cv2.INTER_LINEAR) for each in frames])


def _in_units_of(reference: Reference, settings: AlignmentSettings) -> AlignmentSettings:
    """Limits in metres mean nothing where lengths have no unit; the median depth stands in."""
    known = reference.depth[reference.depth > 0]
    if reference.metric != "none" or not len(known):
        return settings
    samples = replace(settings.samples, nearest=0.0, farthest=float("inf"))
    return replace(settings, samples=samples, farthest=settings.farthest * float(np.median(known)))


def _fitted(
    relative: np.ndarray, samples: FitSamples, settings: AlignmentSettings
) -> tuple[np.ndarray, ScaleRecord, tuple[str, ...]]:
    if settings.method == "paper_depth_space":
        fit = paper_depth_space(samples, grid_regions(samples, relative.shape[1:]))
        return _paper_depth(relative, fit, settings), _paper_record(fit, samples), ()
    fit = _line(samples, settings)
    record = ScaleRecord(
        method=_NAMES[settings.method],
        disparity_scale=fit.scale,
        disparity_shift=fit.shift,
        inlier_share=fit.inlier_share,
        relative_error=fit.relative_error if np.isfinite(fit.relative_error) else None,
    )
    refused = refused_because(fit, samples, settings.gates)
    return metric_depth(relative, fit.scale, fit.shift, settings.farthest), record, refused


def _line(samples: FitSamples, settings: AlignmentSettings) -> DisparityFit:
    if settings.method == "disparity":
        return fit_disparity(samples.disparity, samples.inverse_depth, settings.fit)
    scale, shift = least_squares(samples)
    return described_fit(scale, shift, samples.disparity, samples.inverse_depth, settings.fit)


def metric_depth(
    disparity: Float[np.ndarray, "t h w"], scale: float, shift: float, farthest: float
) -> Float[np.ndarray, "t h w"]:
    """1 / (scale · d + shift); 0 where disparity is 0 or the depth beyond ``farthest``."""
    inverse = scale * disparity.astype(np.float64) + shift
    known = np.isfinite(inverse) & (disparity > 0) & (inverse > 1 / farthest)
    return np.where(known, 1 / np.where(known, inverse, 1), 0)


def _paper_depth(relative: np.ndarray, fit: DepthFit, settings: AlignmentSettings) -> np.ndarray:
    known = np.isfinite(relative) & (relative > 0)
    depth = fit.scale / np.where(known, relative, 1).astype(np.float64) + fit.shift
    return np.where(known & (depth > 0) & (depth < settings.farthest), depth, 0)


def _paper_record(fit: DepthFit, samples: FitSamples) -> ScaleRecord:
    z = fit.scale / samples.disparity + fit.shift
    error = float(np.median(np.abs(z * samples.inverse_depth - 1)))
    return ScaleRecord(
        method=f"paper depth space, z = {fit.scale:.9g} / d + {fit.shift:.9g}",
        relative_error=error,
    )


def _excluded(view: View) -> Bool[np.ndarray, "t h w"]:
    moving = _sky(view) if view.moving is None else _sky(view) | view.moving.numpy()
    return moving


def _sky(view: View) -> Bool[np.ndarray, "t h w"]:
    return np.zeros(view.rgb.shape[:-1], bool) if view.sky is None else view.sky.numpy()
