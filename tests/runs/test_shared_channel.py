"""A topic that the log and results share, /tf, has one channel in an output, its messages in order; whose they are is
still known: results are reused, replaced and taken out, and the log's own stay.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from mcap_landmarks.channels import TF
from mcap_landmarks.cli.console import DONE
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.layered_log import own_layer, result_layers
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Connection, RawMessage, Stamped
from pymcap_cli.doctor import Severity

from tests.cli.calls import call, topics
from tests.cli.logs import messages, write
from tests.runs.chain import by_others
from tests.runs.conversion import doctor

COUNT = 60


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log whose robot tells odom -> base on /tf, the same with all topics in mixed chunks, and a map of its world."""
    here = tmp_path_factory.mktemp("shared")
    own = messages(count=COUNT)
    for one in [one for one in own if one.channel.topic == "/odom"]:
        step = Transform.planar(one.log_time_ns, ("odom", "base"), [0, 0, 0])
        own.insert(own.index(one), Stamped(TF, one.log_time_ns, TFMessage((step,))))
    by_others(write(here / "log.mcap", own), here / "mixed.mcap")
    assert call("map", here / "log.mcap", "--map", here / "map.db") == DONE
    assert localized(here, "log.mcap", here / "result.mcap") == DONE
    return here


def localized(folder: Path, log: str | Path, output: Path, *more: str) -> int:
    """Exit code of localize over a log in the folder, or elsewhere."""
    return call("localize", folder / log, "--map", folder / "map.db", "-o", output, *more)


def transforms(path: Path) -> list[tuple[int, str]]:
    """Log time and child frame of each message on /tf, which must have one channel."""
    with open_recording(path) as recording:
        (connection,) = recording.connections(TF.topic)
        return [(raw.log_time_ns, child(raw)) for raw in recording.messages([connection])]


def child(raw: RawMessage) -> str:
    return decode(TFMessage, raw.data).transforms[0].child_frame_id


def complaints(path: Path) -> list[str]:
    """What other tools complain of: several channels of one topic, or chunks of a topic that overlap in time."""
    program = Path(sys.executable).parent / "rerun"
    told = subprocess.run([program, "mcap", "check", path], check=True, capture_output=True, text=True).stdout
    assert TF.topic in told
    found = [line for line in told.splitlines() if line.startswith("PROBLEM")]
    return [*found, *doctor(path, Severity.ERROR, Severity.WARNING)]


@pytest.mark.parametrize("log", ["log.mcap", "mixed.mcap"])
def test_one_channel_in_the_order_of_time(folder: Path, log: str, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    assert localized(folder, log, out) == DONE
    found = transforms(out)
    assert [name for _, name in found].count("base") == COUNT
    assert [name for _, name in found].count("odom") > COUNT / 2
    assert found == sorted(found, key=lambda one: one[0])
    assert complaints(out) == []


def test_whose_messages_are_whose_is_known(folder: Path) -> None:
    with open_recording(folder / "log.mcap") as log, open_recording(folder / "result.mcap") as result:
        own, results = own_layer(result), result_layers(result)["localize"]
        mine = [entry for entry in own.channels if entry.connection.topic == TF.topic]
        (theirs,) = (entry for entry in results.channels if entry.connection.topic == TF.topic)
        assert mine[0].count == COUNT
        before = [bytes(raw.data) for raw in log.messages(log.connections(TF.topic))]
        assert [bytes(raw.data) for raw in own.messages([mine[0].connection])] == before
        found = [*results.messages([theirs.connection])]
        assert {child(raw) for raw in found} == {"odom"}
        assert len(found) == theirs.count
        assert theirs.connection.metadata["mcap-landmarks.stage"] == "localize"


def test_results_are_reused_and_give_the_same_bytes(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = tmp_path / "again.mcap"
    capsys.readouterr()
    assert localized(folder, "result.mcap", again) == DONE
    assert "localize reused" in capsys.readouterr().err
    assert again.read_bytes() == (folder / "result.mcap").read_bytes()


def test_results_of_another_run_take_their_place(folder: Path, tmp_path: Path) -> None:
    other, never = tmp_path / "other.mcap", tmp_path / "never.mcap"
    assert localized(folder, "result.mcap", other, "--set", "localize.max_sigma_m=0.4") == DONE
    assert len(transforms(other)) == len(transforms(folder / "result.mcap"))
    assert localized(folder, "result.mcap", never, "--set", "localize.tf=never") == DONE
    assert transforms(never) == transforms(folder / "log.mcap")


def test_results_alone_have_a_channel_of_their_own(folder: Path, tmp_path: Path) -> None:
    """Whether they were made now, or lay among the log's own messages."""
    for name in ("log", "result"):
        assert localized(folder, f"{name}.mcap", tmp_path / f"{name}.mcap", "--results-only") == DONE
        assert {name for _, name in transforms(tmp_path / f"{name}.mcap")} == {"odom"}
    assert (tmp_path / "log.mcap").read_bytes() == (tmp_path / "result.mcap").read_bytes()


def test_after_a_cut_they_are_the_logs_own(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Who edits a file makes all in it the log's own, as results on other topics: that is said, and no frame gets two
    parents.
    """
    cut, out = tmp_path / "cut.mcap", tmp_path / "out.mcap"
    assert call("convert", folder / "result.mcap", "-o", cut, "--end", str(10**10)) == DONE
    capsys.readouterr()
    assert localized(folder, cut, out) == DONE
    assert "odom has a parent frame already" in capsys.readouterr().err
    assert transforms(out) == transforms(cut)


def test_a_topic_of_another_type_is_left_alone(folder: Path, tmp_path: Path) -> None:
    """Such as /tf in JSON: results get a channel of their own beside it, as no reader could tell them apart."""
    foreign, out = tmp_path / "foreign.mcap", tmp_path / "out.mcap"
    with open_recording(folder / "log.mcap") as log:
        connection = Connection(TF.topic, TFMessage.ROS_TYPE, b"{}", "jsonschema", "json")
        with create_recording(foreign, profile="") as writer:
            writer.write(RawMessage(connection, 1, 1, 0, b"{}"))
            for raw in log.messages():
                if raw.connection.topic != TF.topic:
                    writer.write(raw)
    assert localized(folder, foreign, out) == DONE
    with open_recording(out) as recording:
        assert len(recording.connections(TF.topic)) == 2
    assert topics(out)["/odom"] == COUNT
