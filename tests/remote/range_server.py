"""A web server on this machine that gives parts of files, counts what it gives, and misbehaves when it is told to."""

import contextlib
import hashlib
import re
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

_RANGE = re.compile(r"bytes=(\d+)-(\d+)")


@dataclass(slots=True)
class Served:
    """Files by name, how they are given, and what was asked: requests as (name, start, end)."""

    files: dict[str, bytes | Path] = field(default_factory=dict)
    delay_s: float = 0.0
    drops: int = 0
    gives_parts: bool = True
    status: int | None = None
    requests: list[tuple[str, int, int]] = field(default_factory=list)
    at_once: int = 0
    most_at_once: int = 0
    port: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock)

    def url(self, name: str) -> str:
        return f"http://127.0.0.1:{self.port}/{name}"

    def reset(self) -> None:
        self.requests.clear()
        self.delay_s, self.drops, self.gives_parts, self.status, self.most_at_once = 0.0, 0, True, None, 0

    @property
    def bytes(self) -> int:
        return sum(end - start for _, start, end in self.requests)


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def __init__(self, served: Served, *arguments: object) -> None:
        self._served = served
        super().__init__(*arguments)  # type: ignore[arg-type] # what the server gives it

    def handle(self) -> None:
        with contextlib.suppress(ConnectionResetError):  # who asked wants no more of the answer
            super().handle()

    def log_message(self, *_: object) -> None:
        pass

    def do_GET(self) -> None:
        served = self._served
        with served.lock:
            served.at_once += 1
            served.most_at_once = max(served.most_at_once, served.at_once)
            is_dropped = served.drops > 0
            served.drops -= is_dropped
        try:
            time.sleep(served.delay_s)
            self._answer(is_dropped=is_dropped)
        finally:
            with served.lock:
                served.at_once -= 1

    def _answer(self, *, is_dropped: bool) -> None:
        served, name = self._served, self.path.lstrip("/").partition("?")[0]
        content = served.files.get(name)
        if served.status is not None or content is None:
            self.send_response(served.status or 404)
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        size = content.stat().st_size if isinstance(content, Path) else len(content)
        asked = _RANGE.fullmatch(self.headers.get("Range", "")) if served.gives_parts else None
        start, end = (int(asked[1]), min(int(asked[2]) + 1, size)) if asked else (0, size)
        if asked and start >= size:
            self.send_response(416)
            self.send_header("Content-Range", f"bytes */{size}")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        with served.lock:
            served.requests.append((name, start, end))
        self.send_response(206 if asked else 200)
        self.send_header("ETag", f'"{_version(content)}"')
        self.send_header("Content-Length", str(end - start))
        if asked:
            self.send_header("Content-Range", f"bytes {start}-{end - 1}/{size}")
        self.end_headers()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            body = _part(content, start, end)
            self.wfile.write(body[: len(body) // 2] if is_dropped else body)
        if is_dropped:
            self.close_connection = True
            with contextlib.suppress(OSError):
                self.connection.shutdown(socket.SHUT_RDWR)


def _version(content: bytes | Path) -> str:
    if isinstance(content, Path):
        return str(content.stat().st_mtime_ns)
    return hashlib.sha256(content[:1000] + content[-1000:]).hexdigest()[:16]


def _part(content: bytes | Path, start: int, end: int) -> bytes:
    if isinstance(content, Path):
        with content.open("rb") as stream:
            stream.seek(start)
            return stream.read(end - start)
    return content[start:end]


@contextlib.contextmanager
def serving() -> Iterator[Served]:
    """A server while the block runs."""
    served = Served()
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, served))
    server.daemon_threads = True
    served.port = server.server_address[1]
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        yield served
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
