"""``diff4splat serve``: generation over HTTP."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.options.constraints import Number, OutFolder
from diff4splat.cli.options.models import ModelName
from diff4splat.errors import ConfigError

TOKEN_VARIABLE = "DIFF4SPLAT_TOKEN"


@dataclass(frozen=True, kw_only=True)
class Serve:
    """Serve generation over HTTP: a page for browsers, an API, health and metrics.

    The environment variable DIFF4SPLAT_TOKEN, if set, is a bearer token that clients must send.
    """

    model: Annotated[str, tyro.conf.Positional, ModelName()] = "small"
    """Folder of ONNX graphs (`diff4splat export onnx`), a model folder, or a size."""
    folder: OutFolder = Path("serve")
    """Where jobs are kept; a restart goes on with them."""
    host: str = "127.0.0.1"
    """Address to listen at; 0.0.0.0 for all networks, then better with a token."""
    port: Annotated[int, Number(least=0, most=65_535)] = 8000
    """Port to listen at; 0 takes a free one."""
    workers: Annotated[int, Number(least=1, most=64)] = 1
    """Generations at a time."""
    queue: Annotated[int, Number(least=1, most=100_000)] = 32
    """Jobs that may wait; more are refused with 429."""
    job_timeout: Annotated[float, Number(least=1, most=86_400)] = 300.0
    """Seconds that a generation may take."""
    job_memory: Annotated[float, Number(above=0, most=1_000)] = 4.0
    """Gigabytes that a generation may take."""
    upload_megabytes: Annotated[float, Number(above=0, most=1_000)] = 20.0
    """Largest photograph."""
    grace: Annotated[float, Number(least=0, most=3_600)] = 20.0
    """Seconds that running jobs may go on when the server is stopped."""

    def run(self) -> None:
        """Serve until a signal stops it."""
        import os

        try:
            from diff4splat.serving.api.run import serve
        except ModuleNotFoundError as error:
            raise ConfigError(
                f"serve: expected the packages of the extra serve, got no {error.name}; "
                "pip install 'diff4splat[serve]'"
            ) from error
        from diff4splat.io.locks import sole_writer
        from diff4splat.serving.settings import ServerSettings

        settings = ServerSettings(
            folder=self.folder,
            model=str(Path(self.model).resolve()) if Path(self.model).is_dir() else self.model,
            workers=self.workers,
            queue_limit=self.queue,
            job_s=self.job_timeout,
            job_bytes=int(self.job_memory * 1e9),
            upload_bytes=int(self.upload_megabytes * 1e6),
            grace_s=self.grace,
            token=os.environ.get(TOKEN_VARIABLE) or None,
        )
        command = (sys.executable, "-m", "diff4splat.cli.serve_worker")
        with sole_writer(self.folder):
            serve(settings, command, self.host, self.port)
