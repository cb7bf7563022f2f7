"""A landmark map is read and written under whichever name, as Python's users do."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import MapError, UsageError
from mcap_landmarks.maps.model import LandmarkMap

MAP = LandmarkMap.read(Path(__file__).parents[1] / "golden" / "map.db")


@pytest.mark.parametrize("name", ["map.db", "map.csv", "map.json"])
def test_a_map_that_was_written_is_read_again(tmp_path: Path, name: str) -> None:
    MAP.write(tmp_path / name)
    found = LandmarkMap.read(str(tmp_path / name))
    np.testing.assert_array_equal(found.positions_xy, MAP.positions_xy)
    assert found.ids == MAP.ids
    with pytest.raises(UsageError, match="there is a file already; give overwrite=True"):
        MAP.write(tmp_path / name)
    MAP.write(tmp_path / name, overwrite=True)


def test_what_is_no_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="there is no such map"):
        LandmarkMap.read(tmp_path / "map.db")


def test_landmarks_are_a_table() -> None:
    landmarks = MAP.landmarks
    assert landmarks["id"].tolist() == list(MAP.ids)
    np.testing.assert_array_equal(landmarks["cov_xy_m2"], MAP.covariances[:, 0, 1])
    assert MAP.to_pandas().shape == (len(MAP), 10)
    assert repr(MAP).startswith(f"<LandmarkMap of {len(MAP)} landmarks, 0 tentative: ")
