"""Single objects seen by the robot from all sides and distances, as the thesis tried out its objects (Appendix A)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mcap_landmarks.channels import SCAN
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.geometry.angles import quaternion_from_yaw
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scan import LaserScan
from numpy.typing import NDArray

from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.camera import Intrinsics, Viewpoint
from mcap_landmarks_generator.history import History
from mcap_landmarks_generator.layout import place
from mcap_landmarks_generator.lidar import Lidar
from mcap_landmarks_generator.optics import Image, Optics
from mcap_landmarks_generator.renderer import Renderer
from mcap_landmarks_generator.robot import BASE_FROM_OPTICAL, CAMERA_IN_BASE_M, SCAN_IN_BASE_M, RobotState
from mcap_landmarks_generator.scenario import ObjectSpec, Scenario
from mcap_landmarks_generator.visibility import true_detections
from mcap_landmarks_generator.world import World

Floats = NDArray[np.float64]

DISTANCES_M = (2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0)
"""From where the robot sees an object whole to the end of its LiDAR's range."""
YAWS_DEG = (0, 45, 90, 135, 180, 225, 270, 315)
"""From straight ahead of an object's front, counter-clockwise about it."""
_STOOD_NS = 500_000_000
"""Two turns of the LiDAR as a scenario has it."""
_ASIDE_M = 1000.0
"""The robot's body waits so far away: only its sensors look."""


@dataclass(frozen=True, slots=True, eq=False)
class ObjectView:
    """An object straight ahead of the robot: the image (H, W, 3), the truth about it there, and a scan.

    `yaw_deg` is the side that is seen, 0 its front. Nothing else is there for a beam to meet. `lidar_m` (3,) is where
    the LiDAR sits in the base frame.
    """

    distance_m: float
    yaw_deg: int
    image: Image
    truth: Detections
    scan: LaserScan
    lidar_m: Floats


def objects_of(names: Sequence[str]) -> list[tuple[str, str]]:
    """Every variant of some classes, of all that detectors know if there are none, as (class, variant).

    Raises:
        ToolkitError: there is no such class.
    """
    unknown = [name for name in names if name not in catalog.COCO_ID]
    if unknown:
        raise ToolkitError(f"the generator has no {unknown[0]}; it has {', '.join(catalog.COCO_ID)}")
    return [(name, variant) for name in names or catalog.COCO_ID for variant in catalog.VARIANTS[name]]


def views(class_name: str, variant: str, seed: int, distances_m: Sequence[float] = DISTANCES_M) -> Iterator[ObjectView]:
    """One object from every distance and side; `seed` decides its shape and looks, and the sensors' noise.

    A view in which nothing of it shows is left out.
    """
    objects = place((ObjectSpec(class_name=class_name, at=(0.0, 0.0), variant=variant, look=seed),))
    scenario = Scenario(seed=seed)
    optics = Optics(scenario.camera, Intrinsics.of(scenario.camera).focal_px, seed)
    renderer = Renderer(scenario, objects)
    with World(objects, np.array([_ASIDE_M, 0.0, 0.0])) as world:
        for index, (distance_m, yaw_deg) in enumerate((d, yaw) for d in distances_m for yaw in YAWS_DEG):
            base = _opposite(distance_m, np.deg2rad(yaw_deg))
            view = _viewpoint(base)
            rendered = renderer.draw(view)
            truth = true_detections(rendered, renderer, view, 0)
            if not len(truth.ids):
                continue
            image = optics.developed(optics.expose(rendered.image, index, 0.0))
            lidar = Lidar(scenario.lidar, seed + index, 0)
            scan = next(stamped.get(SCAN) for stamped in lidar.measure(_standing(base), world))
            assert scan is not None  # noqa: S101 - a LiDAR measures scans
            yield ObjectView(distance_m, yaw_deg, image, truth, scan, np.asarray(SCAN_IN_BASE_M))


def _opposite(distance_m: float, yaw_rad: float) -> Floats:
    """The pose (3,) from which the robot looks at the origin from a side of it."""
    return np.array([distance_m * np.cos(yaw_rad), distance_m * np.sin(yaw_rad), yaw_rad + np.pi])


def _viewpoint(base: Floats) -> Viewpoint:
    c, s = np.cos(base[2]), np.sin(base[2])
    world_from_base = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    eye = np.array([base[0], base[1], 0.0]) + world_from_base @ CAMERA_IN_BASE_M
    return Viewpoint(eye, world_from_base @ BASE_FROM_OPTICAL, 0.0)


def _standing(base: Floats) -> History:
    """The past of a robot that has stood there for a turn of the LiDAR."""
    history = History()
    state = RobotState(np.array([base[0], base[1], 0.0]), quaternion_from_yaw(base[2]), np.zeros(2))
    while history.end_ns < _STOOD_NS:
        history.append(state, standing=True)
    return history
