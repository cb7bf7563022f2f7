"""Results are reused if and only if everything that they were made from is the same."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer as McapWriter
from mcap_landmarks.channels import DETECTIONS, MATCH, ODOMETRY, SCENE_OBJECTS, TF
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs import session
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.pipeline import LogRun, run_stages
from mcap_landmarks.runs.plan import Request, Step
from mcap_landmarks.runs.thinning import Thinning
from mcap_landmarks.stage import Stamped

from tests.cli.calls import topics
from tests.maps.examples import small_map
from tests.runs.chain import COUNT, STEP_NS, counted, raw_log, raw_messages, two_posts

FRONT = ["detect", "cluster", "fuse"]
ALL = [*FRONT, "localize"]


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A folder with a log, a detector and a map."""
    raw_log(tmp_path / "log.mcap")
    two_posts(tmp_path / "model.onnx")
    write_map(tmp_path / "map.db", small_map())
    return tmp_path


def asked(here: Path, log: str = "log.mcap", **changes: object) -> Request:
    files = {"model": here / "model.onnx", "map": here / "map.db"}
    return dataclasses.replace(Request(here / log, files=files), **changes)  # type: ignore[arg-type] # fields of it


def states(run: LogRun) -> dict[str, str]:
    return {stage.stage: stage.state for stage in run.stages}


def reasons(run: LogRun) -> dict[str, str]:
    return {stage.stage: stage.reason for stage in run.stages}


@pytest.mark.slow
def test_a_chain_leaves_all_channels_and_no_parts(here: Path) -> None:
    run = run_stages(asked(here), here / "out.mcap", ALL, "run")
    assert states(run) == dict.fromkeys(["cluster", "detect", "fuse", "localize"], "ran")
    found = topics(here / "out.mcap")
    assert topics(here / "log.mcap").items() <= found.items()
    assert found[DETECTIONS.topic] == found["/landmarks/scan_objects"] == found[SCENE_OBJECTS.topic] == COUNT
    assert found[MATCH.topic] == COUNT
    assert sorted(path.name for path in here.iterdir()) == ["log.mcap", "map.db", "model.onnx", "out.mcap"]


