"""What may be secret in the environment and in URLs stands in nothing that a run leaves: texts, outputs, parts."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap_landmarks.catalogue.catalogue_file import read_catalogue

from tests.cli.calls import call
from tests.cli.logs import messages, write
from tests.diff.recordings import localized_log
from tests.remote.object_store import KEY, SECRET, Bucket
from tests.remote.range_server import Served, serving

SIGNATURE, TOKEN, PASSWORD = "plantedSignature0123", "plantedSasToken4567", "plantedPassword89"
PLANTED = [text.encode() for text in (KEY, SECRET, SIGNATURE, TOKEN, PASSWORD)]
QUERY = f"?X-Amz-Credential={KEY}&X-Amz-Signature={SIGNATURE}&sig={TOKEN}"


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A web server with a log, a map of it and a result."""
    folder = tmp_path_factory.mktemp("served")
    log = write(folder / "log.mcap", messages(count=40))
    assert call("map", log, "--map", folder / "map.db") == 0
    localized_log(folder / "result.mcap")
    with serving() as server:
        server.files |= {path.name: path for path in folder.iterdir()}
        server.files["none.mcap"] = b"no recording"
        yield server


def signed(served: Served, name: str) -> str:
    return served.url(name) + QUERY


def check_clean(printed: pytest.CaptureFixture[str], *folders: Path) -> str:
    """What was printed; neither that nor any file below the folders has anything that was planted."""
    told = printed.readouterr()
    texts = {"stdout": told.out.encode(), "stderr": told.err.encode()}
    for folder in folders:
        texts |= {f"{path} {path.name}": path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        assert not [path for path in folder.rglob("*") if any(text.decode() in str(path) for text in PLANTED)]
    assert [(name, text) for name, content in texts.items() for text in PLANTED if text in content] == []
    return told.out + told.err


@pytest.mark.slow
def test_nothing_that_was_planted_comes_out(
    served: Served, bucket: Bucket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(tmp_path / "cache"))
    log, database, out = signed(served, "log.mcap"), signed(served, "map.db"), tmp_path / "out"
    out.mkdir()
    localize = ("localize", log, "--map", database)
    assert call(*localize, "-o", out / "local.mcap", "--json") == 0
    assert call(*localize, "-o", bucket.url("a.mcap")) == 0
    (out / "fetched.mcap").write_bytes(bucket.read("a.mcap"))
    with monkeypatch.context() as patch:
        patch.setattr(
            "mcap_landmarks.remote.staged_outputs.send_file", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt)
        )
        assert call(*localize, "-o", bucket.url("interrupted.mcap")) == 130
    assert list((tmp_path / "cache").rglob("*.parts/*.mcap"))
    for verb in ("info", "evaluate"):
        assert call(verb, signed(served, "result.mcap"), "--json") == 0
    assert call("report", signed(served, "result.mcap"), out / "local.mcap", "-o", out / "fleet.html") == 0
    assert call("report", signed(served, "result.mcap"), "-o", out / "page.html") == 0
    assert call("diff", signed(served, "result.mcap"), signed(served, "result.mcap")) == 0
    named = ("--catalogue", bucket.url("runs.db"), "--events", out / "events.jsonl", "--workers", 1)
    assert call("batch", *localize, signed(served, "none.mcap"), "-o", bucket.url("batch/"), *named) == 3
    (out / "runs.db").write_bytes(bucket.read("runs.db"))
    done, failed = read_catalogue(out / "runs.db").rows
    assert (done["output"], failed["output"]) == (bucket.url("batch/log.mcap"), None)
    assert (done["log"], done["bundles"]) == (f"{served.url('log.mcap')}?...", 40)
    assert call("report", bucket.url("runs.db"), "-o", out / "catalogue.html") == 3
    text = check_clean(capsys, out, tmp_path / "cache")
    assert f"{served.url('log.mcap')}?..." in text or f"{served.url('result.mcap')}?..." in text


@pytest.mark.slow
def test_errors_show_nothing_that_was_planted(
    served: Served, bucket: Bucket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MCAP_LANDMARKS_CACHE", str(tmp_path / "cache"))
    out = tmp_path / "out.mcap"
    assert call("localize", signed(served, "missing.mcap"), "--map", signed(served, "map.db"), "-o", out) == 1
    assert call("localize", signed(served, "log.mcap"), "--map", signed(served, "log.mcap"), "-o", out) == 1
    assert call("info", f"https://user:{PASSWORD}@host.example/a.mcap") == 2
    assert call("info", f"s3://{KEY}:{PASSWORD}@{bucket.name}/a.mcap") == 2
    assert call("recover", signed(served, "log.mcap"), "-o", f"https://host.example/a.mcap{QUERY}") == 2
    assert call("recover", signed(served, "log.mcap"), "-o", "s3://bucket-that-nobody-has/a.mcap") == 1
    assert call("info", f"az://container/a.mcap?sig={TOKEN}") in {1, 2}
    text = check_clean(capsys, tmp_path)
    assert "credentials come from the environment" in text
