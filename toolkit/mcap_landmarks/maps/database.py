"""The landmark database: one map in one SQLite file, whose bytes depend on the map alone."""

import contextlib
import hashlib
import sqlite3
from collections.abc import Iterator, Mapping
from urllib.parse import quote

import numpy as np

from mcap_landmarks import memory
from mcap_landmarks.atomic import atomic_file
from mcap_landmarks.catalogue.application_ids import LANDMARKS
from mcap_landmarks.errors import MapError
from mcap_landmarks.locations import Location, is_there, to_read
from mcap_landmarks.maps.model import Group, LandmarkMap, MapSource
from mcap_landmarks.maps.neighbours import Neighbours
from mcap_landmarks.resources import resource

_APPLICATION_ID = int.from_bytes(LANDMARKS, "big")
SCHEMA_VERSION = 1
_NUMBERS = ("x_m", "y_m", "var_x_m2", "cov_xy_m2", "var_y_m2", "radius_m")
_COLUMNS = [("number", "i8"), ("id", "O"), ("class", "O"), *((name, "f8") for name in _NUMBERS)]
_COLUMNS += [("sightings", "i8"), ("tentative", "?")]
_RECORDING = b"\x89MCAP0\r\n"
"""What MCAP files begin with (mcap.dev/spec)."""
_UPPER = np.triu_indices(3)
# Arrays of landmarks that are kept to load the index of a map with so many landmarks in less time.
_KEPT = {"triangles": 3, "pairs": 2}
_LARGE = 20_000


def read_map(path: Location) -> LandmarkMap:
    """The map in a database.

    Raises:
        MapError: no such file, no landmark database, another schema version, or damaged content.
    """
    if not to_read(path).is_file():
        raise MapError(f"{path}: there is no such map; build it with `map` or `landmarks import`")
    try:
        with _reading(path) as database:
            _check_version(path, database)
            return _read(path, database)
    except (sqlite3.Error, ValueError, TypeError, KeyError) as error:
        with to_read(path).open("rb") as stream:
            if stream.read(len(_RECORDING)) == _RECORDING:
                raise MapError(f"{path}: is a recording and no landmark database; `map` makes one of it") from error
        raise MapError(f"{path}: is not a landmark database or is damaged ({error}); build it again") from error


def read_manifest(path: Location) -> dict[str, str]:
    """What ran to build the map in a database, by entry; nothing if that is unknown, or there is no such map."""
    if not is_there(path):
        return {}
    try:
        with _reading(path) as database:
            return dict(database.execute("SELECT name, content FROM manifest").fetchall())
    except sqlite3.Error:
        return {}


def read_neighbours(path: Location, landmark_map: LandmarkMap) -> Neighbours | None:
    """What is kept of the search index of a map that was read from a database.

    None where nothing is (small maps are indexed in no time), or where the landmarks were changed since.
    """
    with _reading(path) as database:
        try:
            rows = database.execute("SELECT name, content FROM search_index WHERE landmarks = ?", (_key(landmark_map),))
            found = {name: np.frombuffer(content, dtype="<i4").astype(np.int32) for name, content in rows}
        except sqlite3.Error:
            return None
    if len(found) < len(_KEPT):
        return None
    return Neighbours(*(found[name].reshape(-1, size) for name, size in _KEPT.items()))


def write_map(path: Location, landmark_map: LandmarkMap, manifest: Mapping[str, str] | None = None) -> None:
    """Write a map to a new database, or over the old one once it is whole. Same map, same bytes.

    `manifest` says what ran to build it, where that is known.

    Raises:
        ToolkitError: the file cannot be written.
    """
    with contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as database:
        database.executescript(f"BEGIN;\n{resource('schemas', 'landmarks.sql').read_text(encoding='utf-8')}")
        _write(database, landmark_map)
        if len(landmark_map) >= _LARGE:
            _keep(database, landmark_map)
        database.executemany("INSERT INTO manifest VALUES (?, ?)", sorted((manifest or {}).items()))
        database.execute("COMMIT")
        content = database.serialize()
    with atomic_file(path) as stream:
        stream.write(content)


@contextlib.contextmanager
def _reading(path: Location) -> Iterator[sqlite3.Connection]:
    # immutable: no journal or lock file appears beside a map that is only read
    address = f"file:{quote(str(to_read(path).resolve()))}?mode=ro&immutable=1"
    with contextlib.closing(sqlite3.connect(address, uri=True)) as database:
        yield database


def _check_version(path: Location, database: sqlite3.Connection) -> None:
    application = database.execute("PRAGMA application_id").fetchone()[0]
    version = database.execute("PRAGMA user_version").fetchone()[0]
    if application != _APPLICATION_ID:
        raise MapError(f"{path}: is an SQLite file but no landmark database; name one that `map` made")
    if version != SCHEMA_VERSION:
        raise MapError(
            f"{path}: has schema version {version}, this program speaks {SCHEMA_VERSION}; build the map again, "
            "or export it with the version that made it and import that"
        )


