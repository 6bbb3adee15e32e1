"""Downloads over HTTP that survive cuts, stalls and lies; the only module that uses the network.

A file grows as NAME.part beside its place and is renamed when length and hash are right. Proxies
are those of HTTPS_PROXY, HTTP_PROXY and NO_PROXY. What was received is kept for the next run, with
the validator of the server, so that two versions are never joined.
"""

import http.client
import os
import shutil
import urllib.error
import urllib.request
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO
from urllib.parse import urlsplit

from diff4splat.errors import InputError, OutputError
from diff4splat.io.file_digest import file_sha256
from diff4splat.models.registry.response import Response, parse_response
from diff4splat.progress.phases import Phases

STALL_S, ATTEMPTS = 30.0, 5
"""Seconds without a byte that count as a stall, and attempts in a row without any progress."""
STEP_BYTES, CHUNK_BYTES = 1 << 20, 1 << 16
MOST_BYTES = 8 << 30
"""Of a file whose size nobody states."""
_ADVICE = "run the same command again, it goes on from there"


@dataclass(frozen=True, slots=True, kw_only=True)
class Download:
    """What to get, and what is known of it."""

    address: str
    target: Path
    bytes: int | None = None
    sha256: str | None = None
    stall_s: float = STALL_S


def download(wanted: Download, phases: Phases) -> str:
    """Get a file and return its SHA-256.

    Raises:
        InputError: the server is not reached, stops in between, or sends another file.
        OutputError: the disk is full.
    """
    wanted.target.parent.mkdir(parents=True, exist_ok=True)
    part = wanted.target.with_name(wanted.target.name + ".part")
    if not urlsplit(wanted.address).scheme:
        _copy(Path(wanted.address), part, wanted)
    else:
        _receive_all(wanted, part, phases)
    digest = file_sha256(part)
    if wanted.sha256 is not None and digest != wanted.sha256:
        _forget(part)
        raise InputError(
            f"{wanted.address}: expected a file with SHA-256 {wanted.sha256}, got {digest}; "
            "the file there was changed, nothing was kept"
        )
    os.replace(part, wanted.target)
    _validator(part).unlink(missing_ok=True)
    return digest


def _receive_all(wanted: Download, part: Path, phases: Phases) -> None:
    """Attempts until the file is complete; one that brought something is not counted."""
    failures, reason = 0, ""
    while failures < ATTEMPTS:
        before = _size(part)
        try:
            if _receive(wanted, part, phases):
                return
            reason = f"the connection ended after {_size(part):,} bytes"
        except (TimeoutError, http.client.HTTPException, ConnectionError) as error:
            reason = _reason(error)
        except urllib.error.HTTPError as error:
            if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE and before:
                _forget(part)
            elif error.code < 500:
                raise InputError(
                    f"{wanted.address}: expected the file, got HTTP {error.code} "
                    f"{error.reason}; check the address, or set DIFF4SPLAT_MIRROR"
                ) from error
            reason = f"HTTP {error.code}"
        except urllib.error.URLError as error:
            reason = _reason(error.reason)
        failures = 0 if _size(part) > before else failures + 1
    raise InputError(
        f"{wanted.address}: expected the whole file, got {reason}; {_ADVICE}, or set a proxy in "
        "HTTPS_PROXY or a mirror in DIFF4SPLAT_MIRROR"
    )


def _receive(wanted: Download, part: Path, phases: Phases) -> bool:
    """One attempt; whether the file is complete."""
    start = _size(part) if _validator(part).exists() else 0
    if wanted.bytes is not None and start >= wanted.bytes:
        start = start if start == wanted.bytes else 0
        if start:
            return True
    headers = {"User-Agent": "diff4splat", "Accept-Encoding": "identity"}
    if start:
        headers |= {"Range": f"bytes={start}-", "If-Range": _validator(part).read_text()}
    request = urllib.request.Request(wanted.address, headers=headers)
    with _opener().open(request, timeout=wanted.stall_s) as stream:
        response = parse_response(wanted.address, stream.status, stream.headers, start)
        total = _require_length(wanted, response)
        _require_space(part, (total or 0) - response.start)
        if response.validator:
            _validator(part).write_text(response.validator)
        else:
            _validator(part).unlink(missing_ok=True)
        with part.open("r+b" if response.start else "wb") as file:
            file.truncate(response.start)
            file.seek(response.start)
            received = _pump(stream, file, wanted, total, phases)
    if total is not None and received > total:
        _forget(part)
        raise InputError(f"{wanted.address}: expected {total:,} bytes, got more; nothing was kept")
    return received == total if total is not None else True


