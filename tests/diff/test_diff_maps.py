"""The diff of landmark databases."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.diff.comparison import diff
from mcap_landmarks.diff.maps import moved
from mcap_landmarks.manifest import Manifest
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.maps.model import Group, LandmarkMap, MapSource

from tests.maps.examples import small_map

MOVE = np.array([4.0, -2.0, 0.7])


def compare(folder: Path, other: LandmarkMap, *, aligned: bool = False) -> dict[str, Any]:
    write_map(folder / "a.db", small_map())
    write_map(folder / "b.db", other)
    return diff(folder / "a.db", folder / "b.db", aligned=aligned).document


def counts(channel: dict[str, Any]) -> tuple[int, ...]:
    return tuple(channel[name] for name in ("same", "changed", "added", "removed"))


def without(whole: LandmarkMap, row: int) -> LandmarkMap:
    keep = [i for i in range(len(whole)) if i != row]
    gone = whole.ids[row]
    return replace(
        whole,
        **{name: tuple(getattr(whole, name)[i] for i in keep) for name in ("ids", "classes")},
        **{
            name: getattr(whole, name)[keep]
            for name in ("positions_xy", "covariances", "radii_m", "sightings", "tentative")
        },
        groups=tuple(group for group in whole.groups if gone not in group.landmark_ids),
    )


def test_a_map_is_the_same_as_itself(tmp_path: Path) -> None:
    document = compare(tmp_path, small_map())
    assert (document["verdict"], document["identical"]) == ("same", True)
    assert counts(document["channels"]["landmarks"]) == (4, 0, 0, 0)
    assert counts(document["channels"]["groups"]) == (2, 0, 0, 0)


def test_names_do_not_count(tmp_path: Path) -> None:
    base = small_map()
    names = dict(zip(base.ids, "wxyz", strict=True))
    groups = tuple(replace(g, landmark_ids=tuple(names[i] for i in g.landmark_ids)) for g in base.groups)
    assert compare(tmp_path, replace(base, ids=tuple("wxyz"), groups=groups))["verdict"] == "same"


def test_a_landmark_that_moved(tmp_path: Path) -> None:
    places = small_map().positions_xy + np.array([[0.3, 0.4], [0, 0], [0, 0], [0, 0]])
    found = compare(tmp_path, replace(small_map(), positions_xy=places))["channels"]["landmarks"]
    assert counts(found) == (3, 1, 0, 0)
    (case,) = found["worst"]
    assert (case["item"], case["field"], case["time_ns"]) == ("fire hydrant a", "position_m", None)
    assert case["difference"] == pytest.approx(0.5)


def test_a_landmark_that_is_lost_takes_its_groups_along(tmp_path: Path) -> None:
    channels = compare(tmp_path, without(small_map(), 0))["channels"]
    assert counts(channels["landmarks"]) == (3, 0, 0, 1)
    assert channels["landmarks"]["classes"] == {"fire hydrant": {"added": 0, "removed": 1}}
    assert counts(channels["groups"]) == (1, 0, 0, 1)


def test_groups(tmp_path: Path) -> None:
    base = small_map()
    first, second = base.groups
    turned = replace(second, landmark_ids=second.landmark_ids[::-1])
    other = replace(base, groups=(replace(first, covariance=None), turned, Group(("a", "d"), np.zeros(3))))
    found = compare(tmp_path, other)["channels"]["groups"]
    assert counts(found) == (0, 2, 1, 0)
    assert set(found["fields"]) == {"covariance", "order"}


def test_headings_of_groups_wrap(tmp_path: Path) -> None:
    base = small_map()
    groups = tuple(replace(g, map_from_base=g.map_from_base + np.array([0, 0, 2 * np.pi])) for g in base.groups)
    write_map(tmp_path / "a.db", base)
    write_map(tmp_path / "b.db", replace(base, groups=groups))
    found = diff(tmp_path / "a.db", tmp_path / "b.db", ["groups.heading_rad=1e-9"])
    assert found.document["verdict"] == "same"


def test_alignment_is_a_choice(tmp_path: Path) -> None:
    other = moved(small_map(), MOVE)
    assert compare(tmp_path, other)["verdict"] == "different"
    write_map(tmp_path / "b.db", other)
    tolerances = [
        "landmarks.position_m=1e-9", "landmarks.covariance=1e-9",
        "groups.position_m=1e-9", "groups.covariance=1e-9", "groups.heading_rad=1e-9",
    ]  # fmt: skip
    document = diff(tmp_path / "a.db", tmp_path / "b.db", tolerances, aligned=True).document
    assert document["verdict"] == "same"
    assert document["alignment"]["heading_deg"] == pytest.approx(-np.degrees(0.7))


def test_what_moved_in_between_does_not_turn_the_map(tmp_path: Path) -> None:
    """The one suitcase of each map stands elsewhere months later, though no class is rarer."""
    rng = np.random.default_rng(4)
    kinds = ("suitcase", "bench", *("fire hydrant",) * 3, *("potted plant",) * 3)
    places = rng.uniform(-15, 15, (len(kinds), 2))
    later = places + np.eye(len(kinds), 1) * [9.0, 4.0] + np.eye(len(kinds), 1, -1) * [-1.6, 0.5]
    for name, points in (("a.db", places), ("b.db", later)):
        write_map(tmp_path / name, landmarks_at(points, kinds, MOVE if name == "b.db" else None))
    document = diff(tmp_path / "a.db", tmp_path / "b.db", ["landmarks.position_m=1e-6"], aligned=True).document
    assert document["alignment"]["heading_deg"] == pytest.approx(-np.degrees(0.7), abs=1e-6)
    assert counts(document["channels"]["landmarks"]) == (6, 0, 2, 2)


def landmarks_at(points: np.ndarray, classes: tuple[str, ...], move: np.ndarray | None) -> LandmarkMap:
    """Landmarks of a map, on request in another frame."""
    count = len(points)
    whole = LandmarkMap(
        tuple(f"l{number}" for number in range(count)), classes, points, np.zeros((count, 2, 2)),
        np.full(count, 0.2), np.full(count, 9), np.zeros(count, dtype=np.bool_),
    )  # fmt: skip
    return whole if move is None else moved(whole, move)


def test_settings_were_meant_to_differ(tmp_path: Path) -> None:
    for name, sigma_m in (("a.db", 0.05), ("b.db", 0.1)):
        manifest = Manifest("map", {"build_map": {"range_sigma_m": sigma_m}}).entries()
        write_map(tmp_path / name, small_map(), manifest)
    document = diff(tmp_path / "a.db", tmp_path / "b.db").document
    assert document["verdict"] == "same"
    assert document["manifest"] == [{"key": "config.build_map.range_sigma_m", "baseline": 0.05, "candidate": 0.1}]


def test_sources_were_meant_to_differ(tmp_path: Path) -> None:
    document = compare(tmp_path, replace(small_map(), sources=(MapSource("recording", "cafe", 7, 7),)))
    assert document["verdict"] == "same"
    assert {"key": "sources.recording.cafe", "baseline": None, "candidate": "7 of 7 bundles"} in document["manifest"]