def test_a_second_run_reuses_everything(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks, out = counted(monkeypatch), here / "out.mcap"
    run_stages(asked(here), out, ALL, "run")
    first = out.read_bytes()
    again = run_stages(asked(here), out, ALL, "run")
    assert set(states(again).values()) == {"reused"}
    assert set(reasons(again).values()) == {"the same results are in the earlier output"}
    assert again.stages[-1].outcome.bundles == COUNT
    assert out.read_bytes() == first
    assert len(looks) == COUNT
    forced = run_stages(asked(here, force=True), out, ALL, "run")
    assert set(states(forced).values()) == {"ran"}
    assert out.read_bytes() == first
    assert len(looks) == 2 * COUNT


@pytest.mark.slow
def test_a_fusion_parameter_runs_fuse_and_what_follows(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks, out = counted(monkeypatch), here / "out.mcap"
    run_stages(asked(here), out, ALL, "run")
    run = run_stages(asked(here, settings={"fuse": {"bearing_gate": 4.0}}), out, ALL, "run")
    assert states(run) == {"cluster": "reused", "detect": "reused", "fuse": "ran", "localize": "ran"}
    assert reasons(run)["fuse"] == "bearing_gate changed since the results in the earlier output"
    assert reasons(run)["localize"] == "the results of fuse changed since the results in the earlier output"
    assert len(looks) == COUNT


def test_results_are_found_in_the_log_itself(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks = counted(monkeypatch)
    run_stages(asked(here), here / "a.mcap", FRONT, "run")
    (here / "log.mcap").unlink()
    (here / "a.mcap").rename(here / "renamed.mcap")
    run = run_stages(asked(here, "renamed.mcap"), here / "b.mcap", ["localize"], "localize", lacking=True)
    assert states(run) == {"cluster": "reused", "detect": "reused", "fuse": "reused", "localize": "ran"}
    assert reasons(run)["detect"] == "the same results are in the log"
    assert len(looks) == COUNT


@pytest.mark.slow
def test_it_does_not_matter_where_results_came_from(here: Path) -> None:
    run_stages(asked(here), here / "whole.mcap", ALL, "run")
    run_stages(asked(here), here / "a.mcap", ["detect"], "run")
    run_stages(asked(here, "a.mcap"), here / "b.mcap", ["fuse", "cluster"], "run")
    run_stages(asked(here, "b.mcap"), here / "c.mcap", ["localize"], "run")
    assert (here / "c.mcap").read_bytes() == (here / "whole.mcap").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "ran", "reason"),
    [
        ({"settings": {"detect": {"confidence": 0.5}}}, {"detect", "fuse"}, "confidence changed"),
        ({"settings": {"cluster": {"gate_m": 0.7}}}, {"cluster", "fuse"}, "gate_m changed"),
        ({"span": Span(start_ns=3 * STEP_NS)}, set(FRONT), "the part of it that is read is another"),
        ({"thinning": Thinning(rate_hz=2.0)}, {"detect", "fuse"}, "image_rate_hz changed"),
    ],
)
def test_what_decides_a_key(here: Path, changes: dict[str, Any], ran: set[str], reason: str) -> None:
    run_stages(asked(here), here / "out.mcap", FRONT, "run")
    run = run_stages(asked(here, **changes), here / "out.mcap", FRONT, "run")
    assert {name for name, state in states(run).items() if state == "ran"} == ran
    assert reason in reasons(run)[min(ran)]


@pytest.mark.slow
def test_another_model_or_program_runs_anew(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_stages(asked(here), here / "out.mcap", FRONT, "run")
    (here / "model.onnx").write_bytes((here / "model.onnx").read_bytes() + b"")
    assert set(states(run_stages(asked(here), here / "out.mcap", FRONT, "run")).values()) == {"reused"}
    two_posts(here / "other.onnx")
    data = (here / "other.onnx").read_bytes().replace(b"fire hydrant", b"fire hydrand")
    (here / "model.onnx").write_bytes(data)
    run = run_stages(asked(here), here / "out.mcap", FRONT, "run")
    assert states(run) == {"cluster": "reused", "detect": "ran", "fuse": "ran"}
    assert "the file model changed" in reasons(run)["detect"]
    monkeypatch.setattr("mcap_landmarks.runs.plan.code_hash", lambda: "another")
    assert "the program changed" in reasons(run_stages(asked(here), here / "out.mcap", FRONT, "run"))["detect"]


def test_another_recording_of_the_same_name_runs_anew(here: Path) -> None:
    run_stages(asked(here), here / "out.mcap", ["detect"], "run")
    raw_log(here / "log.mcap", COUNT - 1)
    run = run_stages(asked(here, overwrite=True), here / "out.mcap", ["detect"], "run")
    assert "the recording" in reasons(run)["detect"]
    assert topics(here / "out.mcap")[DETECTIONS.topic] == COUNT - 1


@pytest.mark.slow
def test_results_made_from_replaced_ones_are_left_out(here: Path) -> None:
    run_stages(asked(here), here / "a.mcap", ALL, "run")
    changed = asked(here, "a.mcap", settings={"fuse": {"bearing_gate": 4.0}})
    run = run_stages(changed, here / "b.mcap", ["fuse"], "run")
    assert MATCH.topic not in topics(here / "b.mcap")
    assert topics(here / "b.mcap")[DETECTIONS.topic] == COUNT
    assert run.notes == ("localize's results in the log were made from results that changed; they are left out",)


def test_a_finished_stage_survives_a_run_that_fails(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks, out, work = counted(monkeypatch), here / "out.mcap", session.run_stage

    def failing(step: Step, *rest: object) -> object:
        if step.stage.name == "fuse":
            raise KeyboardInterrupt
        return work(step, *rest)  # type: ignore[arg-type] # as it was called

    monkeypatch.setattr(session, "run_stage", failing)
    with pytest.raises(KeyboardInterrupt):
        run_stages(asked(here), out, ALL, "run")
    assert not out.exists()
    left = sorted(path.name.partition("-")[0] for path in (here / ".out.mcap.parts").iterdir())
    assert left == ["cluster", "detect"]
    monkeypatch.setattr(session, "run_stage", work)
    run = run_stages(asked(here), out, ALL, "run")
    assert states(run) == {"cluster": "reused", "detect": "reused", "fuse": "ran", "localize": "ran"}
    assert reasons(run)["detect"] == "the same results are in what an unfinished run left"
    assert len(looks) == COUNT
    assert not (here / ".out.mcap.parts").exists()


@pytest.mark.slow
def test_an_edited_output_is_not_trusted(here: Path) -> None:
    run_stages(asked(here), here / "a.mcap", FRONT, "run")
    with open_recording(here / "a.mcap") as recording, (here / "b.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2")
        ids = {}
        for connection in (entry.connection for entry in recording.channels):
            schema = writer.register_schema(connection.message_type, "ros2msg", connection.schema)
            ids[connection] = writer.register_channel(connection.topic, "cdr", schema, dict(connection.metadata))
        for raw in recording.messages(None, 0, 5 * STEP_NS):
            writer.add_message(ids[raw.connection], raw.log_time_ns, bytes(raw.data), raw.publish_time_ns)
        for name, entries in recording.metadata.items():
            writer.add_metadata(name, entries)
        writer.finish()
        carried = recording.fingerprint()
    with open_recording(here / "b.mcap") as recording:
        assert not recording.is_ours
        assert recording.fingerprint() != carried
    run = run_stages(asked(here, "b.mcap"), here / "c.mcap", ["localize"], "localize", lacking=True)
    assert states(run) == {"localize": "ran"}  # its scene objects are as good as anyone's
    again = run_stages(asked(here, "c.mcap"), here / "d.mcap", ["localize"], "localize", lacking=True)
    assert states(again) == {"localize": "reused"}
    assert topics(here / "d.mcap")[SCENE_OBJECTS.topic] == 4
    run = run_stages(asked(here, "c.mcap"), here / "e.mcap", FRONT, "run")
    assert set(states(run).values()) == {"ran"}
    assert topics(here / "e.mcap")[SCENE_OBJECTS.topic] == 4


def test_a_part_of_a_recording_is_not_taken_for_the_whole(here: Path) -> None:
    run_stages(asked(here, span=Span(end_ns=4 * STEP_NS)), here / "part.mcap", ["cluster"], "run")
    run_stages(asked(here, results_only=True), here / "results.mcap", FRONT, "run")
    with open_recording(here / "log.mcap") as whole:
        names = {whole.fingerprint()}
    for name in ("part.mcap", "results.mcap"):
        with open_recording(here / name) as recording:
            names.add(recording.fingerprint())
    assert len(names) == 3
    run = run_stages(asked(here, "part.mcap"), here / "part_out.mcap", ["cluster"], "run")
    assert states(run) == {"cluster": "reused"}
    assert topics(here / "part_out.mcap")["/landmarks/scan_objects"] == 3


def test_results_that_were_cut_are_not_taken_for_whole_ones(here: Path) -> None:
    run_stages(asked(here), here / "whole.mcap", ["detect"], "run")
    run_stages(asked(here, "whole.mcap", span=Span(end_ns=4 * STEP_NS)), here / "out.mcap", ["cluster"], "run")
    assert topics(here / "out.mcap")[DETECTIONS.topic] == 3
    run = run_stages(asked(here), here / "out.mcap", ["detect"], "run")
    assert reasons(run) == {"detect": "the results in the earlier output are only a part"}
    assert topics(here / "out.mcap")[DETECTIONS.topic] == COUNT


def test_results_alone_are_taken_as_they_are(here: Path) -> None:
    run_stages(asked(here, results_only=True), here / "results.mcap", FRONT, "run")
    assert set(topics(here / "results.mcap")) & {ODOMETRY.topic, "/scan"} == set()
    changed = asked(here, "results.mcap", settings={"fuse": {"bearing_gate": 4.0}})
    run = run_stages(changed, here / "out.mcap", ["localize"], "localize", lacking=True)
    assert states(run) == {"localize": "ran"}


@pytest.mark.slow
def test_results_only_are_those_of_the_run(here: Path) -> None:
    run_stages(asked(here), here / "a.mcap", FRONT, "run")
    run_stages(asked(here, "a.mcap", results_only=True), here / "b.mcap", ["localize"], "run")
    assert set(topics(here / "b.mcap")) & {DETECTIONS.topic, SCENE_OBJECTS.topic} == set()
    assert topics(here / "b.mcap")[MATCH.topic] == COUNT
    run_stages(asked(here, "a.mcap", results_only=True), here / "c.mcap", ["localize"], "localize", lacking=True)
    assert topics(here / "c.mcap")[SCENE_OBJECTS.topic] == COUNT


def test_what_was_lost_is_told_every_time(here: Path) -> None:
    data = bytearray((here / "log.mcap").read_bytes())
    data[data.find(b"\xff\xd8\xff") + 20] ^= 1
    (here / "log.mcap").write_bytes(data)
    for state in ("ran", "reused"):
        run = run_stages(asked(here), here / "out.mcap", ["cluster"], "run")
        assert states(run) == {"cluster": state}
        assert len(run.losses) == 1
        assert "CRC" in run.losses[0]


def test_where_nothing_may_be_written_the_error_says_so(here: Path) -> None:
    (here / ".out.mcap.parts").write_text("in the way")
    with pytest.raises(RecordingError, match="cannot be made"):
        run_stages(asked(here), here / "out.mcap", ["detect"], "run")
    assert (here / ".out.mcap.parts").read_text() == "in the way"


@pytest.mark.slow
def test_our_transforms_stand_beside_the_logs_own(here: Path) -> None:
    other = Stamped(TF, 1, TFMessage((Transform.planar(1, ("base_footprint", "wheel"), (0, 0, 0)),)))
    with create_recording(here / "log.mcap") as writer:
        for stamped in [other, *raw_messages()]:
            writer.add(stamped)
    run_stages(asked(here), here / "a.mcap", ALL, "run")
    run_stages(asked(here, "a.mcap", force=True), here / "b.mcap", ALL, "run")
    assert (here / "a.mcap").read_bytes() == (here / "b.mcap").read_bytes()


def test_refusals(here: Path) -> None:
    with pytest.raises(UsageError, match="is the input itself"):
        run_stages(asked(here), here / "log.mcap", ["detect"], "run")
    with pytest.raises(UsageError, match="clusta is no stage"):
        run_stages(asked(here), here / "out.mcap", ["clusta"], "run")
    with pytest.raises(UsageError, match="build_map makes one result of many logs"):
        run_stages(asked(here), here / "out.mcap", ["build_map"], "run")
    blind = [stamped for stamped in raw_messages() if stamped.channel.topic != "/scan"]
    with create_recording(here / "blind.mcap") as writer:
        for stamped in blind:
            writer.add(stamped)
    with pytest.raises(RecordingError, match=r"there is no scene_objects .* and no scan .* to make it from"):
        run_stages(asked(here, "blind.mcap"), here / "out.mcap", ["localize"], "localize", lacking=True)
    assert not (here / "out.mcap").exists()
    assert not (here / ".out.mcap.parts").exists()


def test_what_a_network_found_is_kept_where_nobody_names_it_again(here: Path) -> None:
    run_stages(asked(here), here / "out.mcap", FRONT, "run")
    unnamed = asked(here, "out.mcap", files={"map": here / "map.db"})
    run = run_stages(unnamed, here / "again.mcap", ALL, "run")
    assert states(run) == {"cluster": "reused", "detect": "reused", "fuse": "reused", "localize": "ran"}
    changed = dataclasses.replace(unnamed, settings={"detect": {"confidence": 0.9}})
    with pytest.raises(UsageError, match=r"detect has to run anew \(confidence changed .*; give --model FILE"):
        run_stages(changed, here / "changed.mcap", FRONT, "run")
    named = dataclasses.replace(changed, files={"model": here / "model.onnx"})
    assert states(run_stages(named, here / "changed.mcap", FRONT, "run"))["detect"] == "ran"
