"""Recordings on a web server: what is fetched of them, when, and what is said when that fails."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from mcap_landmarks.errors import RemoteError
from mcap_landmarks.locations import Location, location, size_of, to_read
from mcap_landmarks.progress import unwatched
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.remote import kept_parts, reading_plan, refusals
from mcap_landmarks.remote.shown_copies import copies_shown

from tests.remote.logs import LARGE, SMALL, log_of
from tests.remote.range_server import Served, serving

COUNT = 100
NAME = "run.mcap"


@pytest.fixture(scope="module")
def content() -> bytes:
    return log_of(COUNT)


@pytest.fixture(scope="module")
def local(content: bytes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("local") / NAME
    path.write_bytes(content)
    return path


@pytest.fixture(scope="module")
def server() -> Iterator[Served]:
    with serving() as served:
        yield served


@pytest.fixture
def served(server: Served, content: bytes, monkeypatch: pytest.MonkeyPatch) -> Served:
    """A server that behaves, of which nothing is known yet; tries follow each other without pauses."""
    monkeypatch.setattr(refusals, "PAUSES_S", (0.0, 0.0, 0.0))
    kept_parts.ALL.forget()
    server.reset()
    server.files = {NAME: content}
    return server


@pytest.fixture
def url(served: Served) -> Location:
    return location(f"{served.url(NAME)}?signature=secret")


def read(place: Location, topic: str) -> list[tuple[int, bytes]]:
    with open_recording(place) as recording:
        found = recording.messages(recording.connections(topic))
        return [(message.log_time_ns, bytes(message.data)) for message in found]


@pytest.mark.slow
def test_one_topic_is_the_bytes_of_its_chunks_several_at_once(served: Served, url: Location, local: Path) -> None:
    served.delay_s = 0.01
    with open_recording(url) as recording, open_recording(local) as same:
        assert recording.fingerprint() == same.fingerprint()
        assert recording.content_hash() == same.content_hash()
        assert recording.index.counts == same.index.counts
        # The head of each chunk once, where it is, and the two ends; heads in a row come together.
        assert len(served.requests) <= 2 * COUNT + 3
        assert served.bytes < 0.05 * len(served.files[NAME])  # type: ignore[arg-type] # these are bytes
        assert served.most_at_once > 1
        opened = served.bytes
        served.requests.clear()
        served.most_at_once = 0
        wanted = recording.connections(LARGE)
        assert sum(1 for _ in recording.messages(wanted)) == COUNT
        assert served.bytes + opened <= 1.2 * recording.size_bytes(wanted)
        assert served.most_at_once > 1
    assert read(url, LARGE) == read(local, LARGE)
    assert read(url, SMALL) == read(local, SMALL)


@pytest.mark.slow
def test_what_was_read_is_not_asked_for_again(served: Served, url: Location) -> None:
    with open_recording(url) as recording:
        recording.fingerprint()
    read(url, SMALL)
    served.requests.clear()
    with open_recording(url) as recording:
        recording.fingerprint()
    read(url, SMALL)
    assert len(served.requests) == 2  # whether it is still the same, for each opening


def until(holds: Callable[[], bool]) -> bool:
    """Whether something comes true within a time that is long enough on any machine."""
    end = time.monotonic() + 20
    while not holds() and time.monotonic() < end:
        time.sleep(0.01)
    return holds()


def test_chunks_are_fetched_ahead_of_need_but_not_all(
    served: Served, url: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading_plan, "AT_ONCE", 5)
    with open_recording(url) as recording:
        served.requests.clear()
        messages = recording.messages(recording.connections(LARGE))
        next(messages)
        assert until(lambda: len(served.requests) >= 5)  # without a second message having been asked for
        assert len(served.requests) < COUNT / 2


@pytest.mark.slow
def test_no_more_is_fetched_ahead_than_memory_may_hold(
    served: Served, url: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcap_landmarks.memory.bound", lambda: 8 * 130_000)
    served.delay_s = 0.01
    with open_recording(url) as recording:
        served.requests.clear()
        served.most_at_once = 0
        assert sum(1 for _ in recording.messages(recording.connections(LARGE))) == COUNT
        assert served.most_at_once <= 4  # three chunks of 40 kB, and the one that is read


@pytest.mark.slow
def test_a_dropped_connection_is_tried_again_then_named(served: Served, url: Location, local: Path) -> None:
    served.drops = 3
    assert read(url, SMALL) == read(local, SMALL)
    served.drops = 10_000
    with pytest.raises(RemoteError) as error:
        read(url, LARGE)
    problem = "the connection was dropped (4 tries); try again later"
    assert str(error.value) == f"{served.url(NAME)}?...: {problem}"


@pytest.mark.slow
def test_a_file_that_changes_is_no_mixture_of_both(served: Served, url: Location) -> None:
    with open_recording(url) as recording:
        served.files[NAME] = log_of(COUNT, seed=2)
        with pytest.raises(RemoteError, match=r"run\.mcap\?\.\.\.: it was changed while it was read; run again"):
            list(recording.messages(recording.connections(SMALL)))
    assert len(read(url, SMALL)) == COUNT


@pytest.mark.parametrize(
    ("status", "problem"),
    [
        (401, "there are no credentials for it; give user and password in ~/.netrc, or use a signed URL"),
        (403, "access is denied; give user and password in ~/.netrc, or use a signed URL"),
        (404, "there is no such file; check the URL"),
        (503, "the server answers 503 (4 tries); try again later, or ask who runs it"),
    ],
)
def test_what_a_server_refuses_is_said(served: Served, url: Location, status: int, problem: str) -> None:
    served.status = status
    for opening in (size_of, to_read, lambda place: read(place, SMALL)):
        with pytest.raises(RemoteError) as error:
            opening(url)
        assert str(error.value) == f"{served.url(NAME)}?...: {problem}"


@pytest.mark.usefixtures("served")
def test_a_host_that_is_not_there_is_named() -> None:
    with pytest.raises(RemoteError, match=r"^http://127\.0\.0\.1:9/a\.mcap: the host cannot be reached \(4 tries\); "):
        location("http://127.0.0.1:9/a.mcap").open("rb")


@pytest.mark.parametrize("gives_parts", [True, False])
def test_a_web_page_is_no_recording(served: Served, gives_parts: bool) -> None:
    served.gives_parts = gives_parts
    served.files["index"] = b"\n<!DOCTYPE html><html><body>Sign in</body></html>"
    with pytest.raises(RemoteError, match=r"/index: is a web page, not a recording; give the URL of the file itself"):
        location(served.url("index")).open("rb")


def test_a_server_without_parts_gives_the_whole_file_once(served: Served, url: Location, local: Path) -> None:
    served.gives_parts = False
    notes: list[str] = []
    with copies_shown(unwatched, notes.append):
        assert read(url, SMALL) == read(local, SMALL)
        assert read(url, LARGE) == read(local, LARGE)
        assert size_of(url) == local.stat().st_size
    problem = "its server gives no parts of files, so that all of it is copied first"
    assert notes == [f"note: {served.url(NAME)}?...: {problem}"]


@pytest.mark.slow
def test_a_file_without_summary_comes_in_large_pieces(served: Served, url: Location, local: Path) -> None:
    whole = served.files[NAME]
    assert isinstance(whole, bytes)
    served.files[NAME] = cut = whole[:-100]
    local_cut = local.with_name("cut.mcap")
    local_cut.write_bytes(cut)
    with open_recording(url) as recording, open_recording(local_cut) as same:
        assert (recording.losses, recording.index.counts) == (same.losses, same.index.counts)
        assert len(served.requests) <= 20
        assert recording.fingerprint() == same.fingerprint()
    assert read(url, LARGE) == read(local_cut, LARGE)


def test_reading_from_the_front_asks_for_little_more_than_the_file(served: Served, url: Location) -> None:
    size = len(served.files[NAME])  # type: ignore[arg-type] # these are bytes
    with open_recording(url, from_front=True) as recording:
        assert recording.index.counts == {1: COUNT, 2: COUNT}
    assert size <= served.bytes <= 1.2 * size
    assert len(served.requests) <= 20


def test_any_part_can_be_read(url: Location, content: bytes) -> None:
    with url.open("rb") as stream:
        assert stream.seek(-10, 2) == len(content) - 10
        assert stream.read() == content[-10:]
        assert stream.read(5) == b""
        assert stream.seek(100) == stream.tell() == 100
        assert stream.read(1_000_000) == content[100:1_000_100]
        buffer = bytearray(50)
        assert stream.readinto(buffer) == 50  # type: ignore[attr-defined] # raw streams have it
        assert bytes(buffer) == content[1_000_100:1_000_150]
    with pytest.raises(ValueError, match="closed"):
        stream.read(1)
