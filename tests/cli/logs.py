"""Small logs of scene objects, odometry and truth for the verbs to chew on."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import ODOMETRY, SCENE_OBJECTS, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped

from tests.stages.worlds import circle, drifting, ring, scene

Change = Callable[[list[Stamped]], list[Stamped]]


def messages(seed: int = 1, count: int = 120, renamed: Mapping[str, str] | None = None) -> list[Stamped]:
    """A lap through the ring; every object has a class of its own, unless it is `renamed`."""
    _, positions = ring()
    ids = tuple(f"tag {i}" for i in range(len(positions)))
    classes = tuple((renamed or {}).get(name, name) for name in ids)
    poses, rng = circle(1.05, count=count), np.random.default_rng(seed)
    odometry = drifting(poses, rng)
    n = len(classes)
    truth = SceneObjects(
        1, "map", ids, tuple(((c, 1.0),) for c in classes), positions, np.zeros((n, 2, 2)), np.zeros(n)
    )
    found = [Stamped(TRUTH_OBJECTS, 1, truth)]
    for i, pose in enumerate(poses):
        now = 1 + i * 500_000_000
        step = Odometry.planar(now, ("odom", "base"), odometry[i], np.zeros((3, 3)))
        found += [
            Stamped(TRUTH_POSE, now, PoseStamped.planar(now, "map", pose)),
            Stamped(ODOMETRY, now, step),
            Stamped(SCENE_OBJECTS, now, scene(pose, classes, positions, rng, now)),
        ]
    return found


def write(path: Path, content: list[Stamped]) -> Path:
    """A recording of messages as they come."""
    with create_recording(path) as writer:
        for stamped in content:
            writer.add(stamped)
    return path
