"""Bearer token."""

import secrets
from collections.abc import Callable

from fastapi import HTTPException, Request


def require_token(token: str | None) -> Callable[[Request], None]:
    """A dependency that lets in who sends ``token``; None lets everyone in."""

    def check(request: Request) -> None:
        if token is None:
            return
        scheme, _, given = request.headers.get("authorization", "").partition(" ")
        # Compared in constant time; bytes, since the header may hold anything.
        right = secrets.compare_digest(given.strip().encode(), token.encode())
        if scheme.lower() != "bearer" or not right:
            headers = {"WWW-Authenticate": "Bearer"}
            raise HTTPException(401, "Authorization: expected Bearer and the token", headers)

    return check