def _pump(
    stream: http.client.HTTPResponse,
    file: BinaryIO,
    wanted: Download,
    total: int | None,
    phases: Phases,
) -> int:
    """Write what arrives, and return the length of the file so far."""
    limit = MOST_BYTES if total is None else total
    received = file.tell()
    steps = max(-(-(limit - received) // STEP_BYTES), 1) if total is not None else 1
    with phases.phase(f"download {wanted.target.parent.name}", steps) as advance:
        shown = received
        while chunk := stream.read1(CHUNK_BYTES):
            received += len(chunk)
            if received > limit:
                break
            try:
                file.write(chunk)
            except OSError as error:
                raise OutputError(f"{wanted.target}: {error.strerror}; free some space") from error
            while received - shown >= STEP_BYTES:
                shown += STEP_BYTES
                advance()
    return received


def _require_length(wanted: Download, response: Response) -> int | None:
    """The length of the whole file.

    Raises:
        InputError: the server states another one than is known, or an absurd one.
    """
    total = response.total
    if wanted.bytes is not None and total not in (None, wanted.bytes):
        raise InputError(
            f"{wanted.address}: expected {wanted.bytes:,} bytes, got {total:,}; the file there was "
            "changed"
        )
    if total is not None and total > MOST_BYTES:
        raise InputError(
            f"{wanted.address}: expected at most {MOST_BYTES >> 30} GiB, got {total:,} bytes"
        )
    return wanted.bytes if total is None else total


def _require_space(part: Path, count: int) -> None:
    free = shutil.disk_usage(part.parent).free
    if count > free:
        raise OutputError(
            f"{part.parent}: expected {count:,} bytes of free space, got {free:,}; free some, or "
            "name another folder in DIFF4SPLAT_CACHE"
        )


def _copy(source: Path, part: Path, wanted: Download) -> None:
    """From a mirror that is a folder."""
    try:
        size = source.stat().st_size
        if wanted.bytes not in (None, size):
            raise InputError(f"{source}: expected {wanted.bytes:,} bytes, got {size:,}")
        shutil.copyfile(source, part)
    except OSError as error:
        raise InputError(
            f"{source}: expected a file of the mirror, got '{error.strerror}'; check "
            "DIFF4SPLAT_MIRROR"
        ) from error


class _NoDowngrade(urllib.request.HTTPRedirectHandler):
    """An encrypted address is not left for an open one."""

    def redirect_request(self, req, fp, code, msg, headers, newurl):
        if req.full_url.startswith("https:") and not newurl.startswith("https:"):
            raise InputError(f"{req.full_url}: expected a redirect to https, got {newurl}")
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def _opener() -> urllib.request.OpenerDirector:
    """HTTP alone: no file, FTP or data addresses."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(),
        urllib.request.HTTPDefaultErrorHandler(),
        urllib.request.HTTPErrorProcessor(),
        urllib.request.UnknownHandler(),
        _NoDowngrade(),
    ):
        opener.add_handler(handler)
    return opener


def _reason(error: object) -> str:
    return "no answer" if isinstance(error, TimeoutError) else str(error) or type(error).__name__


def _validator(part: Path) -> Path:
    """Holds what tells one version of the file from another."""
    return part.with_name(part.name + ".version")


def _forget(part: Path) -> None:
    part.unlink(missing_ok=True)
    _validator(part).unlink(missing_ok=True)


def _size(part: Path) -> int:
    return part.stat().st_size if part.exists() else 0
