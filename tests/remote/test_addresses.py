"""No credential that can stand in a URL is shown, wherever in it it stands."""

import pytest
from mcap_landmarks.remote.addresses import redacted, shown


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("s3://bucket/a b/run.mcap", "s3://bucket/a b/run.mcap"),
        ("https://user:secret@host:8080/a.mcap", "https://...@host:8080/a.mcap"),
        ("https://secret@host/a.mcap?x-amz-signature=secret&y=1#secret", "https://...@host/a.mcap?..."),
        ("https://host/a@b.mcap#secret", "https://host/a@b.mcap#..."),
        ("https://host?token=secret/a@b", "https://host?..."),
        ("https://user:se@cret@host/a", "https://...@host/a"),
        ("s3://key:secret@bucket/a.mcap?versionId=secret", "s3://...@bucket/a.mcap?..."),
        (
            "abfs://container@account.dfs.core.windows.net/a.mcap",
            "abfs://container@account.dfs.core.windows.net/a.mcap",
        ),
        ("abfss://user:secret@account.dfs.core.windows.net/a", "abfss://...@account.dfs.core.windows.net/a"),
        ("gs://bucket/a#17", "gs://bucket/a#17"),
    ],
)
def test_a_url_is_shown_without_secrets(text: str, expected: str) -> None:
    assert shown(text) == expected
    assert shown(shown(text)) == expected


def test_urls_in_what_others_say_are_redacted() -> None:
    said = "404, message='Not Found', url='https://host/a?sig=secret' (and s3://key:secret@b/c)"
    assert redacted(said) == "404, message='Not Found', url='https://host/a?...' (and s3://...@b/c)"
