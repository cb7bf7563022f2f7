"""A verb over many logs from the command line: outputs, documents, exit codes, wrong usage."""

import json
import resource
from collections.abc import Iterator, Sequence
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.channels import ODOMETRY
from mcap_landmarks.cli.batch_events import EventLines
from mcap_landmarks.cli.batch_options import BatchOptions
from mcap_landmarks.cli.batch_reports import Report
from mcap_landmarks.cli.batch_run import run_batch
from mcap_landmarks.cli.batch_table import LiveTable, say_pace
from mcap_landmarks.cli.batch_tasks import tasks_of
from mcap_landmarks.errors import UsageError
from mcap_landmarks.fleet.cuts import over_memory
from mcap_landmarks.fleet.recorded_time import recorded_s
from mcap_landmarks.fleet.tasks import Ended, Started, Task, TaskLimits, Waits
from mcap_landmarks.recording.reader import open_recording

from tests.cli.calls import call, schema_of
from tests.cli.logs import messages, write
from tests.fleet.hanging_command import HangingWorkers


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs, one that is cut, one without odometry, one to hang at, one that is none, and a map."""
    here = tmp_path_factory.mktemp("batch")
    (here / "logs").mkdir()
    write(here / "logs" / "a.mcap", messages(seed=1, count=60))
    whole = write(here / "logs" / "b.mcap", messages(seed=2, count=60)).read_bytes()
    (here / "logs" / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (here / "logs" / "none.mcap").write_text("no recording")
    (here / "logs" / "hangs.mcap").write_bytes(whole)
    write(here / "logs" / "unsteered.mcap", [one for one in messages(seed=3, count=60) if one.channel != ODOMETRY])
    assert call("map", here / "logs" / "a.mcap", "--map", here / "a.db") == 0
    return here


@pytest.mark.slow
def test_one_that_fails_does_not_stop_the_others(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of six logs one is cut, one has no odometry, one hangs and one is none; the next run goes on with these."""
    monkeypatch.setattr(BatchOptions, "crew", lambda _options, _tasks: HangingWorkers())
    words = ("--map", folder / "a.db", "--set", "localize.max_sigma_m=0.4", "-o", tmp_path / "out")
    events = tmp_path / "events.jsonl"
    capsys.readouterr()
    line = ("batch", "localize", folder / "logs" / "*.mcap", *words, "--json")
    assert call(*line, "--time-limit", 1, "--events", events) == 3
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    jsonschema.validate(document, schema_of("batch"))
    became = {Path(log["log"]).stem: (log["outcome"], log["exit_code"], log["attempts"]) for log in document["logs"]}
    assert became == {
        "a": ("done", 0, 1),
        "b": ("done", 0, 1),
        "cut": ("partial", 3, 1),
        "hangs": ("failed", -9, 2),
        "none": ("failed", 1, 1),
        "unsteered": ("done", 0, 1),
    }
    jsonschema.validate(document["logs"][1]["result"], schema_of("localize"))
    jsonschema.validate(document["logs"][4]["result"], schema_of("error"))
    for said in (
        "none.mcap is not an MCAP file",
        "cut at byte",
        "hangs.mcap: localize was ended after its --time-limit of 1 s",
        "unsteered.mcap: 60 bundles without odometry at their time",
    ):
        assert said in printed.err
    made = ["a.mcap", "b.mcap", "cut.mcap", "unsteered.mcap"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == made
    with open_recording(tmp_path / "out" / "b.mcap") as recording:
        assert "0.4" in recording.metadata["mcap-landmarks.run"]["config"]
    told = [json.loads(text) for text in events.read_text().splitlines()]
    for event in told:
        jsonschema.validate(event, schema_of("batch_event"))
    assert [event["event"] for event in told if "hangs" in event["log"]] == ["started", "retried", "ended"]

    assert call("batch", "localize", *(folder / "logs" / f"{name}.mcap" for name in ("a", "b")), *words) == 0
    printed = capsys.readouterr().out
    assert "2 skipped" in printed
    assert " of recording in " not in printed, "nothing was worked on"


@pytest.mark.slow
def test_documents_of_evaluate_are_kept(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = tmp_path / "a.mcap"
    assert call("localize", folder / "logs" / "a.mcap", "--map", folder / "a.db", "-o", result) == 0
    assert call("batch", "evaluate", result, "--align", "-o", tmp_path / "figures") == 0
    assert "1 done" in capsys.readouterr().out
    jsonschema.validate(json.loads((tmp_path / "figures" / "a.json").read_text()), schema_of("evaluate"))
    again = ("batch", "evaluate", result, "--align", "-o", tmp_path / "figures")
    assert call(*again) == 2
    assert "replace it with --overwrite" in capsys.readouterr().err


@pytest.mark.slow
def test_one_map_of_all_logs(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The bytes of `map` in one process; what is no log is named, and what the others gave is taken again."""
    logs, out = folder / "logs", tmp_path / "out"
    words = ("batch", "map", logs / "[ab].mcap", "-o", out, "--workers", 2, "--json")
    assert call(*words[:3], logs / "none.mcap", *words[3:]) == 3
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    jsonschema.validate(document, schema_of("batch"))
    assert [log["outcome"] for log in document["logs"]] == ["done", "done", "failed"]
    jsonschema.validate(document["logs"][0]["result"], schema_of("map_log"))
    jsonschema.validate(document["map"], schema_of("map"))
    assert len(document["map"]["logs"]) == 2
    assert "none.mcap is not an MCAP file" in printed.err
    assert len(list((out / ".map.db.parts").glob("*.npz"))) == 2
    made = (out / "map.db").read_bytes()
    one = ("map", logs / "b.mcap", logs / "a.mcap", "--map", tmp_path / "one.db", "--set", "detect.threads=1")
    assert call(*one) == 0
    assert made == (tmp_path / "one.db").read_bytes()
    capsys.readouterr()
    assert call(*words) == 0
    assert json.loads(capsys.readouterr().out)["map"]["stages"]["build_map"] == "reused"
    assert (out / "map.db").read_bytes() == made
    assert [path.name for path in out.iterdir()] == ["map.db"]


@pytest.mark.slow
def test_all_failed(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("batch", "map", folder / "logs" / "none.mcap", "-o", tmp_path / "maps") == 1
    assert "1 failed" in capsys.readouterr().out
    assert not (tmp_path / "maps").exists()


def test_wrong_usage_runs_nothing(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = folder / "logs" / "a.mcap", tmp_path / "out"
    manifest = tmp_path / "fleet.toml"
    manifest.write_text(f'[options]\nscan = "/scan"\n[[log]]\npath = "{log}"\n')
    for words, reason in (
        (("batch", "plot", log), "no such verb"),
        (("batch", "localize", log, "--mapp", "x.db"), "--mapp is no option of localize"),
        (("batch", "localize", log), "Missing option '--map'"),
        (("batch", "localize", "--map", "x.db"), "name the logs, a quoted pattern"),
        (("batch", "map", log, "--from-reference"), "--from-reference is for one log, and batch map has many"),
        (
            ("batch", "detect", log, "--segments", "5"),
            "batch detect has many; leave it out, as --workers logs",
        ),
        (("batch", "evaluate", log, "--tum", "x.tum"), "--tum names one file"),
        (("batch", "evaluate", tmp_path / "*.mcap"), "no file matches"),
        (("batch", "evaluate", log, "--time-limit", 0), "--time-limit 0.0: give seconds, more than none"),
        (("batch", "evaluate", log, "--memory-limit", "much"), "--memory-limit much: give a size such as"),
        (("batch", "evaluate", log, "--events", "-", "--json"), "both print to stdout"),
        (("batch", "evaluate", manifest), "--scan is no option of evaluate"),
    ):
        assert call(*words, "-o", out) == 2
        assert reason in capsys.readouterr().err
    assert not out.exists() or not list(out.iterdir())


@pytest.mark.parametrize(
    ("verb", "table", "said"),
    [
        (
            "localize",
            '[options]\noutput = "x"',
            "[options]: output: batch sets this itself; -o of batch and `name` say",
        ),
        ("localize", "[options]\nworkers = 2", "[options]: workers: batch sets this itself; give --workers to batch"),
        ("localize", "[options]\njson = true", "[options]: json: batch sets this itself"),
        ("map", '[options]\nmap = "x.db"', "[options]: map: batch sets this itself"),
        ("localize", '[options]\nforce = "yes"', "[options]: force = 'yes': force is a flag; give true or false"),
        ("localize", "[options]\nodom = true", "[options]: odom = true: odom takes a value"),
        ("localize", "[options]\nhelp = true", "[options]: help: --help is no option of localize"),
        ("localize", '[options]\nmap = "no.db"', "[options]: map = 'no.db': there is no such file"),
        ("localize", 'options.start = "noon"', "[[log]] 1: options.start = noon: give RFC 3339"),
        ("localize", 'options.image-rate = "x"', "[[log]] 1: options.image-rate: no value of --image-rate; see"),
        ("localize", 'options.set = ["detect.confidence=x"]', "[[log]] 1: options.set: detect.confidence = 'x'"),
        (
            "localize",
            'options.model = "nonet"',
            "[[log]] 1: options.model: --model nonet: neither a file",
        ),
        ("map", 'options.prior = "no.db"', "[[log]] 1: options.prior = 'no.db': there is no such file"),
    ],
)
def test_a_manifest_is_refused_by_file_table_and_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, table: str, said: str
) -> None:
    """Before anything runs, also where the mistake is one that only the verb's own options tell."""
    (tmp_path / "a.mcap").touch()
    manifest = tmp_path / "fleet.toml"
    log = '[[log]]\npath = "a.mcap"\n'
    manifest.write_text(f"{table}\n{log}" if table.startswith("[") else f"{log}{table}\n")
    more = () if "map =" in table or verb == "map" else ("--map", tmp_path / "a.mcap")
    assert call("batch", verb, manifest, *more, "-o", tmp_path / "out") == 2
    assert f"error: {manifest}: {said}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("cached_network")
def test_files_and_folders_that_no_worker_could_read_are_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Names of networks are no files, and bags are logs."""
    config = tmp_path / "site.toml"
    config.write_text('[detect]\nmodel = "no.onnx"\n')
    log, bag = tmp_path / "logs" / "a.mcap", tmp_path / "bag"
    log.parent.mkdir()
    bag.mkdir()
    (bag / "metadata.yaml").touch()
    for file in (log, bag / "a.mcap", tmp_path / "a.db"):
        file.touch()
    words = ("--map", str(tmp_path / "a.db"))
    for given, reason in (
        ((log, "--map", "no.db"), "error: --map no.db: there is no such file"),
        ((log, *words, "--model", "no.onnx"), "error: --model no.onnx: there is no such file"),
        ((log, *words, "--model", "nonet"), "error: --model nonet: neither a file nor a network here"),
        ((log, *words, "--set", "detect.model=no.onnx"), "--set: detect.model = 'no.onnx': there is no such file"),
        ((log, *words, "--config", config), f"{config}: detect.model = 'no.onnx': there is no such file"),
        ((log, *words, "--set", "detect.confidense=1"), "confidense is no setting of detect"),
        ((log, *words, "--start", "noon"), "error: --start noon: give RFC 3339"),
        ((log.parent, *words), f"logs is a folder of recordings; name them: '{log.parent}/*.mcap'"),
        ((log,), "Try 'mcap-landmarks localize --help'"),
    ):
        assert call("batch", "localize", *given, "-o", tmp_path / "out") == 2
        assert reason in capsys.readouterr().err
    assert len(tasks_of("localize", [str(log), str(bag), *words, "--model", "nanodet"], tmp_path / "out")) == 2


def test_a_memory_limit_is_said_as_it_was_written() -> None:
    ended = over_memory(TASK, BatchOptions(memory_limit="50M").limits(), 1.0, 60_000_000, 1)
    assert "took 60.0 MB, more than its --memory-limit of 50M; give it more" in ended.stderr


TASK = Task(Path("a.mcap"), Path("out/a.mcap"), ("localize", "a.mcap"))
ENDED = Ended(TASK, 0, "", "", 2.0, 1_000_000, 2)
REPORT = Report(
    log="a.mcap",
    output="out/a.mcap",
    outcome="done",
    exit_code=0,
    seconds=2.0,
    peak_bytes=1_000_000,
    attempts=2,
    errors=[],
    notes=[],
    result=None,
)


def test_the_table_shows_what_runs_and_what_ended(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    table = LiveTable("localize", 3, draws=True)
    table.started(TASK, 1)
    clock[0] = 90.0
    assert table.rows() == [("a.mcap", "runs", "1:30"), ("localize: 0 of 3 logs, none ended", "", "")]
    table.waits(TASK)
    clock[0] = 92.0
    assert table.rows()[0] == ("a.mcap", "waits to run again", "0:02")
    table.started(TASK, 2)
    assert table.rows()[0] == ("a.mcap", "runs again", "0:00")
    clock[0] = 120.0
    table.ended(REPORT, ENDED)
    assert table.rows() == [("localize: 1 of 3 logs, 1 done", "0.5 logs/min", "4:00 left")]
    assert capsys.readouterr().err == ""
    LiveTable("localize", 3, draws=False).ended(REPORT, ENDED)
    assert capsys.readouterr().err == "a.mcap: done (2.0 s)\n"


def test_events_are_lines_that_are_there_at_once(tmp_path: Path) -> None:
    with (tmp_path / "events").open("w") as stream:
        lines = EventLines(stream)
        lines.started(TASK, 7)
        lines.started(TASK, 8)
        lines.ended(REPORT, ENDED)
        told = [json.loads(line) for line in (tmp_path / "events").read_text().splitlines()]
    for event in told:
        jsonschema.validate(event, schema_of("batch_event"))
    assert [(event["event"], event.get("worker")) for event in told] == [
        ("started", 7),
        ("retried", 8),
        ("ended", None),
    ]


def test_the_pace_is_told_by_how_long_recordings_last(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, none = write(tmp_path / "a.mcap", messages(count=61)), tmp_path / "none.mcap"
    none.touch()
    whole, part = Task(log, none, ("cluster",)), Task(log, none, ("cluster", "--end=1"))
    assert recorded_s([whole, whole, part, Task(none, log, ("cluster",))]) == pytest.approx(60.0)
    say_pace(7200.0, 1800.0)
    assert capsys.readouterr().out == "2:00:00 of recording in 30:00: 4.0 times as fast as it lasts\n"


class Stopped:
    """Workers of which one ends and the next hears Ctrl-C."""

    def run(self, tasks: Sequence[Task], _limits: TaskLimits, _started: Started, _waits: Waits) -> Iterator[Ended]:
        """See `fleet.tasks.Workers`."""
        yield Ended(tasks[0], 0, "", "", 1.0, None, 1)
        raise KeyboardInterrupt


def test_ctrl_c_tells_what_is_finished(capsys: pytest.CaptureFixture[str]) -> None:
    tasks = [Task(Path(f"{name}.mcap"), Path(f"out/{name}.mcap"), ("localize",)) for name in "abc"]
    with pytest.raises(KeyboardInterrupt):
        run_batch("localize", tasks, Stopped(), TaskLimits(), [])
    assert "1 of 3 logs are finished; the same command goes on with the others" in capsys.readouterr().err


def test_many_documents_need_no_more_open_files_than_few(tmp_path: Path) -> None:
    for number in range(300):
        (tmp_path / f"{number}.mcap").touch()
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, before[1]))
    try:
        tasks = tasks_of("evaluate", [str(tmp_path / "*.mcap")], tmp_path / "figures")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert len(tasks) == 300
    Path(str(tasks[7].output)).write_text("{}")
    with pytest.raises(UsageError, match="replace it with --overwrite"):
        tasks_of("evaluate", [str(tmp_path / "*.mcap")], tmp_path / "figures")
