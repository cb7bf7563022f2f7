"""The benchmark of mutated logs: every kind changes a log, always in the same way, and leaves the truth alone."""

import numpy as np
import pytest
from mcap_landmarks.channels import TRUTH

from tests.benchmark.input_mutations import KINDS, Kind
from tests.benchmark.inputs import Draw, Outcome, base_log, draws_of, judge
from tests.benchmark.log_edits import Log
from tests.benchmark.thesis_runs import Ended


@pytest.fixture(scope="module")
def log() -> Log:
    return base_log("localize")


def test_there_are_thirty_kinds_and_a_round_has_each_once() -> None:
    assert len(KINDS) == 30
    drawn = draws_of(10_000, 60)
    assert [draw.seed for draw in drawn] == [*range(10_000, 10_060)]
    assert {draw.kind.name for draw in drawn[:30]} == {kind.name for kind in KINDS}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_kind_changes_a_log_in_the_same_way_each_time(kind: Kind, log: Log) -> None:
    changed = Draw(kind, 7).log_of(log)
    assert changed != log
    assert changed == Draw(kind, 7).log_of(log)
    times_ns = [raw.log_time_ns for raw in changed]
    assert times_ns == sorted(times_ns)
    assert [raw for raw in changed if raw.connection.topic.startswith(TRUTH)] == [
        raw for raw in log if raw.connection.topic.startswith(TRUTH)
    ]


def outcome(code: int = 0, told: str = "", landmarks: int = 0, rmse_m: float = 0.01) -> Outcome:
    return Outcome(Ended(code, {}, told), landmarks, rmse_m)


CLEAN = outcome(told="note: /a/map.mcap: 3 scans were odd\n", landmarks=1)
NOTE = "note: /b/map.mcap: 4 scans were odd\n"


@pytest.mark.parametrize(
    ("found", "wrong_silently", "refused"),
    [
        (outcome(landmarks=1, rmse_m=0.029), False, False),
        (outcome(landmarks=2), True, False),
        (outcome(rmse_m=0.031), True, False),
        (outcome(rmse_m=np.inf), True, False),
        (outcome(landmarks=2, told=NOTE), False, False),
        (outcome(landmarks=2, told="note: /b/map.mcap: 3 scans were odd\n"), True, False),  # as of the good log
        (outcome(landmarks=2, told="note: /b/map.mcap: the moon is full\n"), True, False),
        (outcome(3, landmarks=2), False, False),
        (outcome(1, "error: no\n", rmse_m=np.inf), False, True),
    ],
)
def test_what_counts_as_wrong(found: Outcome, wrong_silently: bool, refused: bool) -> None:
    scans = next(kind for kind in KINDS if kind.name == "scan gap")
    judged = judge(scans, found, CLEAN)
    assert (judged.wrong_silently, judged.refused) == (wrong_silently, refused)
