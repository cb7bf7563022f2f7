"""What a user names: paths stay paths, URLs stay as they were written but for their secrets."""

import pickle
from pathlib import Path

import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Url, is_folder, location, matching, size_of, to_read

URLS = ("https://host.example/logs/run.1.mcap?signature=a/b.c", "s3://bucket/run.1.mcap", "gs://b/a//run.1.mcap#x")


@pytest.mark.parametrize("text", URLS)
def test_a_url_is_shown_without_what_may_be_secret(text: str) -> None:
    url = location(text)
    assert str(url) == text.replace("signature=a/b.c", "...")
    assert repr(url) == f"Url({str(url)!r})"
    assert (url.name, url.stem, url.suffix) == ("run.1.mcap", "run.1", ".mcap")
    assert url == Url(text)
    assert len({url, location(text)}) == 1
    assert pickle.loads(pickle.dumps(url)).text == text  # noqa: S301 # tasks hold locations


@pytest.mark.parametrize(
    "text", ["log.mcap", "/a/b/log.mcap", "../log.mcap", "a:b.mcap", "https:/x", "x/https://y", "c://x"]
)
def test_everything_else_is_a_path(text: str) -> None:
    assert location(text) == Path(text)
    assert location(Path(text)) == Path(text)


def test_a_file_url_is_a_path() -> None:
    assert location("file:///a%20b/log.mcap") == location("FILE://localhost/a%20b/log.mcap") == Path("/a b/log.mcap")
    with pytest.raises(UsageError, match=r"file://host/a is a file of another host; "):
        location("file://host/a")


@pytest.mark.parametrize("text", ["http://[::1/log.mcap", "s3://a]b/log.mcap", "file://[a/log.mcap"])
def test_a_host_that_nothing_can_have_is_refused_at_once(text: str) -> None:
    with pytest.raises(UsageError, match=r"log\.mcap is no URL \(.+\); check its host"):
        location(text)


@pytest.mark.parametrize("text", ["s3://bucket/out", "s3://bucket/out/"])
def test_names_in_a_folder_and_beside_a_file(text: str) -> None:
    assert location(text) / "a.mcap" == Url("s3://bucket/out/a.mcap")
    assert location(text).with_name("b.mcap") == Url("s3://bucket/b.mcap")
    assert (location("out") / "a.mcap").with_name("b.mcap") == Path("out/b.mcap")


@pytest.mark.parametrize(
    "text", ["s3://key:secret@bucket/a", "https://user:secret@host/a", "https://secret@host/a", "abfs://c:secret@h/a"]
)
def test_a_password_in_a_url_is_refused_and_not_shown(text: str) -> None:
    with pytest.raises(UsageError, match="credentials come from the environment") as error:
        location(text)
    assert "secret" not in str(error.value)
    assert location("abfs://container@account.example/a")


def test_a_scheme_that_nobody_reads_says_which_are() -> None:
    for reading in (lambda url: url.open("rb"), to_read, size_of, matching, is_folder):
        with pytest.raises(UsageError, match=r"^ftp://host/a: URLs of this scheme cannot be read .*s3://"):
            reading(location("ftp://host/a"))


def test_paths_pass_and_have_sizes(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text("four")
    assert to_read(file) is file
    assert [size_of(path) for path in (file, tmp_path, tmp_path / "missing")] == [4, 0, 0]
