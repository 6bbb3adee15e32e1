"""A web server on this machine that cuts, stalls and lies as it is told."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class Behaviour:
    """What the server does with its next answers."""

    content: bytes
    cut_after: list[int] = field(default_factory=list)
    """Bytes that each next answer sends before the connection ends."""
    stall_s: float = 0.0
    """Seconds without a byte in the middle of the first answer."""
    length: int | None = None
    """A stated length that is not true."""
    range_start: int | None = None
    """A stated start of the range that is not true."""
    ignores_ranges: bool = False
    status: int | None = None
    tag: str = '"one"'
    redirect: str = ""
    content_type: str = "application/octet-stream"
    ranges: list[str | None] = field(default_factory=list)
    """The ranges that were asked for."""


@contextmanager
def served(behaviour: Behaviour) -> Iterator[str]:
    """The address of a running server."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked = self.headers.get("Range")
            behaviour.ranges.append(asked)
            if behaviour.redirect:
                self.send_response(302)
                self.send_header("Location", behaviour.redirect)
                self.end_headers()
                return
            if behaviour.status is not None:
                self.send_error(behaviour.status)
                return
            same = self.headers.get("If-Range") in (None, behaviour.tag)
            start = int(asked[6:-1]) if asked and same and not behaviour.ignores_ranges else 0
            self._head(start, len(behaviour.content))
            self._body(behaviour.content[start:])

        def _head(self, start: int, total: int) -> None:
            stated = total if behaviour.length is None else behaviour.length
            self.send_response(206 if start else 200)
            if start:
                first = start if behaviour.range_start is None else behaviour.range_start
                self.send_header("Content-Range", f"bytes {first}-{stated - 1}/{stated}")
            self.send_header("Content-Length", str(stated - start))
            self.send_header("Content-Type", behaviour.content_type)
            if behaviour.tag:
                self.send_header("ETag", behaviour.tag)
            self.end_headers()

        def _body(self, body: bytes) -> None:
            if behaviour.cut_after:
                body = body[: behaviour.cut_after.pop(0)]
            half = len(body) // 2
            self.wfile.write(body[:half])
            self.wfile.flush()
            if behaviour.stall_s:
                pause, behaviour.stall_s = behaviour.stall_s, 0.0
                time.sleep(pause)
            self.wfile.write(body[half:])

        def handle(self) -> None:
            with suppress(OSError):
                super().handle()

        def log_message(self, format: str, *args: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/model.onnx"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
