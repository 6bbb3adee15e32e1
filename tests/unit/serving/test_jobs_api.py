"""Jobs over HTTP, with workers that only echo: every state, every limit, every refusal."""

import asyncio
import io
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from echo_server import WORKER, settings
from fastapi import HTTPException, Request
from fastapi.testclient import TestClient
from PIL import Image

from diff4splat.serving.api.app import create_app
from diff4splat.serving.api.photo import read_body

WAIT_S = 60.0


def photo(side_px: int = 32, kind: str = "PNG") -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (side_px, side_px), (90, 60, 30)).save(stream, kind)
    return stream.getvalue()


Start = Callable[..., TestClient]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    clients = []

    def begin(**changes: object) -> TestClient:
        client = TestClient(create_app(settings(tmp_path / "serve", **changes), WORKER))
        client.__enter__()
        clients.append(client)
        return client

    yield begin
    for client in clients:
        client.__exit__(None, None, None)


def submit(client: TestClient, seed: int = 0, **options: object) -> str:
    answer = client.post("/v1/jobs", params={"seed": seed, **options}, content=photo())
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


def ended(client: TestClient, identifier: str) -> dict:
    limit = time.monotonic() + WAIT_S
    while time.monotonic() < limit:
        status = client.get(f"/v1/jobs/{identifier}").json()
        if status["state"] in ("done", "failed", "cancelled"):
            return status
        time.sleep(0.02)
    raise AssertionError(f"still {status}")


def running(client: TestClient, identifier: str) -> None:
    limit = time.monotonic() + WAIT_S
    while client.get(f"/v1/jobs/{identifier}").json()["state"] != "running":
        assert time.monotonic() < limit
        time.sleep(0.02)


def test_a_job_ends_in_files(start: Start) -> None:
    client = start()
    identifier = submit(client, camera="arc:0.2", prompt="it moves")
    status = ended(client, identifier)
    assert status["state"] == "done" and status["attempts"] == 1
    assert status["results"] == ["preview.png", "card.json"]
    base = f"/v1/jobs/{identifier}"
    assert client.get(f"{base}/results/preview.png").content == photo()
    assert client.get(f"{base}/preview").content == photo()
    for name in ("photo", "../photo", "%2e%2e%2fphoto", "scene.safetensors"):
        assert client.get(f"{base}/results/{name}").status_code in (404, 307), name


def test_a_frame_is_seen_before_the_result(start: Start) -> None:
    client = start(workers=1)
    slow, waiting = submit(client, seed=7), submit(client)
    limit = time.monotonic() + WAIT_S
    while not client.get(f"/v1/jobs/{slow}").json()["preview"]:
        assert time.monotonic() < limit
        time.sleep(0.02)
    early = client.get(f"/v1/jobs/{slow}/preview")
    assert early.content == photo() and early.headers["content-type"] == "image/png"
    assert not client.get(f"/v1/jobs/{slow}").json()["results"]
    assert not client.get(f"/v1/jobs/{waiting}").json()["preview"]
    refused = client.get(f"/v1/jobs/{waiting}/preview")
    assert refused.status_code == 404 and "none yet" in refused.json()["detail"]
    client.delete(f"/v1/jobs/{slow}")


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"steps": 1_000_000}, "steps"),
        ({"frames": -1}, "frames"),
        ({"frames": 241}, "frames"),
        ({"resolution": 5000}, "resolution"),
        ({"camera": "../../etc/passwd"}, "camera"),
        ({"camera": "sideways"}, "camera"),
        ({"camera": "forward:90"}, "camera"),
        ({"prompt": " "}, "prompt"),
        ({"prompt": "x" * 600}, "prompt"),
        ({"seed": "NaN"}, "seed"),
        ({"fov": "inf"}, "fov"),
        ({"model": "/etc"}, "model"),
        ({"device": "cuda"}, "device"),
    ],
)
def test_options_are_refused_by_name(start: Start, options: dict, field: str) -> None:
    answer = start().post("/v1/jobs", params=options, content=photo())
    assert answer.status_code == 422 and field in answer.text


@pytest.mark.parametrize(
    ("content", "status", "expected"),
    [
        (b"", 422, "body"),
        (b"hello", 422, "expected a JPEG, PNG"),
        (photo()[:20], 422, "body"),
        (photo(8), 422, "at least 16x16"),
        (b"x" * 3_000_000, 413, "expected at most 2000000 bytes"),
        (b'{"image": "/etc/passwd"}', 422, "body"),
    ],
)
def test_bodies_are_refused(start: Start, content: bytes, status: int, expected: str) -> None:
    answer = start(upload_bytes=2_000_000).post("/v1/jobs", content=content)
    assert answer.status_code == status and expected in answer.text


def test_an_enormous_header_is_refused_unread(start: Start) -> None:
    header = bytearray(photo())
    header[16:24] = (100_000).to_bytes(4, "big") * 2
    import zlib

    header[29:33] = zlib.crc32(bytes(header[12:29])).to_bytes(4, "big")
    answer = start().post("/v1/jobs", content=bytes(header))
    assert answer.status_code == 422 and "megapixels" in answer.text


