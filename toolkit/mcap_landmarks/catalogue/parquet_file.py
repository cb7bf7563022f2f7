"""A catalogue as a Parquet file (extra `parquet`)."""

import importlib.util
import io
from typing import TYPE_CHECKING

from mcap_landmarks.catalogue.catalogue_columns import Catalogue, Kind
from mcap_landmarks.errors import UsageError

if TYPE_CHECKING:
    import pyarrow as pa


def need_pyarrow() -> None:
    """Refuse Parquet where pyarrow is not installed.

    Raises:
        UsageError: as it says.
    """
    if importlib.util.find_spec("pyarrow") is None:
        raise UsageError(
            "Parquet needs pyarrow; pip install 'mcap-landmarks[parquet]', or name a catalogue that ends with .db"
        )


def from_parquet(content: bytes) -> Catalogue:
    """The table in a Parquet file.

    Raises:
        ValueError: it is none.
    """
    import pyarrow.parquet as pq  # noqa: PLC0415 - takes most of a second

    found = pq.read_table(io.BytesIO(content))
    return Catalogue({field.name: _kind(field.type) for field in found.schema}, found.to_pylist())


def to_parquet(table: Catalogue) -> bytes:
    """A table as a Parquet file; every column may be null. Same table, same bytes."""
    import pyarrow as pa  # noqa: PLC0415 - takes most of a second
    import pyarrow.parquet as pq  # noqa: PLC0415

    types = {"text": pa.string(), "integer": pa.int64(), "number": pa.float64(), "time": pa.timestamp("us", tz="UTC")}
    schema = pa.schema([pa.field(name, types[kind]) for name, kind in table.columns.items()])
    stream = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(list(table.rows), schema=schema), stream, compression="zstd")
    return stream.getvalue()


def _kind(type_: "pa.DataType") -> Kind:
    import pyarrow as pa  # noqa: PLC0415

    if pa.types.is_integer(type_):
        return "integer"
    if pa.types.is_floating(type_):
        return "number"
    if pa.types.is_timestamp(type_):
        return "time"
    if pa.types.is_string(type_) or pa.types.is_large_string(type_) or pa.types.is_null(type_):
        return "text"
    raise ValueError(f"a column is of type {type_}")
