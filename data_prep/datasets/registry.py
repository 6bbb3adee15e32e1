"""The readers by name, and the clips of a folder as they are made, good or bad."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from diff4splat.data.clip import Clip
from diff4splat.data_prep.datasets import (
    capture,
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
from diff4splat.data_prep.datasets.common.clip_assembly import assemble_clip
from diff4splat.data_prep.datasets.common.sequence import Dataset, ListedSequence, Sequence
from diff4splat.data_prep.datasets.common.windows import WindowOptions, clip_identifier, windows
from diff4splat.errors import ConfigError, InputError
from diff4splat.paths.messages import unknown_name

DATASETS: dict[str, Dataset] = {
    module.DATASET.facts.name: module.DATASET
    for module in (
        tartanair,
        matrixcity,
        point_odyssey,
        dynamic_replica,
        spring,
        vkitti2,
        multicam_video,
        realestate10k,
        stereo4d,
        capture,
    )
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedClip:
    """One clip that can be made."""

    identifier: str
    window: range
    sequence: Sequence
    dataset: Dataset
    options: WindowOptions

    def read(self) -> Clip:
        """Read the files and make the clip.

        Raises:
            FileFormatError, InputError: a file or the clip is unusable; says which and why.
        """
        return assemble_clip(
            self.sequence, self.window, self.dataset.facts, self.identifier, self.options
        )


def find_dataset(name: str) -> Dataset:
    """The reader called ``name``.

    Raises:
        ConfigError: there is none.
    """
    if name not in DATASETS:
        raise ConfigError(unknown_name("dataset", name, tuple(DATASETS)))
    return DATASETS[name]


def list_sequences(dataset: Dataset, root: Path) -> list[ListedSequence]:
    """Every sequence below a folder.

    Raises:
        InputError: there is none.
        FileFormatError: the list of a data set is damaged.
    """
    if not root.exists():
        raise InputError(f"{root}: expected a copy of {dataset.facts.title}, got no such folder")
    found = list(dataset.sequences(root))
    if not found:
        raise InputError(
            f"{root}: expected {dataset.facts.title} ({dataset.expected_files}), got nothing of "
            "it; check the path and --dataset"
        )
    return found


def clips_of(
    listed: ListedSequence, dataset: Dataset, options: WindowOptions
) -> Iterator[ListedClip]:
    """The clips of a sequence, none of them read yet.

    Raises:
        FileFormatError, InputError: the sequence is unusable.
    """
    sequence = listed.open()
    for window in windows(sequence.frames, options):
        yield ListedClip(
            identifier=clip_identifier(dataset.facts.name, listed.name, window.start),
            window=window,
            sequence=sequence,
            dataset=dataset,
            options=options,
        )
