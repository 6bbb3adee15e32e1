"""Writes clips into shards and keeps the manifest.

A shard appears when it is full or the writer is left, first the tar, then its index, then the
manifest that names it. So whatever stops a writer, the folder holds whole shards and a manifest of
whole shards; clips of the shard that was open are written again by whoever resumes.
"""

import hashlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from types import TracebackType

from diff4splat.data.clip import Clip
from diff4splat.data.codecs.encode import Coding, EncodedClip, encode_clip
from diff4splat.data.entry import ClipEntry
from diff4splat.data.manifest import (
    MANIFEST,
    Manifest,
    ShardEntry,
    read_manifest,
    write_manifest,
)
from diff4splat.data.shard_file import ShardFile
from diff4splat.data.shard_index import index_file, write_index
from diff4splat.errors import ConfigError, InputError, OutputError
from diff4splat.io.atomic import output_error
from diff4splat.io.locks import sole_writer
from diff4splat.io.partials import Partial, remove_abandoned

OPEN_SHARD = "shard.tar"


@dataclass(frozen=True, slots=True, kw_only=True)
class ShardOptions:
    """How a folder of shards is written."""

    generator: str
    """What makes the clips, with its version; the manifest names the last one."""
    coding: Coding = field(default_factory=Coding)
    shard_bytes: int = 1_000_000_000
    """A shard is closed by the clip that makes it this large."""


class ShardWriter:
    """A context manager; ``append`` adds to a folder that already has a manifest."""

    def __init__(self, folder: Path | str, options: ShardOptions, append: bool = False) -> None:
        """Look at the folder; nothing is written yet.

        Raises:
            ConfigError: the shard size is not positive.
            OutputError: the folder has clips and ``append`` is False.
            FileFormatError: the manifest is damaged.
        """
        self._folder, self._options = Path(folder), options
        if options.shard_bytes < 1:
            raise ConfigError(f"shard_bytes: expected at least 1, got {options.shard_bytes}")
        self._digest = _digest(self._folder)
        old = Manifest(generator=options.generator, sources=(), shards=())
        if self._digest is not None:
            old = replace(read_manifest(self._folder), generator=options.generator)
        if old.shards and not append:
            raise OutputError(
                f"{self._folder}: expected a folder without clips, got one with {MANIFEST}; "
                "append to it or choose another folder"
            )
        self._manifest = old
        self._identifiers = {clip.identifier for clip in old.clips}
        self._sources: set[str] = set()
        self._entries: list[ClipEntry] = []
        self._shard: ShardFile | None = None
        self._partial: Partial | None = None
        self._stopped = False
        self._lock = ExitStack()

    @property
    def identifiers(self) -> frozenset[str]:
        """Clips that are written, those of earlier runs included: who resumes skips them."""
        return frozenset(self._identifiers)

    def __enter__(self) -> "ShardWriter":
        """Keep other processes from writing there.

        Raises:
            OutputError: another process writes there, or the folder cannot be made.
        """
        with self._stopping():
            self._lock.enter_context(sole_writer(self._folder))
            remove_abandoned(self._folder)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None and self._shard is not None:
            with self._stopping():
                self._finish(self._shard)
        self._stop()

    def write(self, clip: Clip | EncodedClip) -> None:
        """Append one clip.

        Raises:
            InputError: the clip is unusable, or one of this name is written already.
            OutputError: the folder cannot be written or the disk is full; the open shard is
                dropped and the writer takes no more.
        """
        if self._stopped:
            raise OutputError(f"{self._folder}: expected a writer in use, got one that stopped")
        whole = isinstance(clip, EncodedClip)
        identifier = clip.entry.identifier if whole else clip.note.identifier
        if identifier in self._identifiers:
            raise InputError(f"{self._folder}: expected new clips, got '{identifier}' again")
        encoded = clip if whole else encode_clip(clip, self._options.coding)
        with self._stopping():
            self._append(encoded)

    @contextmanager
    def _stopping(self) -> Iterator[None]:
        """If the block fails, nothing half written stays and the writer takes no more."""
        try:
            yield
        except BaseException as error:
            self._stop()
            if isinstance(error, OSError) and not isinstance(error, OutputError):
                raise output_error(self._folder, error) from error
            raise

    def _append(self, clip: EncodedClip) -> None:
        if self._shard is None:
            self._partial = self._partial or Partial(self._folder)
            self._shard = ShardFile(self._partial.folder / OPEN_SHARD)
        self._shard.write(clip)
        self._entries.append(clip.entry)
        self._sources.add(clip.source)
        self._identifiers.add(clip.entry.identifier)
        if self._shard.size >= self._options.shard_bytes:
            self._finish(self._shard)

    def _finish(self, shard: ShardFile) -> None:
        """Name the open shard, write its index, and only then the manifest that lists it."""
        if _digest(self._folder) != self._digest:
            raise OutputError(
                f"{self._folder}: expected to be the only writer, but another changed {MANIFEST}; "
                "let one finish before the next begins"
            )
        index, size = shard.close()
        target = self._free_name(shard)
        entry = ShardEntry(name=target.name, size=size, clips=tuple(self._entries))
        try:
            shard.rename(target)
            write_index(index, target)
            self._manifest = self._list(entry)
        except BaseException:
            if _digest(self._folder) == self._digest:
                # Whole, but nothing names it: the next writer would leave it there for ever.
                for file in (target, index_file(target)):
                    with suppress(OSError):
                        file.unlink()
            raise
        self._shard, self._entries, self._digest = None, [], _digest(self._folder)

    def _list(self, entry: ShardEntry) -> Manifest:
        """The manifest, as it is on the disk now."""
        manifest = replace(
            self._manifest,
            shards=(*self._manifest.shards, entry),
            sources=tuple(sorted({*self._manifest.sources, *self._sources})),
        )
        write_manifest(manifest, self._folder)
        return manifest

    def _free_name(self, shard: ShardFile) -> Path:
        """The first number after all that are listed, past files that somebody else put there.

        A run that was killed before it could list its shard has left one of the same bytes.
        """
        names = (
            self._folder / f"shard-{number:05d}.tar" for number in count(len(self._manifest.shards))
        )
        return next(name for name in names if _is_free(name) or shard.equals(name))

    def _stop(self) -> None:
        if self._shard is not None:
            self._shard.discard()
        if self._partial is not None:
            self._partial.discard()
        self._shard, self._partial, self._stopped = None, None, True
        self._lock.close()


def _is_free(name: Path) -> bool:
    return not name.exists() and not index_file(name).exists()


def _digest(folder: Path) -> str | None:
    """Of the present manifest; None when there is none."""
    try:
        return hashlib.sha256((folder / MANIFEST).read_bytes()).hexdigest()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise output_error(folder / MANIFEST, error) from error
