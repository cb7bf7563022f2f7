"""What a user names: paths stay paths, URLs stay as they were written and are refused where they would be opened."""

from pathlib import Path

import pytest
from mcap_landmarks.atomic import atomic_file
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Url, location, size_of, to_read, to_write

URLS = ("https://host.example/logs/run.1.mcap?signature=a/b.c", "s3://bucket/run.1.mcap", "gs://b/a//run.1.mcap#x")


@pytest.mark.parametrize("text", URLS)
def test_a_url_is_shown_as_it_was_written(text: str) -> None:
    url = location(text)
    assert str(url) == text
    assert (url.name, url.stem, url.suffix) == ("run.1.mcap", "run.1", ".mcap")
    assert url == Url(text)
    assert len({url, location(text)}) == 1


@pytest.mark.parametrize(
    "text", ["log.mcap", "/a/b/log.mcap", "../log.mcap", "a:b.mcap", "https:/x", "x/https://y", "c://x"]
)
def test_everything_else_is_a_path(text: str) -> None:
    assert location(text) == Path(text)
    assert location(Path(text)) == Path(text)


@pytest.mark.parametrize("text", URLS)
def test_what_would_be_opened_there_says_what_to_do(text: str) -> None:
    url = location(text)
    for reading in (lambda: to_read(url), lambda: url.open("rb"), lambda: size_of(url)):
        with pytest.raises(UsageError) as error:
            reading()
        assert str(error.value) == f"{text}: URLs cannot be read yet; download it first"
    with pytest.raises(UsageError) as error, atomic_file(url):
        pass
    assert str(error.value) == f"{text}: URLs cannot be written yet; write to a file and upload that"


def test_paths_pass_and_have_sizes(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text("four")
    assert to_read(file) is to_write(file) is file
    assert [size_of(path) for path in (file, tmp_path, tmp_path / "missing")] == [4, 0, 0]
