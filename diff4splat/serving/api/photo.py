"""The photograph of a request: read under limits of size and time, and its header checked."""

import asyncio
import tempfile
from pathlib import Path

from fastapi import HTTPException, Request

from diff4splat.errors import InputError
from diff4splat.io.photos.photo_header import open_photo
from diff4splat.serving.settings import ServerSettings


async def read_body(request: Request, limit_bytes: int, limit_s: float) -> bytes:
    """The body of a request.

    Raises:
        HTTPException: 413 if it is too long, 408 if it takes too long.
    """
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced) > limit_bytes:
        raise _too_long(limit_bytes)
    parts, length = [], 0
    try:
        async with asyncio.timeout(limit_s):
            async for part in request.stream():
                length += len(part)
                if length > limit_bytes:
                    raise _too_long(limit_bytes)
                parts.append(part)
    except TimeoutError as error:
        raise HTTPException(408, f"body: expected within {limit_s:.0f} s") from error
    return b"".join(parts)


async def read_photo(request: Request, settings: ServerSettings) -> bytes:
    """The photograph of a request, its header checked.

    Raises:
        HTTPException: 408, 413, or 422 for what is no image that can be used.
    """
    content = await read_body(request, settings.upload_bytes, settings.upload_s)
    try:
        await asyncio.to_thread(_check, content)
    except InputError as error:
        raise HTTPException(422, f"body: {error}") from error
    return content


def _check(content: bytes) -> None:
    """Readers of photographs take files."""
    with tempfile.TemporaryDirectory(prefix="diff4splat-") as folder:
        file = Path(folder) / "photo"
        file.write_bytes(content)
        try:
            with open_photo(file, convert=True):
                pass
        except InputError as error:
            raise InputError(str(error).replace(f"{file}: ", "")) from error


def _too_long(limit_bytes: int) -> HTTPException:
    return HTTPException(413, f"body: expected at most {limit_bytes} bytes")
