"""Downloads from a server that cuts, stalls and lies: whole files under final names, or none."""

import hashlib
from pathlib import Path

import pytest
from unreliable_server import Behaviour, served

from diff4splat.errors import InputError
from diff4splat.models.registry.download import Download, download
from diff4splat.progress.phases import Phases

CONTENT = bytes(range(256)) * 1200
DIGEST = hashlib.sha256(CONTENT).hexdigest()
KNOWN = {"bytes": len(CONTENT), "sha256": DIGEST}


@pytest.fixture
def target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY", "all_proxy"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path / "depth" / "model.onnx"


def got(behaviour: Behaviour, target: Path, **known: object) -> str:
    with served(behaviour) as address:
        return download(Download(address=address, target=target, stall_s=0.3, **known), Phases())


def only_parts(target: Path) -> bool:
    """Nothing has the final name."""
    return not target.exists() and all(".part" in file.name for file in target.parent.iterdir())


def test_a_whole_file(target: Path) -> None:
    assert got(Behaviour(CONTENT), target, **KNOWN) == DIGEST
    assert target.read_bytes() == CONTENT
    assert [file.name for file in target.parent.iterdir()] == ["model.onnx"]


def test_cuts_are_continued_where_they_were(target: Path) -> None:
    behaviour = Behaviour(CONTENT, cut_after=[1000, 70_000, 5])
    assert got(behaviour, target, **KNOWN) == DIGEST
    assert behaviour.ranges == [None, "bytes=1000-", "bytes=71000-", "bytes=71005-"]


def test_a_stall_is_continued(target: Path) -> None:
    assert got(Behaviour(CONTENT, stall_s=1.0), target, **KNOWN) == DIGEST


def test_a_second_run_goes_on(target: Path) -> None:
    with pytest.raises(InputError, match="goes on from there"):
        got(Behaviour(CONTENT, cut_after=[200, *[0] * 9]), target, **KNOWN)
    assert only_parts(target)
    behaviour = Behaviour(CONTENT)
    assert got(behaviour, target, **KNOWN) == DIGEST
    assert behaviour.ranges == ["bytes=200-"]


def test_another_version_starts_again(target: Path) -> None:
    with pytest.raises(InputError):
        got(Behaviour(CONTENT[::-1], cut_after=[200, *[0] * 9]), target, bytes=len(CONTENT))
    assert got(Behaviour(CONTENT, tag='"two"'), target, **KNOWN) == DIGEST


@pytest.mark.parametrize("behaviour", [{"ignores_ranges": True}, {"tag": ""}])
def test_servers_without_ranges(behaviour: dict, target: Path) -> None:
    made = Behaviour(CONTENT, cut_after=[1000], **behaviour)
    assert got(made, target, **KNOWN) == DIGEST


def test_a_wrong_hash_keeps_nothing(target: Path) -> None:
    with pytest.raises(InputError, match=rf"expected a file with SHA-256 {DIGEST}, got"):
        got(Behaviour(CONTENT[:-1] + b"x"), target, **KNOWN)
    assert list(target.parent.iterdir()) == []


def test_a_stated_length_that_is_not_known(target: Path) -> None:
    with pytest.raises(InputError, match=r"expected 307,200 bytes, got 307,201"):
        got(Behaviour(CONTENT + b"x"), target, **KNOWN)
    assert only_parts(target)


@pytest.mark.parametrize("known", [KNOWN, {}])
def test_a_stated_length_that_is_too_long(known: dict, target: Path) -> None:
    with pytest.raises(InputError):
        got(Behaviour(CONTENT, length=len(CONTENT) + 50), target, **known)
    assert only_parts(target)


def test_an_absurd_length_is_refused_at_once(target: Path) -> None:
    with pytest.raises(InputError, match="at most 8 GiB"):
        got(Behaviour(CONTENT, length=1 << 50), target)
    assert only_parts(target)


def test_a_range_that_was_not_asked_for(target: Path) -> None:
    behaviour = Behaviour(CONTENT, cut_after=[1000], range_start=7)
    with pytest.raises(InputError, match=r"bytes from 1,000 on, got the range 'bytes 7-"):
        got(behaviour, target, **KNOWN)
    assert only_parts(target)


@pytest.mark.parametrize("status", [404, 403, 503])
def test_refusals_of_the_server(status: int, target: Path) -> None:
    with pytest.raises(InputError, match=f"HTTP {status}"):
        got(Behaviour(CONTENT, status=status), target, **KNOWN)
    assert only_parts(target)


def test_a_page_instead_of_a_file(target: Path) -> None:
    with pytest.raises(InputError, match="got a web page"):
        got(Behaviour(b"<html>", content_type="text/html; charset=utf-8"), target)


@pytest.mark.parametrize("place", ["file:///etc/hostname", "ftp://127.0.0.1/a"])
def test_redirects_stay_on_the_web(place: str, target: Path) -> None:
    with pytest.raises(InputError):
        got(Behaviour(CONTENT, redirect=place), target)
    assert only_parts(target)


def test_nobody_listens(target: Path) -> None:
    wanted = Download(address="http://127.0.0.1:9/model.onnx", target=target, **KNOWN)
    with pytest.raises(InputError, match=r"HTTPS_PROXY or a mirror in DIFF4SPLAT_MIRROR"):
        download(wanted, Phases())
    assert only_parts(target)
