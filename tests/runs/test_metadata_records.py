"""A recording may have several metadata records of one name; whatever is made of it has them all, in their order."""

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_landmarks.diff.declared import structure_rows
from mcap_landmarks.progress import unwatched
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.outputs import output_files
from mcap_landmarks.runs.pipeline import run_stages
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.runs.recover import recover
from mcap_landmarks.runs.topic_selection import Selection

from tests.runs.chain import by_others, raw_log
from tests.runs.conversion import doctor, one

NOTES = [("notes", {"weather": "rain"}), ("notes", {"weather": "sun"}), ("notes", {"weather": "rain"})]
OURS = ("mcap-landmarks.run", "mcap-landmarks.recover")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short log by the mcap package, whose chunks hold several topics."""
    folder = tmp_path_factory.mktemp("records")
    return by_others(raw_log(folder / "ours.mcap", 4), folder / "log.mcap", NOTES)


def recorded(path: Path) -> list[tuple[str, dict[str, str]]]:
    """What the mcap package reads, but for what we write of our own; all CRCs are right."""
    assert doctor(path) == []
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert list(reader.iter_messages())
        return [(one.name, one.metadata) for one in reader.iter_metadata() if one.name not in OURS]


def test_the_summary_is_trusted(log: Path) -> None:
    with open_recording(log) as recording, open_recording(log, from_front=True) as scanned:
        assert list(recording.metadata_records) == list(scanned.metadata_records) == NOTES
        assert recording.metadata == {"notes": {"weather": "rain"}}
        assert recording.notes == []


def test_convert_and_recover_carry_all(log: Path, tmp_path: Path) -> None:
    one(log, tmp_path / "cut.mcap", Selection(("/odom",)))
    assert recorded(tmp_path / "cut.mcap") == NOTES
    recover(log, tmp_path / "recovered.mcap", unwatched)
    assert recorded(tmp_path / "recovered.mcap") == NOTES


def test_a_merge_has_what_both_have_once(log: Path, tmp_path: Path) -> None:
    one(log, tmp_path / "odometry.mcap", Selection(("/odom",)))
    one([tmp_path / "odometry.mcap", log], tmp_path / "merged.mcap")
    assert recorded(tmp_path / "merged.mcap") == NOTES


def test_a_run_carries_all_and_finds_its_output_again(log: Path, tmp_path: Path) -> None:
    output = next(iter(output_files([log], tmp_path / "out.mcap").values()))
    for state in ("ran", "reused"):
        run = run_stages(Request(log), output, ["cluster"], "cluster")
        assert [stage.state for stage in run.stages] == [state]
        assert recorded(output) == NOTES


def test_a_difference_in_the_first_of_several_is_told(log: Path, tmp_path: Path) -> None:
    data = log.read_bytes()
    (tmp_path / "other.mcap").write_bytes(data.replace(b"rain", b"hail", 1))
    with open_recording(log) as baseline, open_recording(tmp_path / "other.mcap") as candidate:
        (row,) = structure_rows(baseline, candidate)
    assert (row["what"], row["name"], row["baseline"], row["candidate"]) == (
        "metadata",
        "notes.weather",
        "rain",
        "hail",
    )
