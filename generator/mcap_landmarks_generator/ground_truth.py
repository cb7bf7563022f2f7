"""What is really there: the robot's pose and the objects, on channels that no stage reads."""

from collections.abc import Iterator, Sequence

import numpy as np
from mcap_landmarks.channels import MAP_FRAME, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Stamped

from mcap_landmarks_generator.clock import regular_times
from mcap_landmarks_generator.history import History
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.sensor_specs import TruthSpec

_OBJECTS_HZ = 10.0


class GroundTruth:
    """True poses and objects of one simulated recording, in order; stamped and logged when they hold."""

    def __init__(self, spec: TruthSpec, objects: Sequence[PlacedObject], start_ns: int) -> None:
        self._start_ns = start_ns
        self._landmarks = [placed for placed in objects if placed.is_landmark]
        self._pose_times, self._object_times = regular_times(spec.rate_hz), regular_times(_OBJECTS_HZ)
        self._next_pose_ns, self._next_objects_ns = next(self._pose_times), next(self._object_times)
        self._moving = any(placed.moves for placed in self._landmarks)

    def measure(self, history: History) -> Iterator[Stamped]:
        """The truth up to the present; objects once at the start, and again and again only if any of them moves."""
        while self._next_pose_ns <= history.end_ns:
            at_ns = np.array([self._next_pose_ns])
            stamp_ns = self._start_ns + self._next_pose_ns
            pose = PoseStamped(stamp_ns, MAP_FRAME, history.positions(at_ns)[0], history.orientations(at_ns)[0])
            yield Stamped(TRUTH_POSE, stamp_ns, pose)
            self._next_pose_ns = next(self._pose_times)
        while self._next_objects_ns <= history.end_ns and (self._moving or self._next_objects_ns == 0):
            yield self._objects(self._next_objects_ns)
            self._next_objects_ns = next(self._object_times)

    def _objects(self, time_ns: int) -> Stamped:
        placed = self._landmarks
        message = SceneObjects(
            stamp_ns=self._start_ns + time_ns,
            frame_id=MAP_FRAME,
            ids=tuple(one.object_id for one in placed),
            hypotheses=tuple(((one.asset.name, 1.0),) for one in placed),
            positions_xy=np.array([one.pose_at(time_ns / 1e9)[:2] for one in placed]).reshape(-1, 2),
            covariances=np.zeros((len(placed), 2, 2)),
            radii_m=np.array([one.asset.section.radius_m for one in placed]),
        )
        return Stamped(TRUTH_OBJECTS, message.stamp_ns, message)
