"""Recordings in a store that speaks S3: what is fetched and listed, and what is said when that fails."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import fsspec
import pytest
from mcap_landmarks.errors import RemoteError, UsageError
from mcap_landmarks.locations import is_folder, location, matching, to_read
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.remote import kept_parts, refusals
from moto.moto_server.werkzeug_app import DomainDispatcherApplication

from tests.cli.calls import call, refused
from tests.remote.logs import LARGE, log_of
from tests.remote.object_store import Bucket

COUNT = 60
Asked = list[tuple[str, str, int]]
"""Method, range, and bytes of each answer."""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    """What the store was asked for, and gave."""
    found: Asked = []
    answer = DomainDispatcherApplication.__call__

    def counting(self: object, environ: dict[str, str], start: object) -> list[bytes]:
        body = [bytes(piece) for piece in answer(self, environ, start)]
        found.append((environ["REQUEST_METHOD"], environ.get("HTTP_RANGE", ""), sum(map(len, body))))
        return body

    monkeypatch.setattr(DomainDispatcherApplication, "__call__", counting)
    kept_parts.ALL.forget()
    return found


@pytest.mark.slow
def test_one_topic_is_the_bytes_of_its_chunks(bucket: Bucket, asked: Asked, tmp_path: Path) -> None:
    content = log_of(COUNT)
    local = tmp_path / "run.mcap"
    local.write_bytes(content)
    url = location(bucket.write("a/run.mcap", content))
    asked.clear()
    with open_recording(url) as recording, open_recording(local) as same:
        assert recording.fingerprint() == same.fingerprint()
        wanted = recording.connections(LARGE)
        found = [bytes(message.data) for message in recording.messages(wanted)]
        assert found == [bytes(message.data) for message in same.messages(same.connections(LARGE))]
        given = [size for method, _, size in asked if method == "GET"]
        assert sum(given) <= 1.2 * recording.size_bytes(wanted)
        assert len(given) <= 2 * COUNT + COUNT + 4
    assert all(range_ for method, range_, _ in asked if method == "GET")  # never the whole file
    assert len([method for method, _, _ in asked if method == "HEAD"]) == 1


@pytest.mark.slow
def test_a_file_that_changes_is_refused_by_the_store(bucket: Bucket) -> None:
    url = location(bucket.write("run.mcap", log_of(COUNT)))
    with open_recording(url) as recording:
        bucket.write("run.mcap", log_of(COUNT, seed=2))
        with pytest.raises(RemoteError, match=r"run\.mcap: it was changed while it was read; run again"):
            list(recording.messages())


@pytest.mark.parametrize(("scheme", "name"), [("gs", "bucket"), ("az", "container")])
def test_a_bucket_is_called_what_its_store_calls_it(scheme: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mcap_landmarks.remote.stored_file.store", lambda _text: (None, "here"))
    with pytest.raises(RemoteError, match=f"{scheme}://here: names a {name}, not a file; name a file, as {scheme}://"):
        location(f"{scheme}://here").open("rb")


def test_what_is_not_there_is_named(bucket: Bucket) -> None:
    bucket.write("folder/a.mcap", b"a")
    for url, problem in (
        (bucket.url("no.mcap"), "there is no such file; check the URL"),
        (bucket.url("folder"), "it is a folder; name a file in it"),
        ("s3://no-such-bucket-at-all/a.mcap", "there is no such bucket; check its name"),
        (f"s3://{bucket.name}", "names a bucket, not a file; name a file, as s3://BUCKET/NAME"),
        ("s3://", "names neither a bucket nor a file; name a file, as s3://BUCKET/NAME"),
        ("memory://no/a.mcap", "there is no such file; check the URL"),
    ):
        with pytest.raises(RemoteError) as error:
            location(url).open("rb")
        assert str(error.value) == f"{url}: {problem}"


@pytest.fixture
def fresh() -> Iterator[None]:
    """File systems that are made anew, as in a process that begins, before and after."""
    fsspec.filesystem("s3").clear_instance_cache()
    yield
    fsspec.filesystem("s3").clear_instance_cache()


@pytest.mark.usefixtures("fresh")
def test_without_credentials_it_says_which_are_looked_for(
    bucket: Bucket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = location(bucket.write("a.mcap", b"a"))
    fsspec.filesystem("s3").clear_instance_cache()
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    for name in ("AWS_SHARED_CREDENTIALS_FILE", "AWS_CONFIG_FILE"):
        monkeypatch.setenv(name, str(tmp_path / "none"))
    with pytest.raises(RemoteError, match=r"there are no credentials for it; set AWS_ACCESS_KEY_ID and AWS_SECRET"):
        url.open("rb")


@pytest.mark.usefixtures("fresh")
def test_a_store_that_is_not_there_is_named(bucket: Bucket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refusals, "PAUSES_S", (0.0,))
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.delenv("AWS_MAX_ATTEMPTS", raising=False)  # the tries are ours, none of them botocore's
    with pytest.raises(RemoteError, match=rf"^s3://{bucket.name}/a: the host cannot be reached \(2 tries\); "):
        location(bucket.url("a")).open("rb")


def test_a_library_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gcsfs", None)
    with pytest.raises(UsageError) as error:
        location("gs://bucket/a.mcap").open("rb")
    assert str(error.value) == (
        "gs://bucket/a.mcap: gcsfs, which reads such URLs, is not installed; pip install 'mcap-landmarks[gcs]'"
    )


@pytest.mark.slow
def test_prefixes_and_patterns_name_files_by_name(bucket: Bucket) -> None:
    for name in ("day/b.mcap", "day/a.mcap", "day/deep/c.mcap", "day/notes.txt", "night/d.mcap", "day/empty/"):
        bucket.write(name, b"1")

    def found(name: str) -> list[str]:
        return [str(place).removeprefix(bucket.url("")) for place in matching(location(bucket.url(name)))]

    assert found("day") == found("day/") == ["day/a.mcap", "day/b.mcap", "day/deep/c.mcap", "day/notes.txt"]
    assert found("day/*.mcap") == ["day/a.mcap", "day/b.mcap"]
    assert found("**/*.mcap") == ["day/a.mcap", "day/b.mcap", "day/deep/c.mcap", "night/d.mcap"]
    assert found("day/a.mcap") == ["day/a.mcap"]
    assert is_folder(location(bucket.url("day")))
    assert not is_folder(location(bucket.url("day/a.mcap")))
    with pytest.raises(UsageError, match="there is no such file, and none below it; check the URL"):
        found("dawn")
    with pytest.raises(UsageError, match=r"\*\.bag: no file matches; quote the pattern and check the folder"):
        found("day/*.bag")


def test_a_web_server_lists_nothing() -> None:
    with pytest.raises(UsageError, match=r"^https://host/\*\.mcap: a web server does not list its files; "):
        matching(location("https://host/*.mcap"))


def test_a_copy_is_made_once_and_anew_when_the_file_was_changed(bucket: Bucket, asked: Asked) -> None:
    url = location(bucket.write("map.db", b"first"))
    first = to_read(url)
    asked.clear()
    assert (to_read(url), first.read_bytes(), first.name) == (first, b"first", "map.db")
    assert {method for method, _, _ in asked} == {"HEAD"}
    bucket.write("map.db", b"second")
    assert to_read(url).read_bytes() == b"second"
    assert first.read_bytes() == b"first"  # who has it open reads on


def test_a_folder_is_copied_whole(bucket: Bucket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mcap_landmarks.remote.folder_copies._SMALL", 10)
    contents = {"a.png": b"small", "images/0.png": b"larger than ten bytes", "images/1.png": b"1"}
    for name, content in contents.items():
        bucket.write(f"kitti/{name}", content)
    bucket.write("kitti2/no.png", b"not of it")
    folder = to_read(location(bucket.url("kitti")))
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert (files, folder.name) == (contents, "kitti")
    assert to_read(location(bucket.url("kitti/"))).name == "kitti"


def test_what_lies_beside_the_file_of_a_bag_comes_with_it(bucket: Bucket) -> None:
    bucket.write("bag/metadata.yaml", b"about")
    copy = to_read(location(bucket.write("bag/bag_0.db3", b"messages")))
    assert {path.name: path.read_bytes() for path in copy.parent.iterdir()} == {
        "bag_0.db3": b"messages",
        "metadata.yaml": b"about",
    }


def test_a_copy_goes_by_the_url_that_was_named(bucket: Bucket, capsys: pytest.CaptureFixture[str]) -> None:
    url = bucket.write("a.mcap", b"no recording at all")
    assert refused(capsys, 1, "recover", url, "-o", "b.mcap").startswith(f"error: {url} is not an MCAP file")
    capsys.readouterr()
    assert call("recover", url, "-o", "b.mcap", "--json") == 1
    assert json.loads(capsys.readouterr().out)["error"].startswith(url)


def test_a_copy_for_which_there_is_no_room_is_refused(bucket: Bucket, monkeypatch: pytest.MonkeyPatch) -> None:
    url = location(bucket.write("large.bag", b"12345"))
    monkeypatch.setattr("shutil.disk_usage", lambda _where: SimpleNamespace(free=2))
    with pytest.raises(RemoteError, match=r"does not fit \(5 bytes, 2 bytes are free\); set TMPDIR"):
        to_read(url)
