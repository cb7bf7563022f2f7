"""A recording with results and truth, for tests."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import MAP, MATCH, POSE, POSE_COVARIANCE, SCENE_OBJECTS, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.match import Condition, LandmarkMatch, Status
from mcap_landmarks.messages.poses import PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, Stamped

from tests.evaluation.scenes import scene

START_NS, STEP_NS = 1_700_000_000 * 10**9, 10**8
LANDMARKS = scene(["person", "suitcase", "bench"], [[0.0, 5], [10, 5], [5, 9]], START_NS, ids=["p", "s", "b"])
OFF_M = 0.1


def localized_messages() -> Iterable[tuple[Channel, int, Message]]:
    """Five bundles: localized 0.1 m off in x, localized, ambiguous, too few objects, localized 2 m off in y."""
    for i in range(5):
        stamp_ns = START_NS + i * STEP_NS
        truth = np.array([1.0 + i, 2.0, 0.1])
        yield TRUTH_POSE, stamp_ns, PoseStamped.planar(stamp_ns, "map", truth)
        names = ["person"] if i == 3 else ["person", "suitcase"]
        yield SCENE_OBJECTS, stamp_ns, scene(names, [[3.0, 0], [0, 3]][: len(names)], stamp_ns)
        status = {2: Status.AMBIGUOUS, 3: Status.TOO_FEW_OBJECTS}.get(i, Status.LOCALIZED)
        matched = ("s", "p") if status is Status.LOCALIZED else ()
        asked = (
            Condition("objects", len(names), 2, held=len(names) >= 2),
            Condition("expected_accidental", 0.3 if i == 2 else 1e-9, 2e-3, held=i != 2),
        )
        found = LandmarkMatch(stamp_ns, "base_footprint", status, landmark_ids=matched, conditions=asked)
        yield MATCH, stamp_ns, found
        if status is Status.LOCALIZED:
            pose = truth + [[OFF_M, 0, 0], [0, 0, 0], [], [], [0, 2.0, 0]][i]
            yield POSE, stamp_ns, PoseStamped.planar(stamp_ns, "map", pose)
            spread = np.diag([OFF_M**2, 4.0, 0.01])
            yield POSE_COVARIANCE, stamp_ns, PoseWithCovarianceStamped.planar(stamp_ns, "map", pose, spread)


def write(path: Path, messages: Iterable[tuple[Channel, int, Message]]) -> Path:
    """Write messages to a recording."""
    with create_recording(path) as writer:
        for channel, time_ns, message in messages:
            writer.add(Stamped(channel, time_ns, message))
    return path


def localized_log(path: Path) -> Path:
    """A recording with everything that localize writes and the truth."""
    once = [(MAP, START_NS, LANDMARKS), (TRUTH_OBJECTS, START_NS, LANDMARKS)]
    return write(path, [*once, *localized_messages()])
