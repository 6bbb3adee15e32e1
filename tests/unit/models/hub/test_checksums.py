import hashlib
from pathlib import Path

import pytest
from packed_models import packed_folder

from diff4splat.errors import FileFormatError
from diff4splat.models.hub.checksums import SUMS_FILE, require_complete
from diff4splat.models.hub.weight_files import part_file

ADVICE = "do it again"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return packed_folder(tmp_path)


def flip(file: Path, place: int = -1) -> None:
    content = bytearray(file.read_bytes())
    content[place] ^= 1
    file.write_bytes(content)


def test_the_list_is_what_sha256sum_reads(folder: Path) -> None:
    lines = (folder / SUMS_FILE).read_text().splitlines()
    listed = dict(reversed(line.split("  ")) for line in lines)
    files = {file.name for file in folder.iterdir()} - {SUMS_FILE}
    assert listed.keys() == files
    for name, digest in listed.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    require_complete(folder, ADVICE)


@pytest.mark.parametrize("name", ["config.json", "provenance.json", "vae.safetensors"])
def test_one_bit_is_enough(folder: Path, name: str) -> None:
    flip(folder / name)
    with pytest.raises(FileFormatError, match=rf"{name}: expected SHA-256 .*damaged, do it again"):
        require_complete(folder, ADVICE)


def test_a_missing_file_is_named(folder: Path) -> None:
    part_file(folder, "ldrm").unlink()
    with pytest.raises(FileFormatError, match=r"ldrm\.safetensors: expected .* got no file"):
        require_complete(folder, ADVICE)


def test_weights_that_nobody_listed_are_refused(folder: Path) -> None:
    part_file(folder, "dit").write_bytes(b"x")
    with pytest.raises(FileFormatError, match=r"dit\.safetensors: expected a file that SHA256SUMS"):
        require_complete(folder, ADVICE)


def test_words_for_people_may_change(folder: Path) -> None:
    (folder / "CARD.md").write_text("about these weights")
    require_complete(folder, ADVICE)


def test_only_what_is_asked_for_is_compared(folder: Path) -> None:
    flip(part_file(folder, "vae"))
    require_complete(folder, ADVICE, ("config.json",))
    flip(folder / "config.json", 0)
    with pytest.raises(FileFormatError, match=r"config\.json"):
        require_complete(folder, ADVICE, ("config.json",))


@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe", b"0 vae\n", b"<html>\n"])
def test_a_list_that_is_none(folder: Path, content: bytes | None) -> None:
    (folder / SUMS_FILE).unlink()
    if content is not None:
        (folder / SUMS_FILE).write_bytes(content)
    with pytest.raises(FileFormatError, match=r"SHA256SUMS: expected .*; do it again"):
        require_complete(folder, ADVICE)
