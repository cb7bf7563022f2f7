"""Observations that workers left among the parts of a map give the bytes of a map that one process makes."""

from pathlib import Path

import pytest
from mcap_landmarks.runs import log_observations
from mcap_landmarks.runs.build_map import build_map_of, collect_for_map
from mcap_landmarks.runs.run_options import RunOptions
from mcap_landmarks.runs.session import parts_folder

from tests.cli.logs import messages, write


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("logs")
    return [write(folder / f"{seed}.mcap", messages(seed=seed, count=60)) for seed in (1, 2)]


def test_a_map_of_what_workers_left_is_the_same(
    logs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is taken as it is: nothing of the logs is gathered again; what is damaged is."""
    requests = RunOptions().requests(logs)
    build_map_of(requests, tmp_path / "one.db")
    with parts_folder(tmp_path / "many.db") as parts:
        for request in requests:
            collect_for_map(request, None, parts)
        first, _ = sorted(parts.glob("*.npz"))
        first.write_bytes(first.read_bytes()[:-50])
        gathered = []
        collect = log_observations._collect

        def counted(*given: object) -> object:
            gathered.append(given)
            return collect(*given)  # type: ignore[arg-type] # as it came

        monkeypatch.setattr(log_observations, "_collect", counted)
        build_map_of(requests, tmp_path / "many.db")
    assert len(gathered) == 1
    assert (tmp_path / "many.db").read_bytes() == (tmp_path / "one.db").read_bytes()
    assert not parts.exists()
