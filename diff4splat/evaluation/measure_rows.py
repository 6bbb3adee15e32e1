"""Entries of single rows of one item: predictions, baselines, and variants of the system."""

from dataclasses import dataclass, replace

from diff4splat.errors import InputError
from diff4splat.evaluation.measures.images import (
    Entries,
    image_entries,
    stacked_rgb,
    target_views,
)
from diff4splat.evaluation.measures.objects import object_entries
from diff4splat.evaluation.measures.regions import TrueRegions, true_regions
from diff4splat.evaluation.measures.tracks import TrackedPoints, track_entries, tracked_points
from diff4splat.evaluation.measures.videos import VideoNetworks, video_entries
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Skip
from diff4splat.evaluation.systems.baselines import BASELINES, make_baseline
from diff4splat.evaluation.systems.evaluated_system import Generator
from diff4splat.evaluation.systems.inpainting import METHODS, InpaintedViews
from diff4splat.evaluation.systems.predictions import Prediction, ScenePrediction
from diff4splat.evaluation.systems.variants import Variant, border_extension, unfilled
from diff4splat.metrics.features.protocol import PerceptualFeatures


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredItem:
    """A sample with everything that its rows share."""

    sample: EvalSample
    protocol: Protocol
    features: PerceptualFeatures | None
    videos: VideoNetworks
    tracked: list[TrackedPoints]
    regions: TrueRegions | None
    """None without true depth."""


def prepare_item(
    sample: EvalSample,
    protocol: Protocol,
    features: PerceptualFeatures | None,
    videos: VideoNetworks,
) -> MeasuredItem:
    """The sample with its ground truth."""
    return MeasuredItem(
        sample=sample,
        protocol=protocol,
        features=features,
        videos=videos,
        tracked=tracked_points(sample, protocol),
        regions=true_regions(sample),
    )


def prediction_entries(row: str, item: MeasuredItem, prediction: Prediction) -> Entries:
    """Images, depth, tracks and objects of one row."""
    views = target_views(item.sample, prediction)
    entries = image_entries(row, item.sample, views, item.regions, item.features)
    if views:
        entries += video_entries(row, item.sample, stacked_rgb(views), item.videos)
    entries += track_entries(row, item.sample, prediction, item.tracked)
    if prediction.scene is not None:
        still_px = item.protocol.still_px
        entries += object_entries(row, item.sample, prediction.scene, still_px)
    return entries


def baseline_entries(item: MeasuredItem) -> Entries:
    """Baselines without a model."""
    entries: Entries = []
    for name in BASELINES:
        try:
            prediction = make_baseline(name, item.sample, item.protocol.planes)
        except InputError as error:
            entries.append(Skip(row=name, key="psnr", why=str(error)))
            continue
        entries += prediction_entries(name, item, prediction)
    return entries


def variant_entries(variant: Variant, item: MeasuredItem, full: Entries) -> Entries:
    """The row of a variant; a copy of ``full``, the system's, if it runs the same networks."""
    if variant.same:
        return [replace(entry, row=variant.row) for entry in full]
    scene = variant.system.predict(item.sample, item.protocol.seed)
    return prediction_entries(variant.row, item, ScenePrediction(scene))


def fill_entries(generator: Generator, item: MeasuredItem, full: Entries) -> Entries:
    """Baselines that fill what the image hides, on the depth and the motion of the system."""
    entries = variant_entries(border_extension(generator), item, full)
    visible = unfilled(generator).predict(item.sample, item.protocol.seed)
    for row, method in METHODS.items():
        prediction = InpaintedViews(visible_scene=visible, method=method)
        entries += prediction_entries(row, item, prediction)
    return entries