def _read(path: Location, database: sqlite3.Connection) -> LandmarkMap:
    try:
        return _map_of(database)
    except MapError as error:
        raise MapError(f"{path}: {error}") from error


def _map_of(database: sqlite3.Connection) -> LandmarkMap:
    if problem := memory.excess_of_landmarks(database.execute("SELECT count(*) FROM landmark").fetchone()[0]):
        raise MapError(problem)
    frame = database.execute("SELECT frame FROM map").fetchone()
    if frame is None:
        raise ValueError("its table map is empty")
    found = database.execute(
        "SELECT number, id, class, x_m, y_m, var_x_m2, cov_xy_m2, var_y_m2, radius_m, sightings, tentative"
        " FROM landmark ORDER BY number"
    )
    rows = np.fromiter(found, dtype=_COLUMNS)
    spread = [rows[name] for name in ("var_x_m2", "cov_xy_m2", "cov_xy_m2", "var_y_m2")]
    ids = tuple(rows["id"].tolist())
    return LandmarkMap(
        ids=ids,
        classes=tuple(rows["class"].tolist()),
        positions_xy=np.stack([rows["x_m"], rows["y_m"]], axis=-1),
        covariances=np.stack(spread, axis=-1).reshape(-1, 2, 2),
        radii_m=rows["radius_m"],
        sightings=rows["sightings"],
        tentative=rows["tentative"],
        groups=_read_groups(database, dict(zip(rows["number"].tolist(), ids, strict=True))),
        sources=tuple(
            MapSource(*row)
            for row in database.execute("SELECT kind, fingerprint, bundles, used FROM source ORDER BY number")
        ),
        frame=frame[0],
    )


def _read_groups(database: sqlite3.Connection, id_of_number: dict[int, str]) -> tuple[Group, ...]:
    members: dict[int, list[str]] = {}
    for group, landmark in database.execute(
        "SELECT landmark_group, landmark FROM member ORDER BY landmark_group, place"
    ):
        members.setdefault(group, []).append(id_of_number[landmark])
    groups = []
    for number, *values in database.execute(
        "SELECT number, x_m, y_m, heading_rad, var_x_m2, cov_xy_m2, cov_xh_m, var_y_m2, cov_yh_m, var_h"
        " FROM landmark_group ORDER BY number"
    ):
        covariance = None
        if values[3] is not None:
            covariance = np.zeros((3, 3))
            covariance[_UPPER] = covariance.T[_UPPER] = values[3:]
        groups.append(Group(tuple(members[number]), np.array(values[:3], dtype=np.float64), covariance))
    return tuple(groups)


def _write(database: sqlite3.Connection, landmark_map: LandmarkMap) -> None:
    database.execute("INSERT INTO map VALUES (?)", (landmark_map.frame,))
    spread = landmark_map.covariances
    numbers = np.column_stack(
        [landmark_map.positions_xy, spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1], landmark_map.radii_m]
    ).tolist()
    rows = zip(
        range(len(landmark_map)),
        landmark_map.ids,
        landmark_map.classes,
        numbers,
        landmark_map.sightings.tolist(),
        landmark_map.tentative.tolist(),
        strict=True,
    )
    database.executemany(
        "INSERT INTO landmark VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", ((*row[:3], *row[3], *row[4:]) for row in rows)
    )
    number_of_id = {identity: number for number, identity in enumerate(landmark_map.ids)}
    for i, group in enumerate(landmark_map.groups):
        covariance = [None] * 6 if group.covariance is None else group.covariance[_UPPER].tolist()
        database.execute(
            "INSERT INTO landmark_group VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (i, *group.map_from_base.tolist(), *covariance),
        )
        database.executemany(
            "INSERT INTO member VALUES (?, ?, ?)",
            ((i, place, number_of_id[identity]) for place, identity in enumerate(group.landmark_ids)),
        )
    database.executemany(
        "INSERT INTO source VALUES (?, ?, ?, ?, ?)",
        (
            (i, source.kind, source.fingerprint, source.bundles, source.used)
            for i, source in enumerate(landmark_map.sources)
        ),
    )


def _keep(database: sqlite3.Connection, landmark_map: LandmarkMap) -> None:
    """The part of the search index that takes longest to build."""
    neighbours, key = Neighbours.of_map(landmark_map), _key(landmark_map)
    for name in _KEPT:
        content = getattr(neighbours, name).astype("<i4").tobytes()
        database.execute("INSERT INTO search_index VALUES (?, ?, ?)", (name, key, content))


def _key(landmark_map: LandmarkMap) -> str:
    """What the index depends on: which landmarks are confirmed, where they are, and of which classes."""
    content = hashlib.sha256("\0".join(landmark_map.classes).encode())
    content.update(landmark_map.tentative.tobytes())
    content.update(landmark_map.positions_xy.astype("<f8").tobytes())
    return content.hexdigest()
