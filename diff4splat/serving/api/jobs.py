"""Routes of jobs: submit, look, fetch, cancel."""

from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.responses import FileResponse
from pydantic import BaseModel

from diff4splat.serving.api.photo import read_photo
from diff4splat.serving.api.state import Server, ServerState
from diff4splat.serving.jobs.job import Job, State, is_identifier
from diff4splat.serving.jobs.queue import QueueFullError
from diff4splat.serving.jobs.request import JobOptions

RETRY_S = 10
PHOTO_BODY = {
    "required": True,
    "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
}
PREVIEW = "preview.png"
PLAIN = {401: {"description": "The token is missing or wrong."}}
UNKNOWN = PLAIN | {404: {"description": "There is no such job or file."}}
REFUSED = PLAIN | {
    408: {"description": "The body came too slowly."},
    413: {"description": "The body is too long."},
    422: {"description": "A field or the photograph cannot be used; the message names it."},
    429: {"description": "Too many jobs wait; Retry-After says when to try again."},
}
job_router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


class JobStatus(BaseModel):
    """A job as clients see it."""

    id: str
    state: State
    waiting_before: int
    """Jobs before this one in the queue."""
    phase: str
    """What is being done."""
    steps_done: int
    steps: int
    """Of the phase."""
    attempts: int
    error: str
    created_s: float
    """Seconds since 1970."""
    preview: bool
    """Whether /v1/jobs/ID/preview shows something yet."""
    results: list[str]
    """Names to fetch under /v1/jobs/ID/results/NAME."""


@job_router.post("", status_code=202, responses=REFUSED, openapi_extra={"requestBody": PHOTO_BODY})
async def submit_job(
    request: Request, server: Server, options: Annotated[JobOptions, Query()]
) -> JobStatus:
    """Queue a generation. The body is the photograph; options are in the query."""
    photo = await read_photo(request, server.settings)
    try:
        job = await server.queue.accept(options.model_dump(exclude_none=True), photo)
    except QueueFullError as error:
        headers = {"Retry-After": str(RETRY_S)}
        raise HTTPException(429, "queue: full; try again later", headers) from error
    return _status(server, job)


@job_router.get("/{identifier}", responses=UNKNOWN)
async def read_job(identifier: str, server: Server) -> JobStatus:
    """State and progress of a job."""
    return _status(server, _job(server, identifier))


@job_router.delete("/{identifier}", responses=UNKNOWN)
async def cancel_job(identifier: str, server: Server) -> JobStatus:
    """Cancel a job; one that has ended stays as it is."""
    job = _job(server, identifier)
    await server.pool.cancel(job)
    return _status(server, job)


@job_router.get("/{identifier}/results/{name}", responses=UNKNOWN, response_class=FileResponse)
async def read_result(identifier: str, name: str, server: Server) -> FileResponse:
    """One file of a result."""
    job = _job(server, identifier)
    if name not in job.results:
        listed = ", ".join(job.results) or "none yet"
        raise HTTPException(404, f"name: expected one of the job's results ({listed})")
    return FileResponse(server.queue.folders.result(job) / name)


@job_router.get("/{identifier}/preview", responses=UNKNOWN, response_class=FileResponse)
async def read_preview(identifier: str, server: Server) -> FileResponse:
    """The result as one image; while frames are rendered, one of them."""
    job = _job(server, identifier)
    if PREVIEW in job.results:
        return FileResponse(server.queue.folders.result(job) / PREVIEW)
    early = server.queue.folders.preview(job)
    if not early.is_file():
        raise HTTPException(404, "preview: none yet; ask again when the job says there is one")
    return FileResponse(early)


def _job(server: ServerState, identifier: str) -> Job:
    job = server.queue.jobs.get(identifier) if is_identifier(identifier) else None
    if job is None:
        raise HTTPException(404, "id: expected one that POST /v1/jobs returned")
    return job


def _status(server: ServerState, job: Job) -> JobStatus:
    done, steps = job.progress
    early = server.queue.folders.preview(job)
    return JobStatus(
        id=job.identifier,
        state=job.state,
        waiting_before=server.queue.position(job),
        phase=job.phase,
        steps_done=done,
        steps=steps,
        attempts=job.attempts,
        error=job.error,
        created_s=job.created_s,
        preview=PREVIEW in job.results or early.is_file(),
        results=list(job.results),
    )
