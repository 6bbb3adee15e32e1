"""Uvicorn with the application, until a signal stops it."""

import asyncio
import signal
import socket
from collections.abc import Sequence

import uvicorn

from diff4splat.errors import ConfigError
from diff4splat.serving.api.app import create_app
from diff4splat.serving.settings import ServerSettings

IDLE_S = 10
"""Idle connections are closed after it."""
CONNECTIONS = 256
"""At a time; more are answered with 503."""


def serve(settings: ServerSettings, command: Sequence[str], host: str, port: int) -> None:
    """Listen, say where, and serve.

    Raises:
        ConfigError: nothing can listen there.
        OutputError: the folder of jobs cannot be used.
    """
    app = create_app(settings, command)
    listener = _listen(host, port)
    address = f"http://{host}:{listener.getsockname()[1]}"
    config = uvicorn.Config(
        app,
        log_level="warning",
        timeout_keep_alive=IDLE_S,
        limit_concurrency=CONNECTIONS,
        server_header=False,
    )
    server = _Server(config)
    print(f"serving {settings.model} at {address}", flush=True)
    asyncio.run(server.serve(sockets=[listener]))


class _Server(uvicorn.Server):
    """Stops at the first signal; uvicorn would raise it again once all is done."""

    def handle_exit(self, sig: int, frame: object) -> None:
        """Stop accepting; a second interrupt does not wait for open connections."""
        self.force_exit = self.should_exit and sig == signal.SIGINT
        self.should_exit = True


def _listen(host: str, port: int) -> socket.socket:
    try:
        kind = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=kind)
    except OSError as error:
        raise ConfigError(
            f"--host, --port: expected a free address, got {host} {port} ({error.strerror}); "
            "choose another port"
        ) from error
