"""Tables that are NumPy's, and pandas' where it is there."""

import sys

import numpy as np
import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.structured import StructuredArray, moments, objects


def table() -> StructuredArray:
    stamp_ns = np.array([1, 2, 3], dtype=np.int64)
    columns = {"stamp_ns": stamp_ns, "time": moments(stamp_ns), "class": objects(["car", "car", "person"])}
    return StructuredArray.of({**columns, "ids": objects([("a", "b"), (), ("c",)]), "x_m": np.array([0.5, 1.5, 2.5])})


def test_a_field_is_a_plain_array_and_rows_stay_a_table() -> None:
    found = table()
    assert type(found["x_m"]) is np.ndarray
    chosen = found[found["class"] == "car"]
    assert isinstance(chosen, StructuredArray)
    assert chosen["x_m"].tolist() == [0.5, 1.5]
    assert found[2]["ids"] == ("c",)
    assert found[["x_m", "class"]].fields == ("x_m", "class")
    assert repr(chosen).startswith("<StructuredArray of 2 rows: stamp_ns int64, time datetime64[ns], class object")


def test_pandas_takes_all_fields_with_their_types() -> None:
    frame = table()[:2].to_pandas()
    assert list(frame.columns) == ["stamp_ns", "time", "class", "ids", "x_m"]
    assert str(frame["time"].dtype) == "datetime64[ns]"
    assert frame["ids"].tolist() == [("a", "b"), ()]
    assert "<table" in (table()._repr_html_() or "")


def test_without_pandas_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match=r"pip install 'mcap-landmarks\[pandas\]'"):
        table().to_pandas()
    assert table()._repr_html_() is None
