"""A server under load: mixed requests, clients that leave, workers and the server itself killed.

    python -m benchmarks.serving_load --requests 200 --clients 16 --kills 2 --out serving.md

Every accepted job must end once, in a result or a clear failure. With ``--model`` generations are
real; otherwise workers only echo, and the queue is what is measured.
"""

import argparse
import asyncio
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import httpx2 as httpx

ECHO = Path(__file__).parents[1] / "tests" / "support" / "echo_server.py"
BAD = ("", "steps=1000000", "camera=../x", "frames=-5")
HEALTH_PERIOD_S = 0.1


@dataclass
class Load:
    """What clients saw."""

    base: str
    photo: bytes
    requests: int
    random: random.Random
    echo: bool
    accepted: dict[str, bool] = field(default_factory=dict)
    """Job → whether its client cancelled it."""
    answers: Counter = field(default_factory=Counter)
    ends: dict[str, str] = field(default_factory=dict)
    health_s: list[float] = field(default_factory=list)
    over: bool = False

    async def client(self, number: int, numbers: asyncio.Queue) -> None:
        async with httpx.AsyncClient(base_url=self.base, timeout=10) as http:
            while not numbers.empty():
                await self.one(http, await numbers.get())

    async def one(self, http: httpx.AsyncClient, number: int) -> None:
        kind = number % 20
        if kind == 0:
            await self.malformed(http)
            return
        options = {"seed": number % 5, "frames": 2 + number % 20, "camera": "left:0.1"}
        identifier = await self.submit(http, options)
        if identifier is None:
            return
        self.accepted[identifier] = kind == 1
        if kind == 1:
            with contextlib.suppress(httpx.TransportError):
                await http.delete(f"/v1/jobs/{identifier}")

    async def submit(self, http: httpx.AsyncClient, options: dict) -> str | None:
        while True:
            try:
                answer = await http.post("/v1/jobs", params=options, content=self.photo)
            except httpx.TransportError:
                self.answers["no answer"] += 1
                await asyncio.sleep(0.3)
                continue
            self.answers[answer.status_code] += 1
            if answer.status_code == 202:
                return answer.json()["id"]
            await asyncio.sleep(0.3)

    async def malformed(self, http: httpx.AsyncClient) -> None:
        with contextlib.suppress(httpx.TransportError):
            content = self.random.choice([b"", b"junk", self.photo[:20]])
            url = f"/v1/jobs?{self.random.choice(BAD)}"
            answer = await http.post(url, content=content)
            self.answers[f"malformed {answer.status_code}"] += 1

    async def wait_for_all(self) -> None:
        async with httpx.AsyncClient(base_url=self.base, timeout=10) as http:
            while len(self.ends) < len(self.accepted):
                for identifier in self.accepted.keys() - self.ends.keys():
                    with contextlib.suppress(httpx.TransportError):
                        status = (await http.get(f"/v1/jobs/{identifier}")).json()
                        if status["state"] in ("done", "failed", "cancelled"):
                            self.ends[identifier] = status["state"]
                await asyncio.sleep(0.3)

    async def health(self) -> None:
        async with httpx.AsyncClient(base_url=self.base, timeout=10) as http:
            while not self.over:
                start = time.perf_counter()
                with contextlib.suppress(httpx.TransportError):
                    await http.get("/health/live")
                    self.health_s.append(time.perf_counter() - start)
                await asyncio.sleep(HEALTH_PERIOD_S)


class Server:
    """A server process that is killed and started again."""

    def __init__(self, command: list[str], base: str) -> None:
        self.command, self.base = command, base

    async def start(self) -> None:
        environment = os.environ | {"PYTHONPATH": str(ECHO.parent)}
        self.process = subprocess.Popen(self.command, env=environment)
        async with httpx.AsyncClient() as http:
            while True:
                with contextlib.suppress(httpx.TransportError):
                    await http.get(f"{self.base}/health/live")
                    return
                await asyncio.sleep(0.1)

    def workers(self) -> list[int]:
        found = subprocess.run(
            ["pgrep", "-P", str(self.process.pid)], capture_output=True, text=True, check=False
        )
        return [int(line) for line in found.stdout.split()]

    def resident(self) -> float:
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


async def disturb(server: Server, load: Load, kills: int, every_s: float) -> int:
    """Kill a worker now and then, and the server ``kills`` times; returns the workers killed."""
    killed, since = 0, 0
    while not load.over:
        await asyncio.sleep(every_s)
        for worker in server.workers()[:1]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)
                killed += 1
        since += 1
        if kills and since == 4:
            kills, since = kills - 1, 0
            server.process.kill()
            server.process.wait()
            await server.start()
    return killed


async def run(given: argparse.Namespace) -> str:
    base = f"http://127.0.0.1:{given.port}"
    if given.model is None:
        command = [sys.executable, str(ECHO), str(given.work), str(given.port)]
    else:
        command = [sys.executable, "-m", "diff4splat.cli.main", "serve", given.model]
        command += ["--folder", str(given.work), "--port", str(given.port), "--queue", "400"]
    server = Server(command, base)
    await server.start()
    before_mb = server.resident()
    load = Load(
        base=base,
        photo=given.photo.read_bytes(),
        requests=given.requests,
        random=random.Random(0),
        echo=given.model is None,
    )
    numbers: asyncio.Queue = asyncio.Queue()
    for number in range(given.requests):
        numbers.put_nowait(number)
    start = time.perf_counter()
    health = asyncio.create_task(load.health())
    chaos = asyncio.create_task(disturb(server, load, given.kills, given.kill_every_s))
    await asyncio.gather(*(load.client(index, numbers) for index in range(given.clients)))
    await load.wait_for_all()
    load.over = True
    killed = await chaos
    await health
    seconds, after_mb = time.perf_counter() - start, server.resident()
    server.process.send_signal(signal.SIGTERM)
    code = server.process.wait(60)
    return report(load, given, (seconds, before_mb, after_mb, killed, code))


def report(load: Load, given: argparse.Namespace, facts: tuple) -> str:
    seconds, before_mb, after_mb, killed, code = facts
    folders = [path.name for path in (given.work / "jobs").iterdir()]
    results = [name for name in folders if (given.work / "jobs" / name / "result").is_dir()]
    done = sorted(name for name, state in load.ends.items() if state == "done")
    waits = sorted(load.health_s)
    p95_ms = 1e3 * waits[int(0.95 * len(waits))]
    rows = [
        ("requests, clients", f"{given.requests}, {given.clients}"),
        ("answers", json.dumps({str(key): value for key, value in load.answers.items()})),
        ("accepted jobs", str(len(load.accepted))),
        ("their ends", json.dumps(Counter(load.ends.values()))),
        ("lost", str(len(load.accepted) - len(load.ends))),
        ("results without a finished job", str(len(set(results) - set(done)))),
        ("finished jobs without a result", str(len(set(done) - set(results)))),
        ("workers killed, server killed", f"{killed}, {given.kills}"),
        ("p95 of /health/live", f"{p95_ms:.0f} ms of {len(waits)} requests"),
        ("server's memory before, after", f"{before_mb:.0f}, {after_mb:.0f} MB"),
        ("seconds, exit code after SIGTERM", f"{seconds:.0f}, {code}"),
    ]
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=200)
    parser.add_argument("--clients", type=int, default=16)
    parser.add_argument("--kills", type=int, default=2)
    parser.add_argument("--kill-every-s", type=float, default=1.5)
    parser.add_argument("--model")
    parser.add_argument("--photo", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--port", type=int, default=8125)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    text = asyncio.run(run(given))
    print(text)
    if given.out:
        given.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
