"""Whatever bytes are broken: an error that names the file, or what is left, never anything else."""

import contextlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.progress import unwatched
from mcap_landmarks.runs.convert import convert
from mcap_landmarks.runs.topic_selection import Selection

from tests.sources.bags import write_plain_db3, write_ros1

Edit = tuple[float, int]
WHOLE = {"none.bag": 20, "bz2.bag": 20, "lz4.bag": 20, "a.db3": 60}
EDITS = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=4)


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of whole bags."""
    folder = tmp_path_factory.mktemp("whole")
    write_ros1(folder / "none.bag", count=10)
    write_ros1(folder / "bz2.bag", count=10, compression="bz2")
    write_ros1(folder / "lz4.bag", count=10, compression="lz4")
    write_plain_db3(folder / "a.db3", count=60)
    return folder


@pytest.mark.parametrize("name", WHOLE)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=EDITS, kept=st.one_of(st.just(1.0), st.floats(0, 1)))
def test_broken_bytes(name: str, edits: list[Edit], kept: float, bags: Path, tmp_path: Path) -> None:
    data = bytearray((bags / name).read_bytes())
    padding = 4117 if name.endswith(".bag") else 0  # the bag header is mostly blanks: break what lies behind it
    for place, value in edits:
        data[padding + int(place * (len(data) - padding))] = value
    path = tmp_path / name
    path.write_bytes(data[: int(len(data) * kept)])
    with contextlib.suppress(RecordingError):
        (done,) = convert(
            [path], tmp_path / "o.mcap", Selection(), {"rosbag2": {"distro": "humble"}}, unwatched, overwrite=True
        ).outputs
        assert done.lost or done.losses or done.topics.total() >= WHOLE[name]


def test_a_bag_that_is_all_damage_leaves_no_output(bags: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes((bags / "bz2.bag").read_bytes()[:4117] + b"\xff" * 3000)
    with pytest.raises(RecordingError, match=r"a\.bag"):
        convert([path], tmp_path / "o.mcap", Selection(), {}, unwatched, overwrite=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.bag"]
