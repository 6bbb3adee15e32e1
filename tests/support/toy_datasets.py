"""Every data set of the toy world by name: how to write it, and how exactly it comes back."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType

from dataset_writers import (
    dynamic_replica,
    matrixcity,
    multicam_video,
    point_odyssey,
    realestate10k,
    spring,
    stereo4d,
    tartanair,
    vkitti2,
)
from toy_scene import Truth, make_truth

from diff4splat.data.clip import Clip
from diff4splat.data_prep.datasets.common.windows import WindowOptions
from diff4splat.data_prep.datasets.registry import clips_of, find_dataset, list_sequences


@dataclass(frozen=True)
class ToySet:
    """One written data set."""

    dataset: str
    writer: ModuleType
    write: Callable[[Truth, Path], Path]
    static: bool = False
    depth_relative: float | None = None
    """Quantisation of depth; None where there is none."""
    depth_m: float = 0.0
    pose: float = 1e-6
    flow_px: tuple[float, float] | None = None
    """(relative, absolute)"""
    rgb: float = 0.0
    facts: tuple[str, str, bool, float | None] = field(default=("exact", "", False, None))
    """metric, licence, static, fps"""

    def truth(self) -> Truth:
        return truth_for(self)


@cache
def truth_for(toy: ToySet) -> Truth:
    writer = toy.writer
    baseline_m = getattr(writer, "BASELINE_M", 0.0)
    return make_truth(writer.SIZE_PX, writer.LENS, baseline_m, toy.static)


def _half_city(truth: Truth, root: Path) -> Path:
    return matrixcity.write(truth, root, half=True)


def _float_city(truth: Truth, root: Path) -> Path:
    return matrixcity.write(truth, root, half=False)


CITY = ("exact", "CC-BY-NC-4.0", True, None)
TOYS = {
    "tartanair": ToySet(
        "tartanair",
        tartanair,
        tartanair.write,
        static=True,
        depth_relative=1e-5,
        flow_px=(1e-5, 1e-5),
        facts=("exact", "CC-BY-4.0", True, None),
    ),
    "matrixcity half": ToySet(
        "matrixcity", matrixcity, _half_city, static=True, depth_relative=5e-4, facts=CITY
    ),
    "matrixcity float": ToySet(
        "matrixcity", matrixcity, _float_city, static=True, depth_relative=1e-6, facts=CITY
    ),
    "matrixcity packaged": ToySet(
        "matrixcity",
        matrixcity,
        matrixcity.write_packaged,
        static=True,
        depth_relative=1e-6,
        facts=CITY,
    ),
    "point_odyssey": ToySet(
        "point_odyssey",
        point_odyssey,
        point_odyssey.write,
        depth_m=0.0153,
        depth_relative=1e-6,
        pose=2e-6,
        rgb=4,
        facts=("exact", "CC-BY-NC-SA-4.0", False, 30.0),
    ),
    "dynamic_replica": ToySet(
        "dynamic_replica",
        dynamic_replica,
        dynamic_replica.write,
        depth_relative=5e-4,
        flow_px=(5e-4, 1e-4),
        facts=("exact", "CC-BY-NC-4.0", False, 30.0),
    ),
    "spring": ToySet(
        "spring",
        spring,
        spring.write,
        depth_relative=1e-5,
        flow_px=(1e-5, 1e-5),
        facts=("exact", "CC-BY-4.0", False, 24.0),
    ),
    "vkitti2": ToySet(
        "vkitti2",
        vkitti2,
        vkitti2.write,
        depth_m=0.0051,
        depth_relative=1e-6,
        flow_px=(0, 0.02),
        rgb=4,
        facts=("exact", "CC-BY-NC-SA-3.0", False, 10.0),
    ),
    "multicam_video": ToySet(
        "multicam_video",
        multicam_video,
        multicam_video.write,
        rgb=12,
        facts=("exact", "Apache-2.0", False, 15.0),
    ),
    "realestate10k": ToySet(
        "realestate10k",
        realestate10k,
        realestate10k.write,
        static=True,
        pose=1e-9,
        facts=("none", "CC-BY-4.0", True, 29.97),
    ),
    "stereo4d": ToySet(
        "stereo4d",
        stereo4d,
        stereo4d.write,
        pose=1e-9,
        rgb=12,
        facts=("pseudo", "CC-BY-4.0", False, 30.0),
    ),
}


def read_clips(dataset: str, root: Path, **options: int) -> list[Clip]:
    """All clips of all sequences of a folder."""
    found = find_dataset(dataset)
    return [
        clip.read()
        for listed in list_sequences(found, root)
        for clip in clips_of(listed, found, WindowOptions(**options))
    ]
