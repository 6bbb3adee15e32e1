"""Presets of a path before the depth that sizes them is known."""

from dataclasses import dataclass

from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.settings import PathFrame, PathSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class PresetPath:
    """A text such as ``spiral+forward`` with its timing."""

    text: str
    settings: PathSettings

    def __len__(self) -> int:
        return self.settings.frames

    def sized_to(self, view: PathFrame) -> CameraPath:
        """The cameras in ``view``.

        Raises:
            InputError: the text is not understood, or the path would run into the nearest content.
        """
        return build_path(self.text, view, self.settings)
