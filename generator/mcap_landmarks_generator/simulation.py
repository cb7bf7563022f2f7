"""Drives the robot along its way and lets its sensors measure: everything a recording holds, in order of log time."""

import heapq
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from mcap_landmarks.channels import BASE_FRAME, TF_STATIC
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.stage import Stamped

from mcap_landmarks_generator.camera import Camera, ImageJob
from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.clock import to_ns
from mcap_landmarks_generator.ground_truth import GroundTruth
from mcap_landmarks_generator.history import History
from mcap_landmarks_generator.imu import IMU_FRAME, KNOWN_AFTER_NS, ImuSensor
from mcap_landmarks_generator.lidar import Lidar
from mcap_landmarks_generator.mounts import camera_frames, mounts
from mcap_landmarks_generator.odometry import OdometrySensor, true_poses
from mcap_landmarks_generator.ring_lidar import RINGS_FRAME, RingLidar
from mcap_landmarks_generator.robot import LINK_FROM_FOOTPRINT_M, SCAN_FRAME, SCAN_FROM_LINK_M
from mcap_landmarks_generator.scenario import Scenario
from mcap_landmarks_generator.trajectory import STEPS_PER_COMMAND, Driver, Steering
from mcap_landmarks_generator.world import STEP_NS, World

Event = Stamped | ImageJob

_STEPS_PER_CONTACT_CHECK = 8
_STUCK_AFTER_NS = 15 * 10**9
_STUCK_WITHIN_M = 0.02
_STUCK_WITHIN_RAD = 0.05


class Simulation:
    """One run of a staged scenario; afterwards `collisions` and `end_ns` say how it went.

    Without `steering` the robot drives the scenario's way, and must not get stuck there.
    """

    def __init__(self, staged: Staged, steering: Steering | None = None) -> None:
        self.collisions: list[tuple[int, str]] = []
        """Time after the start in ns and id of the object, each time the robot runs into one."""
        self.end_ns = 0
        self._staged = staged
        scenario = staged.scenario
        self._is_watched = steering is None
        self._steering = steering or Driver(scenario.trajectory, staged.start, scenario.robot.speed_factor)
        self._history = History()
        self._cameras = [Camera(mount, i, scenario.start_ns) for i, mount in enumerate(mounts(scenario))]
        self._lidar = Lidar(scenario.lidar, scenario.seed, scenario.start_ns)
        rings = scenario.ring_lidar
        self._rings = RingLidar(rings, staged.objects, scenario.seed, scenario.start_ns) if rings is not None else None
        imu = scenario.imu
        self._imu = ImuSensor(imu, scenario.seed, scenario.start_ns) if imu is not None else None
        self._odometry = OdometrySensor(scenario.odometry, scenario.seed, scenario.start_ns)
        self._truth = GroundTruth(scenario.truth, staged.objects, scenario.start_ns)
        self._touched: set[str] = set()

    def run(self, progress: Callable[[int], None] = lambda _: None) -> Iterator[Event]:
        """All messages and images to render, by rising log time; `progress` gets each full simulated second.

        Raises:
            ToolkitError: the robot got stuck.
        """
        waiting: list[tuple[int, int, Event]] = []
        count = 0
        for event in self._events(progress):
            if event is not None:
                heapq.heappush(waiting, (event.log_time_ns, count, event))
                count += 1
                continue
            # What is measured later is logged later than the step before this one, but for what is known later.
            safe_ns = self._staged.scenario.start_ns + self._history.end_ns - STEP_NS - KNOWN_AFTER_NS
            while waiting and waiting[0][0] < safe_ns:
                yield heapq.heappop(waiting)[2]
        while waiting:
            yield heapq.heappop(waiting)[2]

    def _events(self, progress: Callable[[int], None]) -> Iterator[Event | None]:
        """Messages and jobs as they are measured, and None after each step of time."""
        staged, steering = self._staged, self._steering
        watch = _StuckWatch()
        frames = static_transforms(staged.scenario.start_ns, staged.scenario)
        yield replace(frames, log_time_ns=frames.log_time_ns + to_ns(staged.scenario.robot.frames_after_s))
        with World(staged.objects, staged.start) as world:
            standing, step = False, 0
            self._history.append(world.robot.state(), standing)
            while not steering.done:
                if step % STEPS_PER_COMMAND == 0:
                    pose = true_poses(self._history, np.array([self._history.end_ns]))[0]
                    command = steering.command(pose)
                    standing = command.standing
                    world.robot.drive(command.speed_mps, command.turn_radps)
                    if self._is_watched:
                        watch.look(pose, self._history.end_ns, standing, self)
                world.move_walkers(self._history.end_ns / 1e9)
                world.step()
                step += 1
                self._history.append(world.robot.state(), standing)
                if step % _STEPS_PER_CONTACT_CHECK == 0:
                    self._note_collisions(world)
                yield from self._measure(world)
                yield None
                if self._history.end_ns % 10**9 == 0:
                    progress(1)
        self.end_ns = self._history.end_ns

    def _measure(self, world: World) -> Iterator[Event]:
        yield from self._truth.measure(self._history)
        yield from self._odometry.measure(self._history)
        if self._imu is not None:
            yield from self._imu.measure(self._history)
        yield from self._lidar.measure(self._history, world)
        if self._rings is not None:
            yield from self._rings.measure(self._history)
        for camera in self._cameras:
            yield from camera.measure(self._history)

    def _note_collisions(self, world: World) -> None:
        touched = world.touched()
        self.collisions.extend((self._history.end_ns, name) for name in sorted(touched - self._touched))
        self._touched = touched


class _StuckWatch:
    """Notices that the robot wants to move and does not."""

    def __init__(self) -> None:
        self._pose = np.full(3, np.inf)
        self._since_ns = 0

    def look(self, pose: np.ndarray, now_ns: int, standing: bool, run: Simulation) -> None:
        moved = np.hypot(*(pose - self._pose)[:2]) > _STUCK_WITHIN_M or abs(pose[2] - self._pose[2]) > _STUCK_WITHIN_RAD
        if standing or moved:
            self._pose, self._since_ns = pose, now_ns
        elif now_ns - self._since_ns > _STUCK_AFTER_NS:
            touched = f"; it touches {run.collisions[-1][1]}" if run.collisions else ""
            raise ToolkitError(
                f"{now_ns / 1e9:.0f} s after the start the robot is stuck at ({pose[0]:.2f}, {pose[1]:.2f}){touched}: "
                "move the waypoints away from there"
            )


def static_transforms(start_ns: int, scenario: Scenario | None = None) -> Stamped:
    """The robot's fixed frames: base_footprint, base_link, base_scan, camera_link, camera_rgb_optical_frame, and those
    of the further sensors of a scenario."""
    upright = np.array([0.0, 0.0, 0.0, 1.0])
    places = [
        (BASE_FRAME, "base_link", LINK_FROM_FOOTPRINT_M, upright),
        ("base_link", SCAN_FRAME, SCAN_FROM_LINK_M, upright),
        *camera_frames(scenario or Scenario()),
    ]
    if scenario is not None and scenario.imu is not None:
        places.append((BASE_FRAME, IMU_FRAME, (0.0, 0.0, 0.0), upright))
    if scenario is not None and scenario.ring_lidar is not None:
        places.append((BASE_FRAME, RINGS_FRAME, (0.0, 0.0, scenario.ring_lidar.height_m), upright))
    transforms = tuple(
        Transform(start_ns, parent, child, np.array(translation), rotation)
        for parent, child, translation, rotation in places
    )
    return Stamped(TF_STATIC, start_ns, TFMessage(transforms))
