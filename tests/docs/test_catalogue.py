"""The document about the catalogue: its columns are those that there are, and its questions can be asked."""

import json
import re
from pathlib import Path

import pytest
from mcap_landmarks.catalogue.catalogue_columns import COLUMNS
from mcap_landmarks.catalogue.catalogue_file import append_rows

from tests.catalogue.rows import row
from tests.docs.documents import DOCS

TEXT = (DOCS / "catalogue.md").read_text()


def test_every_column_is_told_and_no_other() -> None:
    cells = re.findall(r"^\| (`.+?) \|", TEXT, re.MULTILINE)
    assert sorted(name for cell in cells for name in re.findall(r"`(\w+)`", cell)) == sorted(COLUMNS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the catalogue of two runs over three logs."""
    here = tmp_path_factory.mktemp("catalogue")
    settings = json.dumps({"localize": {"method": "default"}})
    for day, localized in enumerate((5, 9)):
        figures = {"settings": settings, "bundles": 10, "seconds_localize": 1.5, "peak_memory_bytes": 10**9}
        rows = [
            row("a.mcap", "a.mcap", day, localized=localized, **figures),
            row("b.mcap", "b.mcap", day, localized=8, **figures),
            row("c.mcap", None, day, errors="error: c.mcap: no odometry", exit_code=1),
        ]
        append_rows(here / "runs.parquet", rows)
    return here


@pytest.mark.slow
def test_the_questions_are_answered(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    duckdb = pytest.importorskip("duckdb")
    monkeypatch.chdir(folder)
    failed, worst, work = (duckdb.sql(query).fetchall() for query in re.findall(r"```sql\n(.*?)```", TEXT, re.DOTALL))
    assert failed == [("c.mcap", 1, "error: c.mcap: no odometry")]
    assert worst == [("b.mcap", 8, 10, 0.8), ("a.mcap", 9, 10, 0.9)]
    assert work == [("default", 4, None, None, None, 6.0, 1.0)]


@pytest.mark.slow
def test_others_read_the_table_as_it_is(folder: Path) -> None:
    pandas, dataset = pytest.importorskip("pandas"), pytest.importorskip("pyarrow.dataset")
    table = pandas.read_parquet(folder / "runs.parquet")
    assert list(table.columns) == list(COLUMNS)
    assert table.groupby("log").size().to_dict() == {"a.mcap": 2, "b.mcap": 2, "c.mcap": 2}
    assert dataset.dataset(folder / "runs.parquet").count_rows(filter=dataset.field("outcome") == "failed") == 2
