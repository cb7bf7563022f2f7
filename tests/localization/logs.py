"""Logs that were localized in every way, with bundles of every status, for tests."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import MATCH, SCENE_OBJECTS
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.maps.scene_objects import pick
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Bundle, Stamped
from mcap_landmarks.stages.localize import process

from tests.stages.worlds import circle, drive, ring


def unique_classes() -> tuple[tuple[str, ...], np.ndarray]:
    """A ring of landmarks that each have a class of their own."""
    positions = ring()[1]
    return tuple(f"tag {i}" for i in range(len(positions))), positions


def bundles(classes: tuple[str, ...], positions: np.ndarray, count: int = 24) -> list[Bundle]:
    """A drive around a ring; every sixth bundle has one object, every sixth an object in a wrong place."""
    found = []
    for i, bundle in enumerate(drive(circle(count=count), classes, positions, seed=2)):
        scene = bundle.get(SCENE_OBJECTS)
        assert scene is not None
        if i % 6 == 2:
            scene = pick(scene, range(min(1, len(scene))))
        elif i % 6 == 4 and len(scene):
            scene = pick(scene, range(min(2, len(scene))))
            scene = replace(scene, positions_xy=scene.positions_xy + np.eye(2)[: len(scene)])
        found.append(replace(bundle, messages={SCENE_OBJECTS: scene}))
    return found


def localized(
    folder: Path, classes: tuple[str, ...], positions: np.ndarray, seen: list[Bundle], config: LocalizeConfig
) -> list[Stamped]:
    """What localize makes of bundles."""
    names = tuple(f"l{i}" for i in range(len(classes)))
    write_map(folder / "map.db", LandmarkMap.surveyed(names, classes, positions, MapSource("import", "test")))
    return [entry for entry in process(seen, config, {"map": folder / "map.db"}) if isinstance(entry, Stamped)]


def write_log(path: Path, seen: list[Bundle], results: list[Stamped]) -> Path:
    """Bundles and what localize made of them, as one recording."""
    scenes = [Stamped(SCENE_OBJECTS, one.log_time_ns, one.messages[SCENE_OBJECTS]) for one in seen]
    with create_recording(path) as writer:
        for entry in sorted([*scenes, *results], key=lambda entry: entry.log_time_ns):
            writer.add(entry)
    return path


def matches(results: list[Stamped]) -> Iterator[LandmarkMatch]:
    """The matches among the results."""
    return (entry.message for entry in results if isinstance(entry.message, LandmarkMatch) and entry.channel == MATCH)
