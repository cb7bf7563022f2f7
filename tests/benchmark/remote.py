"""Reading one topic of a large log over HTTP: bytes, requests and seconds. The server is a process of this machine."""

import heapq
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection as Pipe
from pathlib import Path

import numpy as np
from mcap_landmarks.locations import location
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.remote import kept_parts
from mcap_landmarks.stage import RawMessage

from tests.benchmark.container_logs import START_NS, connection, odometry, raw, scans, transforms
from tests.benchmark.rows import Row, main
from tests.remote.range_server import serving

_IMAGES, _IMAGE_BYTES = 5_000, 200_000
_LATENCIES_S = (0.0, 0.02)
_NAME = "log.mcap"


def _images(count: int) -> Iterator[RawMessage]:
    on, rng = connection("/camera/image_raw/compressed", CompressedImage), np.random.default_rng(12)
    for i in range(count):
        time_ns = START_NS + i * 10**8 + 3_000_000
        yield raw(on, time_ns, i, CompressedImage(time_ns, "camera", "jpeg", rng.bytes(_IMAGE_BYTES)))


def _write(path: Path, count: int) -> None:
    streams = (_images(count), scans(count), odometry(5 * count), transforms(5 * count))
    with create_recording(path) as writer:
        for message in heapq.merge(*streams, key=lambda message: message.log_time_ns):
            writer.write(message)


def _serve(pipe: Pipe, path: Path) -> None:
    with serving() as served:
        served.files[_NAME] = path
        pipe.send(served.url(_NAME))
        while (delay_s := pipe.recv()) is not None:
            pipe.send((len(served.requests), served.bytes, served.most_at_once))
            served.reset()
            served.delay_s = delay_s


def _read(url: str, pipe: Pipe, topic: str, latency_s: float) -> Iterator[Row]:
    """Rows for a topic, as a process that never opened the log before reads it."""
    kept_parts.ALL.forget()
    pipe.send(latency_s)
    pipe.recv()
    begin = time.perf_counter()
    with open_recording(location(url)) as recording:
        recording.fingerprint()
        opened = time.perf_counter()
        pipe.send(latency_s)
        requests, held, _ = pipe.recv()
        wanted = recording.connections(topic)
        messages = sum(1 for _ in recording.messages(wanted))
        ended = time.perf_counter()
        chunks = recording.size_bytes(wanted)
        all_chunks = len(recording.index.blocks)
    pipe.send(latency_s)
    more, fetched, at_once = pipe.recv()
    name = f"{topic.split('/')[1]}_{latency_s * 1000:.0f}ms"
    goal = 1.2
    yield Row(f"{name}_bytes_to_chunks", (held + fetched) / chunks, at_most=goal, cases=messages)
    yield Row(f"{name}_opening_requests", requests, cases=all_chunks)
    yield Row(f"{name}_opening_seconds", opened - begin, "s", cases=all_chunks)
    yield Row(f"{name}_requests", more)
    yield Row(f"{name}_at_once", at_once)
    yield Row(f"{name}_seconds", ended - opened, "s", peers={"MB/s": fetched / 1e6 / (ended - opened)})


def measure(*, quick: bool = False) -> Iterator[Row]:
    """See the file's docstring; a tenth of the log if `quick`."""
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / _NAME
        _write(path, _IMAGES // 10 if quick else _IMAGES)
        yield Row("log_bytes", path.stat().st_size / 1e6, "MB")
        pipe, far = context.Pipe()
        server = context.Process(target=_serve, args=(far, path))
        server.start()
        url = pipe.recv()
        try:
            list(_read(url, pipe, "/odom", 0.0))  # the libraries are loaded
            for latency_s in _LATENCIES_S:
                for topic in ("/odom", "/scan", "/camera/image_raw/compressed"):
                    yield from _read(url, pipe, topic, latency_s)
            begin = time.perf_counter()
            with open_recording(path) as recording:
                recording.fingerprint()
                yield Row("local_opening_seconds", time.perf_counter() - begin, "s")
        finally:
            pipe.send(None)
            server.join()


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
