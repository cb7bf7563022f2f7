"""The rows of a damaged SQLite bag: those before the damage, and those behind it, as far as SQLite comes there."""

import sqlite3
from collections.abc import Callable, Iterator

_LAST = 2**63 - 1
"""The limit of SQLite's integers."""
_MOST_GAPS = 1000
"""So many damaged stretches are passed over, so that a file of nothing but damage ends: each costs some 100 queries."""
_ROWS = "SELECT timestamp, rowid, topic_id FROM messages WHERE rowid > ? ORDER BY rowid"


def salvaged_rows(database: sqlite3.Connection, lost: Callable[[int | None], None]) -> Iterator[tuple[int, int, int]]:
    """Time, row id and topic of the rows that can be read, by row id.

    A row that lies in a damaged page is passed over with all its neighbours there; `lost` is told how many row ids are
    missing each time (rosbag2 numbers rows one by one), or None where nothing behind them can be read.
    """
    after: int | None = 0
    for _ in range(_MOST_GAPS):
        if after is None:
            return
        last = after
        try:
            for time_ns, row, topic in database.execute(_ROWS, (after,)):
                if not isinstance(row, int) or row <= last:
                    break  # a damaged page leads back to an earlier one
                last = row
                if isinstance(time_ns, int) and isinstance(topic, int):
                    yield time_ns, row, topic
            else:
                return
        except sqlite3.DatabaseError:
            pass
        after = _behind(database, last)
        lost(None if after is None else after - last)


def _behind(database: sqlite3.Connection, last: int) -> int | None:
    """A row id from which on rows can be read again, behind the unreadable ones after `last`; None if there are none.

    Damage spoils whole pages, that is stretches of row ids: their end is found by doubling, then by bisection.
    """
    unreadable, step = last, 1
    beyond = None
    while beyond is None:
        if unreadable > _LAST - step:
            return None
        state = _state(database, last + step)
        if state is None:
            unreadable = last + step
        else:
            beyond = last + step
        step *= 2
    while beyond - unreadable > 1:
        middle = (unreadable + beyond) // 2
        if _state(database, middle) is None:
            unreadable = middle
        else:
            beyond = middle
    return beyond if _state(database, beyond) else None


def _state(database: sqlite3.Connection, after: int) -> bool | None:
    """Whether there is a row behind a row id; None if what lies there cannot be read."""
    try:
        return database.execute(f"{_ROWS} LIMIT 1", (after,)).fetchone() is not None
    except sqlite3.DatabaseError:
        return None
