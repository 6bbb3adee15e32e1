"""Health, readiness and metrics, open to all: monitoring has no token."""

import os
from collections.abc import Awaitable, Callable
from importlib.metadata import version

from fastapi import APIRouter, Request, Response
from prometheus_client import (
    CONTENT_TYPE_LATEST,
    CollectorRegistry,
    Counter,
    Gauge,
    generate_latest,
)

from diff4splat.serving.api.graphs import EXTENSIONS
from diff4splat.serving.api.state import Server, ServerState
from diff4splat.serving.jobs.job import ENDED, State
from diff4splat.serving.workers.worker import resident_bytes

STATES: tuple[State, ...] = ("queued", "running", *ENDED)
NOT_READY = {503: {"description": "The server is about to stop, or its queue is full."}}


class Metrics:
    """Prometheus metrics of one server."""

    def __init__(self, state: ServerState) -> None:
        self.registry = CollectorRegistry()
        self._requests = Counter(
            "diff4splat_http_requests_total",
            "Responses by method and status",
            ["method", "status"],
            registry=self.registry,
        )
        jobs = Gauge("diff4splat_jobs", "Jobs by state", ["state"], registry=self.registry)
        for name in STATES:
            jobs.labels(state=name).set_function(lambda name=name: state.queue.count(name))
        memory = Gauge("diff4splat_resident_bytes", "Memory of the server", registry=self.registry)
        memory.set_function(server_memory_bytes)

    async def count(
        self, request: Request, call_next: Callable[[Request], Awaitable[Response]]
    ) -> Response:
        """Count every response."""
        response = await call_next(request)
        self._requests.labels(method=request.method, status=response.status_code).inc()
        return response

    def text(self) -> bytes:
        """As Prometheus reads it."""
        return generate_latest(self.registry)


def health_router(metrics: Metrics) -> APIRouter:
    """Routes that tell how the server is."""
    router = APIRouter(tags=["health"])

    @router.get("/health/live")
    @router.get("/v2/health/live", operation_id="v2_live")
    async def live() -> dict[str, bool]:
        """The process answers."""
        return {"live": True}

    @router.get("/health/ready", responses=NOT_READY)
    @router.get("/v2/health/ready", responses=NOT_READY, operation_id="v2_ready")
    async def ready(server: Server, response: Response) -> dict[str, bool]:
        """Another job would be accepted."""
        queue = server.queue
        accepts = not queue.closed and queue.waiting < server.settings.queue_limit
        response.status_code = 200 if accepts else 503
        return {"ready": accepts}

    @router.get("/v2")
    async def describe_server() -> dict[str, object]:
        """Name and version, as the inference protocol asks."""
        return {
            "name": "diff4splat",
            "version": version("diff4splat"),
            "extensions": list(EXTENSIONS),
        }

    @router.get("/metrics", response_class=Response)
    async def read_metrics() -> Response:
        """Prometheus metrics."""
        return Response(metrics.text(), media_type=CONTENT_TYPE_LATEST)

    return router


def server_memory_bytes() -> int:
    """Resident memory of this process."""
    return resident_bytes(os.getpid())
