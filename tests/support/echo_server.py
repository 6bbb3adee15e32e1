"""``python echo_server.py FOLDER PORT``: the real server with workers that only echo."""

import sys
from pathlib import Path

from diff4splat.serving.api.run import serve
from diff4splat.serving.settings import ServerSettings

WORKER = (sys.executable, str(Path(__file__).with_name("echo_worker.py")))


def settings(folder: Path, **changes: object) -> ServerSettings:
    given = {"workers": 2, "queue_limit": 400, "grace_s": 1.0, "job_s": 30.0} | changes
    return ServerSettings(folder=folder, model="test", **given)


if __name__ == "__main__":
    serve(settings(Path(sys.argv[1])), WORKER, "127.0.0.1", int(sys.argv[2]))
