"""UTIAS MRCLAM 6 (Leung et al. 2011) with its 15 landmark classes taken modulo 3: real robots, classes that repeat."""

import contextlib
import dataclasses
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import POSE, SCENE_OBJECTS
from mcap_landmarks.cli.main import run
from mcap_landmarks.evaluation.read import read_reference
from mcap_landmarks.evaluation.trajectory import Trajectory, interpolated
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.database import read_map, write_map
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.layered_log import LayeredLog, own_layer
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.stage_input import StageInput
from mcap_landmarks.stage import Bundle, Stamped
from mcap_landmarks.stages.localize import STAGE, LocalizeConfig, process

from tests.benchmark.rows import Row
from tests.benchmark.stretches import in_parallel

_MODULO = 3
_GAP_NS = 10**9
_MANY = 3


def modulo_rows(data: Path) -> Iterator[Row]:
    """Pooled over five robots against the surveyed map: how many positions are off, and how many bundles have one."""
    with tempfile.TemporaryDirectory() as folder:
        logs = Path(folder) / "d6"
        _call("convert", data / "mrclam" / "MRCLAM_Dataset6.zip", "-o", logs)
        database = Path(folder) / "map.db"
        _call("map", logs / "robot1.mcap", "--from-reference", "--map", database)
        surveyed = read_map(database)
        write_map(database, dataclasses.replace(surveyed, classes=tuple(map(_renamed, surveyed.classes))))
        robots = sorted(logs.glob("robot*.mcap"))
        counts = np.sum(in_parallel(lambda i: _counts(robots[i], database), len(robots)), axis=0)
    localized, wrong, large, large_localized = counts.tolist()
    yield Row("mrclam6_modulo_3", wrong / localized, at_most=0.01, cases=localized)
    yield Row("mrclam6_modulo_3_localized", large_localized / large, at_least=0.5, cases=large)


def _call(*words: object) -> None:
    """Run the command line; what it says does not belong to the benchmark's own output."""
    try:
        with contextlib.redirect_stdout(sys.stderr):
            run([str(word) for word in words])
    except SystemExit as stop:
        if stop.code:
            raise


def _renamed(name: str) -> str:
    return f"class {int(name.rsplit('_', 1)[1]) % _MODULO}"


def _counts(log: Path, database: Path) -> tuple[int, int, int, int]:
    """Bundles of one robot that are localized, wrong, of three objects or more, and localized among these."""
    truth = read_reference(log)[0].trajectory
    assert truth is not None
    with open_recording(log) as recording:
        source = StageInput(STAGE, LayeredLog(log, [own_layer(recording)]), Span())
        bundles = [_modulo(bundle) for bundle in source.bundles(lambda _count: None)]
    many = {bundle.log_time_ns for bundle in bundles if len(_objects(bundle)) >= _MANY}
    results = process(bundles, LocalizeConfig(), {"map": database})
    poses = {stamped.log_time_ns: _pose(stamped) for stamped in results if stamped.channel == POSE}
    times = np.array(sorted(poses), dtype=np.int64)
    pairs = interpolated(Trajectory.of(times, np.array([poses[time] for time in times])), truth, _GAP_NS)
    far = [np.linalg.norm(poses[int(times[i])][:2] - pose[:2]) > 1 for i, pose in zip(*pairs, strict=True)]
    return len(far), int(sum(far)), len(many), len(many & set(poses))


def _pose(stamped: Stamped) -> Array:
    assert isinstance(stamped.message, PoseStamped)
    return stamped.message.pose


def _objects(bundle: Bundle) -> SceneObjects:
    scene = bundle.get(SCENE_OBJECTS)
    assert scene is not None
    return scene


def _modulo(bundle: Bundle) -> Bundle:
    scene = _objects(bundle)
    options = tuple(tuple((_renamed(name), score) for name, score in found) for found in scene.hypotheses)
    renamed = dataclasses.replace(scene, hypotheses=options)
    return dataclasses.replace(bundle, messages={**bundle.messages, SCENE_OBJECTS: renamed})