@pytest.mark.parametrize("identifier", ["0" * 32, "..", "%2e%2e", "x", "0" * 31 + "/"])
def test_unknown_jobs(start: Start, identifier: str) -> None:
    client = start()
    assert client.get(f"/v1/jobs/{identifier}").status_code in (404, 405)
    assert client.delete(f"/v1/jobs/{identifier}").status_code in (404, 405)


def test_a_full_queue_says_when_to_come_back(start: Start) -> None:
    client = start(queue_limit=1, workers=1)
    running(client, submit(client, seed=7))
    submit(client, seed=0)
    answer = client.post("/v1/jobs", content=photo())
    assert answer.status_code == 429 and int(answer.headers["retry-after"]) > 0
    assert client.get("/health/ready").status_code == 503
    assert client.get("/health/live").status_code == 200


def test_cancelled_while_it_waits_and_while_it_runs(start: Start) -> None:
    client = start(workers=1)
    first, second, third = submit(client, seed=7), submit(client), submit(client)
    running(client, first)
    assert client.get(f"/v1/jobs/{third}").json()["waiting_before"] == 1
    assert client.delete(f"/v1/jobs/{second}").json()["state"] == "cancelled"
    assert client.delete(f"/v1/jobs/{first}").json()["state"] == "cancelled"
    assert ended(client, third)["state"] == "done"
    assert client.delete(f"/v1/jobs/{third}").json()["state"] == "done"


@pytest.mark.parametrize(
    ("seed", "changes", "error"),
    [
        (7, {"job_s": 0.5}, "takes longer than 0 s"),
        (8, {"attempts": 2}, "its worker ended 2 times without a result"),
        (9, {}, "photo: expected something else"),
        (6, {"job_bytes": 200_000_000}, "needs more than 0.2 GB"),
    ],
)
def test_failures_say_why(start: Start, seed: int, changes: dict, error: str) -> None:
    client = start(**changes)
    status = ended(client, submit(client, seed=seed))
    assert status["state"] == "failed" and error in status["error"]
    assert ended(client, submit(client))["state"] == "done"


def test_rubbish_between_the_lines_does_no_harm(start: Start) -> None:
    client = start()
    assert ended(client, submit(client, seed=5))["state"] == "done"


def test_a_restart_goes_on(start: Start, tmp_path: Path) -> None:
    client = start(workers=1, grace_s=0.0)
    done = submit(client)
    ended(client, done)
    slow, waiting = submit(client, seed=7), submit(client)
    running(client, slow)
    client.__exit__(None, None, None)
    again = start(workers=2)
    assert ended(again, done)["results"] == ["preview.png", "card.json"]
    assert ended(again, waiting)["state"] == "done"
    running(again, slow)
    assert again.get(f"/v1/jobs/{slow}").json()["attempts"] == 1
    again.delete(f"/v1/jobs/{slow}")


def test_old_jobs_make_room(start: Start, tmp_path: Path) -> None:
    client = start(keep_jobs=2)
    jobs = [submit(client) for _ in range(4)]
    for identifier in jobs[2:]:
        ended(client, identifier)
    limit = time.monotonic() + WAIT_S
    while len(list((tmp_path / "serve" / "jobs").iterdir())) > 2:
        assert time.monotonic() < limit
        time.sleep(0.02)


def test_a_token_keeps_others_out(start: Start) -> None:
    client = start(token="secret")
    assert client.post("/v1/jobs", content=photo()).status_code == 401
    for wrong in ("Bearer other", "secret", "Basic secret", "Bearer", "Bearer secrét"):
        headers = {"Authorization": wrong.encode()}
        assert client.post("/v1/jobs", content=photo(), headers=headers).status_code == 401
    headers = {"Authorization": "Bearer secret"}
    assert client.post("/v1/jobs", content=photo(), headers=headers).status_code == 202
    assert client.get("/health/live").status_code == 200
    assert client.get("/v2/models/dit").status_code == 401


def test_metrics_and_page(start: Start) -> None:
    client = start()
    ended(client, submit(client))
    text = client.get("/metrics").text
    assert 'diff4splat_jobs{state="done"} 1.0' in text
    assert 'diff4splat_http_requests_total{method="POST",status="202"} 1.0' in text
    page = client.get("/")
    assert "arc" in page.text and "/*paths*/" not in page.text
    assert "frame-ancestors 'none'" in page.headers["content-security-policy"]
    assert client.get("/v2").json()["name"] == "diff4splat"
    assert client.get("/openapi.json").status_code == 200


def test_a_body_that_never_ends_is_given_up() -> None:
    scope = {"type": "http", "method": "POST", "headers": [], "path": "/v1/jobs"}

    async def slow() -> dict:
        await asyncio.sleep(0.05)
        return {"type": "http.request", "body": b"x", "more_body": True}

    with pytest.raises(HTTPException) as refused:
        asyncio.run(read_body(Request(scope, slow), 1_000, 0.1))
    assert refused.value.status_code == 408
