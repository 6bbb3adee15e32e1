"""The application: state, routes, and what happens at start and stop."""

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import Depends, FastAPI, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse
from fastapi.routing import APIRoute

from diff4splat.serving.api.access import require_token
from diff4splat.serving.api.graphs import graph_router
from diff4splat.serving.api.health import Metrics, health_router
from diff4splat.serving.api.jobs import job_router
from diff4splat.serving.api.state import ServerState
from diff4splat.serving.graphs import ServedGraphs
from diff4splat.serving.jobs.queue import JobQueue
from diff4splat.serving.page.page import page_text
from diff4splat.serving.settings import ServerSettings
from diff4splat.serving.workers.pool import WorkerPool

SUMMARY = "One image, a camera path and optional text to a moving 3D Gaussian scene."
PAGE_HEADERS = {
    "Content-Security-Policy": "default-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; "
    "media-src 'self' blob:; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}


def create_app(settings: ServerSettings, worker_command: Sequence[str]) -> FastAPI:
    """The server as an application that uvicorn runs.

    Raises:
        OutputError: the folder of jobs cannot be used.
        FileFormatError: the model's graphs are not those that were exported.
    """
    queue = JobQueue(settings)
    pool = WorkerPool(queue, worker_command)
    state = ServerState(
        settings=settings, queue=queue, pool=pool, graphs=ServedGraphs.open(settings.model)
    )

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        app.state.server = state
        pool.start()
        yield
        await pool.stop()
        queue.store.close()

    app = FastAPI(
        title="diff4splat",
        summary=SUMMARY,
        version=version("diff4splat"),
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
    )
    metrics = Metrics(state)
    secured = [Depends(require_token(settings.token))]
    app.include_router(job_router, dependencies=secured)
    app.include_router(graph_router, dependencies=secured)
    app.include_router(health_router(metrics))
    app.middleware("http")(metrics.count)
    app.exception_handler(405)(_method_not_allowed)
    app.get("/", response_class=HTMLResponse, include_in_schema=False)(_page)
    return app


async def _method_not_allowed(request: Request, error: Exception) -> Response:
    """With the methods of all routes of this path; the framework names those of the first."""
    del error
    routes = [route for route in request.app.routes if isinstance(route, APIRoute)]
    fitting = [route for route in routes if route.path_regex.match(request.url.path)]
    methods = sorted(set[str]().union(*(route.methods for route in fitting)))
    headers = {"Allow": ", ".join(methods)}
    return JSONResponse({"detail": "Method Not Allowed"}, 405, headers)


def _page(request: Request) -> Response:
    """The page for browsers."""
    del request
    return HTMLResponse(page_text(), headers=PAGE_HEADERS)
