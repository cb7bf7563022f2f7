"""Tables as NumPy structured arrays, which pandas takes over where it is installed."""

import importlib
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

_INSTALL = "pip install 'mcap-landmarks[pandas]'"


class StructuredArray(np.ndarray[tuple[int, ...], np.dtype[Any]]):
    """A NumPy structured array, one row per thing; `array["x_m"]` is a plain array of one field.

    What selects rows gives a structured array again. Texts are Python's own (`object`), since their length is the
    log's; times are given twice, as `int64` nanoseconds since the epoch and as `datetime64[ns]` in UTC.
    """

    @classmethod
    def of(cls, columns: Mapping[str, ArrayLike]) -> "StructuredArray":
        """The array of columns (N,) by name."""
        arrays = {name: np.asarray(values) for name, values in columns.items()}
        made = np.empty(len(next(iter(arrays.values()))), dtype=[(name, one.dtype) for name, one in arrays.items()])
        for name, values in arrays.items():
            made[name] = values
        return made.view(cls)

    @classmethod
    def of_rows(cls, dtype: np.dtype[Any], rows: Sequence[tuple[object, ...]]) -> "StructuredArray":
        """The array of rows with a value per field."""
        return np.array(rows, dtype=dtype).view(cls)

    @overload  # type: ignore[override] # a field or a row is no structured array
    def __getitem__(self, key: str) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, key: int) -> np.void: ...
    @overload
    def __getitem__(self, key: slice | list[str] | list[int] | NDArray[Any]) -> "StructuredArray": ...
    def __getitem__(self, key: Any) -> Any:
        found = super().__getitem__(key)
        return found.view(np.ndarray) if isinstance(key, str) else found

    @property
    def fields(self) -> tuple[str, ...]:
        """The names of the fields, in their order."""
        return self.dtype.names or ()

    def to_pandas(self) -> "pd.DataFrame":
        """A data frame with a column per field.

        Raises:
            UsageError: pandas is not installed.
        """
        try:
            pandas = importlib.import_module("pandas")
        except ImportError as error:
            raise UsageError(f"to_pandas needs pandas, which is not installed; {_INSTALL}") from error
        frame: pd.DataFrame = pandas.DataFrame({name: self[name] for name in self.fields})
        return frame

    def __repr__(self) -> str:
        fields = ", ".join(f"{name} {self.dtype[name]}" for name in self.fields)
        return f"<StructuredArray of {self.size} rows: {fields}>"

    def _repr_html_(self) -> str | None:
        """How a notebook shows it: as pandas does, where that is installed."""
        try:
            shown: str | None = self.to_pandas()._repr_html_()
        except UsageError:
            return None
        return shown


def moments(stamp_ns: NDArray[np.int64]) -> NDArray[np.datetime64]:
    """Nanoseconds since the epoch (N,) as NumPy's moments (N,), in UTC."""
    return np.asarray(stamp_ns, dtype=np.int64).view("datetime64[ns]")


def objects(values: Iterable[object]) -> NDArray[np.object_]:
    """Texts, tuples or other objects as a column (N,), whatever is within them."""
    found = list(values)
    column = np.empty(len(found), dtype=object)
    for i, value in enumerate(found):
        column[i] = value
    return column
