"""The server as a process of its own: kills under load, slow clients, stop and start."""

import json
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
SERVER = ROOT / "tests" / "support" / "echo_server.py"


def free_port() -> int:
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        return listener.getsockname()[1]


@pytest.mark.slow
def test_no_job_is_lost_or_doubled(tmp_path: Path) -> None:
    photo, report = tmp_path / "photo.png", tmp_path / "report.md"
    Image.new("RGB", (32, 32)).save(photo)
    command = [sys.executable, "-m", "benchmarks.serving_load", "--photo", str(photo)]
    command += ["--work", str(tmp_path / "jobs"), "--port", str(free_port())]
    command += ["--requests", "100", "--out", str(report)]
    subprocess.run(command, check=True, cwd=ROOT, timeout=300)
    rows = dict(line.strip("| ").split(" | ", 1) for line in report.read_text().splitlines()[2:])
    assert rows["lost"] == "0" and rows["accepted jobs"] == "95"
    assert rows["results without a finished job"] == rows["finished jobs without a result"] == "0"
    assert set(json.loads(rows["their ends"])) <= {"done", "cancelled"}
    assert rows["seconds, exit code after SIGTERM"].endswith(", 0")


def test_a_signal_ends_the_server_with_exit_code_zero(tmp_path: Path) -> None:
    port = free_port()
    command = [sys.executable, str(SERVER), str(tmp_path / "jobs"), str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout.readline().startswith("serving test at http://127.0.0.1:")
        with closing(connected(port)) as idle:
            idle.sendall(b"GET /health/live HTTP/1.1\r\nHost: x\r\n\r\n")
            assert b"200 OK" in idle.recv(1000)
            server.send_signal(signal.SIGTERM)
            assert server.wait(60) == 0


def connected(port: int) -> socket.socket:
    for _ in range(600):
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=30)
        except OSError:
            time.sleep(0.1)
    raise AssertionError("nothing listens")


def test_a_taken_port_is_one_line(tmp_path: Path) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        command = [sys.executable, "-m", "diff4splat.cli.main", "serve", "test"]
        command += ["--port", str(listener.getsockname()[1]), "--folder", str(tmp_path / "jobs")]
        found = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert found.returncode == 2 and "choose another port" in found.stderr
    assert len(found.stderr.splitlines()) <= 3
