"""From a name to a model folder, its configuration and provenance, before any weights are read.

A folder with a configuration comes first, then bundled weights, then sizes. A folder without a
configuration that has the name of a size is no model.
"""

from collections.abc import Collection
from pathlib import Path

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import SIZES, size_by_name
from diff4splat.models.hub.bundled_weights import bundled_folder
from diff4splat.models.hub.checksums import SUMS_FILE, require_complete
from diff4splat.models.hub.provenance import PROVENANCE_FILE, ModelProvenance, read_provenance
from diff4splat.models.hub.weight_files import CONFIG_FILE, load_config, weight_file


def checked_folder(name_or_folder: str | Path, names: Collection[str] | None = None) -> Path | None:
    """The folder that ``load_model`` reads; None where weights would be random, or for no size.

    Bundled folders have checksums, others may; with ``names`` only those files are compared.

    Raises:
        FileFormatError: a file is damaged.
    """
    folder = Path(name_or_folder)
    bundled = None if _is_folder(folder) else bundled_folder(str(name_or_folder))
    if bundled is not None:
        require_complete(bundled, _advice(bundled), names)
        return bundled
    if not _is_folder(folder):
        return None
    if (folder / SUMS_FILE).is_file():
        require_complete(folder, _advice(folder), names)
    return folder


def require_parts(folder: Path, parts: Collection[str]) -> None:
    """Compare the weight files of ``parts`` with the folder's checksums, if it has any.

    Raises:
        FileFormatError: a file is damaged, or a listed one is absent.
    """
    require_files(folder, {weight_file(folder, part).name for part in parts})


def require_files(folder: Path, names: Collection[str]) -> None:
    """Compare named files with the folder's checksums, if it has any.

    Raises:
        FileFormatError: a file is damaged, or a listed one is absent.
    """
    if (folder / SUMS_FILE).is_file():
        require_complete(folder, _advice(folder), names)


def find_config(name_or_folder: str | Path) -> ModelConfig:
    """The configuration alone, without any weights.

    Raises:
        ConfigError, CheckpointError, FileFormatError: as ``load_model``.
    """
    folder = checked_folder(name_or_folder, (CONFIG_FILE,))
    return size_by_name(str(name_or_folder)) if folder is None else load_config(folder)


def find_provenance(name_or_folder: str | Path) -> ModelProvenance:
    """What is trained, without any weights; random weights are not.

    Raises:
        CheckpointError, FileFormatError: as ``load_model``.
    """
    folder = checked_folder(name_or_folder, (CONFIG_FILE, PROVENANCE_FILE))
    if folder is None:
        return ModelProvenance()
    return read_provenance(folder)


def _advice(folder: Path) -> str:
    """How to get a damaged folder again."""
    bundled = folder == bundled_folder(folder.name)
    return "install diff4splat again" if bundled else "fetch the model again"


def _is_folder(folder: Path) -> bool:
    try:
        named_like_size = str(folder) in SIZES and not (folder / CONFIG_FILE).is_file()
        return folder.is_dir() and not named_like_size
    except OSError:
        return False  # longer than any name
