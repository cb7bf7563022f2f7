"""The robot: a Turtlebot3 Waffle Pi of our own URDF, driven by its wheels, and where its sensors are."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap_landmarks.geometry.angles import quaternion_from_yaw
from numpy.typing import NDArray

from mcap_landmarks_generator.engine import pybullet

Floats = NDArray[np.float64]

# Dimensions and limits of the Turtlebot3 Waffle Pi (ROBOTIS e-Manual; decisions on robot and sensors).
WHEEL_RADIUS_M = 0.033
WHEEL_DISTANCE_M = 0.287
MAX_SPEED_MPS = 0.26
MAX_TURN_RADPS = 1.82
LINK_FROM_FOOTPRINT_M = (0.0, 0.0, 0.010)
SCAN_FROM_LINK_M = (-0.064, 0.0, 0.122)
CAMERA_FROM_LINK_M = (0.073, -0.011, 0.084)
OPTICAL_FROM_CAMERA_M = (0.003, 0.011, 0.009)
OPTICAL_FROM_CAMERA_XYZW = (-0.5, 0.5, -0.5, 0.5)

SCAN_IN_BASE_M = np.add(LINK_FROM_FOOTPRINT_M, SCAN_FROM_LINK_M)
"""Position (3,) of the LiDAR in base_footprint."""
CAMERA_IN_BASE_M = np.sum([LINK_FROM_FOOTPRINT_M, CAMERA_FROM_LINK_M, OPTICAL_FROM_CAMERA_M], axis=0)
"""Position (3,) of the camera in base_footprint."""
BASE_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation (3, 3): the camera looks along the robot's x, its image's right is the robot's -y, down is -z."""

SCAN_FRAME, OPTICAL_FRAME = "base_scan", "camera_rgb_optical_frame"

_URDF = Path(__file__).parent / "robots" / "waffle_pi.urdf"
_WHEELS = (0, 1)
_WHEEL_FORCE_NM = 2.0
# Bullet's group of moving bodies; rays that look for static bodies only (its group 2) pass through the robot.
STATIC_GROUP = 2


@dataclass(frozen=True, slots=True, eq=False)
class RobotState:
    """Where base_footprint is: position (3,) m, quaternion (4,) x, y, z, w; wheel angles (2,) rad, left and right."""

    position_m: Floats
    orientation_xyzw: Floats
    wheels_rad: Floats


class Robot:
    """The robot's body in one PyBullet client."""

    def __init__(self, client: int, pose: Floats) -> None:
        """Put the robot at x, y, heading (3,)."""
        self._client = client
        orientation = quaternion_from_yaw(pose[2])
        self._body: int = pybullet.loadURDF(str(_URDF), physicsClientId=client)
        self._com_in_base = np.array(pybullet.getDynamicsInfo(self._body, -1, physicsClientId=client)[3])
        position = np.array([pose[0], pose[1], 0.0]) + _rotation(orientation) @ self._com_in_base
        pybullet.resetBasePositionAndOrientation(
            self._body, position.tolist(), orientation.tolist(), physicsClientId=client
        )
        undamped = {"linearDamping": 0.0, "angularDamping": 0.0, "rollingFriction": 0.0, "spinningFriction": 0.0}
        # The body rests on its castors, which roll freely, and must not fall asleep at a stop.
        pybullet.changeDynamics(
            self._body,
            -1,
            lateralFriction=0.0,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=client,
            **undamped,
        )
        for wheel in _WHEELS:
            pybullet.changeDynamics(
                self._body, wheel, lateralFriction=1.0, jointDamping=0.0, physicsClientId=client, **undamped
            )

    def drive(self, speed_mps: float, turn_radps: float) -> None:
        """Let the wheel motors hold the speeds of a forward speed and a turn rate."""
        difference = turn_radps * WHEEL_DISTANCE_M / 2
        pybullet.setJointMotorControlArray(
            self._body,
            _WHEELS,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[(speed_mps - difference) / WHEEL_RADIUS_M, (speed_mps + difference) / WHEEL_RADIUS_M],
            forces=[_WHEEL_FORCE_NM, _WHEEL_FORCE_NM],
            physicsClientId=self._client,
        )

    def state(self) -> RobotState:
        """The state after the last physics step."""
        position, quaternion = pybullet.getBasePositionAndOrientation(self._body, physicsClientId=self._client)
        orientation = np.array(quaternion)
        base = np.array(position) - _rotation(orientation) @ self._com_in_base
        wheels = pybullet.getJointStates(self._body, _WHEELS, physicsClientId=self._client)
        return RobotState(base, orientation, np.array([wheels[0][0], wheels[1][0]]))

    def touching(self) -> set[int]:
        """Ids of the bodies that the robot has contact with, the ground included."""
        return {contact[2] for contact in pybullet.getContactPoints(self._body, physicsClientId=self._client)}


def _rotation(quaternion_xyzw: Floats) -> Floats:
    return np.array(pybullet.getMatrixFromQuaternion(quaternion_xyzw.tolist())).reshape(3, 3)
