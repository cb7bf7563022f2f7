"""Where the cameras are on the robot, and what their channels are called."""

from dataclasses import dataclass, replace

import numpy as np
from mcap_landmarks.channels import BASE_FRAME, CAMERA_IMAGE, CAMERA_INFO
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.stage import Channel
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.solid import rotation
from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.robot import (
    BASE_FROM_OPTICAL,
    CAMERA_FROM_LINK_M,
    CAMERA_IN_BASE_M,
    OPTICAL_FRAME,
    OPTICAL_FROM_CAMERA_M,
    OPTICAL_FROM_CAMERA_XYZW,
)
from mcap_landmarks_generator.scenario import Scenario
from mcap_landmarks_generator.sensor_specs import CameraSpec, MountedCameraSpec

Floats = NDArray[np.float64]
Frame = tuple[str, str, tuple[float, ...], Floats]
"""Parent, child, translation (3,) and quaternion (4,) x, y, z, w of a fixed transform."""


@dataclass(frozen=True, slots=True, eq=False)
class Mount:
    """A camera: its settings and seed, its channels, its optical frame, and where that is in base_footprint: position
    (3,) in m and rotation (3, 3)."""

    spec: CameraSpec
    seed: int
    image: Channel[CompressedImage]
    info: Channel[CameraInfo]
    frame_id: str
    position_m: Floats
    base_from_optical: Floats

    def scenario(self, scenario: Scenario) -> Scenario:
        """A scenario with this camera as its only one."""
        return replace(scenario, camera=self.spec, cameras=(), seed=self.seed)


def mounts(scenario: Scenario) -> tuple[Mount, ...]:
    """The robot's own camera, then the further ones in their order."""
    first = Mount(
        scenario.camera,
        scenario.seed,
        CAMERA_IMAGE,
        CAMERA_INFO,
        OPTICAL_FRAME,
        CAMERA_IN_BASE_M,
        BASE_FROM_OPTICAL,
    )
    # Each further camera draws as the only one of another seed would.
    seeds = [int(draws(scenario.seed, Stream.CAMERAS, i).integers(2**62)) for i in range(len(scenario.cameras))]
    return (first, *(_mount(spec, seed) for spec, seed in zip(scenario.cameras, seeds, strict=True)))


def camera_frames(scenario: Scenario) -> list[Frame]:
    """The fixed frames of all cameras."""
    upright = np.array([0.0, 0.0, 0.0, 1.0])
    frames: list[Frame] = [
        ("base_link", "camera_link", CAMERA_FROM_LINK_M, upright),
        ("camera_link", OPTICAL_FRAME, OPTICAL_FROM_CAMERA_M, np.array(OPTICAL_FROM_CAMERA_XYZW)),
    ]
    for spec in scenario.cameras:
        left, up = np.deg2rad(spec.yaw_deg) / 2, np.deg2rad(spec.pitch_deg) / 2
        aside = np.array([0.0, 0.0, np.sin(left), np.cos(left)])
        turn = _product(aside, np.array([0.0, -np.sin(up), 0.0, np.cos(up)]))
        optical = _product(turn, np.array(OPTICAL_FROM_CAMERA_XYZW))
        frames.append((BASE_FRAME, frame_of(spec), spec.at, optical))
    return frames


def frame_of(spec: MountedCameraSpec) -> str:
    """The name of a further camera's optical frame."""
    return f"{spec.name}_optical_frame"


def _product(first: Floats, second: Floats) -> Floats:
    """Quaternion (4,) of the rotation `second` followed by `first`, in double precision as PyBullet's is not."""
    vector = first[3] * second[:3] + second[3] * first[:3] + np.cross(first[:3], second[:3])
    return np.array([*vector, first[3] * second[3] - first[:3] @ second[:3]])


def _mount(spec: MountedCameraSpec, seed: int) -> Mount:
    turn = rotation((0, 0, 1), np.deg2rad(spec.yaw_deg)) @ rotation((0, 1, 0), -np.deg2rad(spec.pitch_deg))
    return Mount(
        spec,
        seed,
        Channel(f"/{spec.name}/image_raw/compressed", CompressedImage),
        Channel(f"/{spec.name}/camera_info", CameraInfo),
        frame_of(spec),
        np.array(spec.at),
        turn @ BASE_FROM_OPTICAL,
    )
