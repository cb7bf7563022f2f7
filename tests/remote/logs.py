"""A log of two topics, each message a chunk of its own, as bytes."""

import io

import numpy as np
from mcap.writer import CompressionType, Writer

SMALL, LARGE = "/small", "/large"
SMALL_BYTES, LARGE_BYTES = 8_000, 40_000


def log_of(count: int, seed: int = 1) -> bytes:
    """So many messages of each topic, one after the other; those of `LARGE` are larger than the gap that is joined."""
    target, rng = io.BytesIO(), np.random.default_rng(seed)
    writer = Writer(target, chunk_size=1, compression=CompressionType.NONE)
    writer.start()
    schema = writer.register_schema("test", "jsonschema", b"{}")
    channels = {topic: writer.register_channel(topic, "json", schema) for topic in (SMALL, LARGE)}
    for i in range(count):
        for topic, size in ((SMALL, SMALL_BYTES), (LARGE, LARGE_BYTES)):
            time_ns = 1 + 10 * i + (topic == LARGE)
            writer.add_message(channels[topic], time_ns, rng.bytes(size), time_ns)
    writer.finish()
    return target.getvalue()
