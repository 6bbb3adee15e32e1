"""What routes share."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request

from diff4splat.serving.graphs import ServedGraphs
from diff4splat.serving.jobs.queue import JobQueue
from diff4splat.serving.settings import ServerSettings
from diff4splat.serving.workers.pool import WorkerPool


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerState:
    """One server."""

    settings: ServerSettings
    queue: JobQueue
    pool: WorkerPool
    graphs: ServedGraphs


def server_state(request: Request) -> ServerState:
    """The state of the server that answers."""
    return request.app.state.server


Server = Annotated[ServerState, Depends(server_state)]
