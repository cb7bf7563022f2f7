"""LandmarkMatch: how one bundle was matched to the map, or why not."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import ClassVar, NamedTuple, Self

import numpy as np

from mcap_landmarks.messages.parts import Array, header_to_ros, make, stamp_from_ros
from mcap_landmarks.messages.typestore import RosObject


class Status(IntEnum):
    """What came of localizing one bundle."""

    LOCALIZED = 0
    AMBIGUOUS = 1
    TOO_FEW_OBJECTS = 2
    NO_MATCH = 3
    INCONSISTENT = 4
    WEAK_GEOMETRY = 5


class Condition(NamedTuple):
    """Something that was asked of a bundle: its name with the unit, what it came to, the limit, whether it held."""

    name: str
    value: float
    limit: float
    held: bool


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkMatch:
    """One bundle's match.

    object_ids, landmark_ids and residual_m (K,) belong together; candidates and their scores are what else was
    possible; `expected_accidental` is the number of matches this good expected by chance. `conditions` are those that
    were looked at: a bundle is localized if and only if all of them held. Logs of earlier versions tell none.
    """

    ROS_TYPE: ClassVar[str] = "mcap_landmarks_msgs/msg/LandmarkMatch"

    stamp_ns: int
    frame_id: str
    status: Status
    object_ids: tuple[str, ...] = ()
    landmark_ids: tuple[str, ...] = ()
    residual_m: Array = field(default_factory=lambda: np.zeros(0))
    candidate_ids: tuple[str, ...] = ()
    candidate_scores: Array = field(default_factory=lambda: np.zeros(0))
    expected_accidental: float = 0.0
    chi2: float = 0.0
    dof: int = 0
    bundles_joined: int = 1
    conditions: tuple[Condition, ...] = ()

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make(
            "mcap_landmarks_msgs/LandmarkMatch",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            status=int(self.status),
            object_ids=list(self.object_ids),
            landmark_ids=list(self.landmark_ids),
            residual_m=np.ascontiguousarray(self.residual_m, dtype=np.float64),
            candidate_ids=list(self.candidate_ids),
            candidate_scores=np.ascontiguousarray(self.candidate_scores, dtype=np.float64),
            expected_accidental=self.expected_accidental,
            chi2=self.chi2,
            dof=self.dof,
            bundles_joined=self.bundles_joined,
            condition_names=[one.name for one in self.conditions],
            condition_values=np.array([one.value for one in self.conditions], dtype=np.float64),
            condition_limits=np.array([one.limit for one in self.conditions], dtype=np.float64),
            condition_held=np.array([one.held for one in self.conditions], dtype=np.bool_),
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            Status(ros.status),
            tuple(ros.object_ids),
            tuple(ros.landmark_ids),
            np.array(ros.residual_m, dtype=np.float64),
            tuple(ros.candidate_ids),
            np.array(ros.candidate_scores, dtype=np.float64),
            ros.expected_accidental,
            ros.chi2,
            ros.dof,
            ros.bundles_joined,
            _conditions(ros),
        )


def _conditions(ros: RosObject) -> tuple[Condition, ...]:
    """The conditions of a match; a log that was written before there were any has no such fields."""
    if not hasattr(ros, "condition_names"):
        return ()
    columns = (ros.condition_values.tolist(), ros.condition_limits.tolist(), map(bool, ros.condition_held))
    return tuple(map(Condition, ros.condition_names, *columns))
