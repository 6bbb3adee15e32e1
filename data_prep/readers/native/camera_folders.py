"""Folders with ``camera.json``: one camera, several, or data sets of effects."""

from dataclasses import dataclass
from pathlib import Path

from diff4splat.data_prep.readers.files.file_discovery import natural_key
from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.cameras.camera_record import FILE, FORMAT
from diff4splat.io.require_file import opened_file
from diff4splat.paths.messages import unknown_name

DATASET, DATASET_FORMAT = "dataset.json", "diff4splat-camera-dataset"
_HEAD_BYTES = 256
"""Length of the file start that contains the format name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFolders:
    """The camera folders inside a folder."""

    folder: Path
    """The searched folder."""
    plain: tuple[Path, ...] = ()
    """One per camera."""
    sets: tuple[Path, ...] = ()
    """One per camera, each with a folder per effect."""

    @property
    def has_cameras(self) -> bool:
        """Whether there is any camera."""
        return bool(self.plain or self.sets)

    def select(self, effect: str | None, name: str) -> tuple[Path, ...]:
        """One folder per camera.

        Raises:
            ConfigError: of several effects none is named, or not all cameras have it.
        """
        if not self.sets:
            return self.plain or (self.folder,)
        effects = [_effects(folder) for folder in self.sets]
        shared = [own for own in effects[0] if all(own in others for others in effects)]
        if effect is None and len(shared) == 1:
            effect = shared[0]
        if effect is None:
            raise ConfigError(
                f"{name}: expected the name of one effect as clip, since there are "
                f"{len(shared)}; choose one ({', '.join(shared)})"
            )
        if effect not in shared:
            raise ConfigError(unknown_name("clip", effect, shared))
        return tuple(folder / effect for folder in self.sets)


def camera_folders(folder: Path) -> CameraFolders:
    """Search ``folder``; a camera in it has priority over subfolders."""
    if _is_marked(folder / FILE, FORMAT):
        return CameraFolders(folder=folder, plain=(folder,))
    if _is_marked(folder / DATASET, DATASET_FORMAT):
        return CameraFolders(folder=folder, sets=(folder,))
    below = _folders_in(folder)
    plain = tuple(one for one in below if _is_marked(one / FILE, FORMAT))
    sets = tuple(one for one in below if _is_marked(one / DATASET, DATASET_FORMAT))
    return CameraFolders(folder=folder, plain=plain, sets=() if plain else sets)


def _effects(folder: Path) -> list[str]:
    return [one.name for one in _folders_in(folder) if _is_marked(one / FILE, FORMAT)]


def _folders_in(folder: Path) -> list[Path]:
    try:
        folders = [path for path in folder.iterdir() if path.is_dir()]
    except OSError:
        return []
    return sorted(folders, key=lambda path: natural_key(path.name))


def _is_marked(file: Path, mark: str) -> bool:
    """Check the start of the file only; the reader reports later damage."""
    try:
        with opened_file(file, "a file of cameras") as stream:
            return f'"{mark}"'.encode() in stream.read(_HEAD_BYTES)
    except FileFormatError:
        return False
