"""Messages of blocks that overlap come in the order of time, each once, those outside a span left out."""

import heapq
from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.recording.blocks import DamagedBlockError
from mcap_landmarks.recording.chunk_messages import Open, drain, messages_in, push
from mcap_landmarks.recording.container import MESSAGE, MESSAGE_FIXED, RECORD, Opcode
from mcap_landmarks.stage import Connection, RawMessage

TOPIC = Connection("/odom", "nav_msgs/msg/Odometry", b"")


@given(st.lists(st.lists(st.integers(0, 12), min_size=1, max_size=8).map(sorted), max_size=5), st.integers(0, 12))
def test_runs_are_a_stable_merge(times: list[list[int]], middle: int) -> None:
    blocks = [[RawMessage(TOPIC, t, block, i, b"") for i, t in enumerate(each)] for block, each in enumerate(times)]
    active: Open = []
    for number, block in enumerate(blocks):
        push(active, number, block, 2, 11)
    found = list(chain.from_iterable([*drain(active, middle), *drain(active, 2**64)]))
    merged = heapq.merge(*blocks, key=lambda message: message.log_time_ns)
    assert found == [message for message in merged if 2 <= message.log_time_ns < 11]


def record(opcode: int, length: int, content: bytes) -> bytes:
    return RECORD.pack(opcode, length) + content


@pytest.mark.parametrize(
    "damaged",
    [
        record(Opcode.MESSAGE, MESSAGE_FIXED - 2, bytes(MESSAGE_FIXED - 2)),
        record(Opcode.MESSAGE, 2**40, bytes(100)),
        record(Opcode.CHANNEL, 100, bytes(50)),
        b"\x05\0\0",
    ],
    ids=["a message too short", "an absurd length", "a record that is cut", "half a record's head"],
)
def test_a_damaged_record_gives_no_messages_at_all(damaged: bytes) -> None:
    sound = MESSAGE.pack(Opcode.MESSAGE, MESSAGE_FIXED + 3, 1, 7, 20, 19) + b"abc"
    found = messages_in(memoryview(sound + record(Opcode.CHANNEL, 2, b"no")), {1: TOPIC})
    assert found == [RawMessage(TOPIC, 20, 19, 7, b"abc")]
    with pytest.raises(DamagedBlockError):
        messages_in(memoryview(sound + damaged), {1: TOPIC})
