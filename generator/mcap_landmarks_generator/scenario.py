"""What a scenario says: world, robot, sensors, noise and way, as checked dataclasses.

The names, units and defaults here are those of the TOML files; `schemas/json/scenario.schema.json` is made from them.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter

from mcap_landmarks_generator.assets import catalog, ground, sky
from mcap_landmarks_generator.sensor_specs import (
    CONFIG,
    CameraSpec,
    ImuSpec,
    LidarSpec,
    MountedCameraSpec,
    NotNegative,
    OdometrySpec,
    Positive,
    RingLidarSpec,
    TruthSpec,
)

Seed = Annotated[int, Field(ge=0)]
Session = Annotated[int, Field(ge=1)]
Point = tuple[float, float]


def _among(names: tuple[str, ...]) -> Callable[[str], str]:
    def check(name: str) -> str:
        if name not in names:
            raise ValueError(f"choose one of {', '.join(names)}")
        return name

    return check


_OBJECTS = catalog.CLASSES + catalog.DISTRACTORS + catalog.STRUCTURES
StandIn = Annotated[str, AfterValidator(_among(("", *_OBJECTS))), Field(json_schema_extra={"enum": ["", *_OBJECTS]})]
ClassName = Annotated[str, AfterValidator(_among(_OBJECTS)), Field(json_schema_extra={"enum": list(_OBJECTS)})]
Ground = Annotated[str, AfterValidator(_among(ground.KINDS)), Field(json_schema_extra={"enum": list(ground.KINDS)})]
Sky = Annotated[str, AfterValidator(_among(sky.KINDS)), Field(json_schema_extra={"enum": list(sky.KINDS)})]


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectSpec:
    """An object of the world."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    class_name: Annotated[ClassName, Field(alias="class")]
    """Class, distractor or structure, as the generator's catalog names it."""
    at: Point
    """Where the centre of its section at LiDAR height stands, in metres of the frame map."""
    yaw_deg: float = 0.0
    """Direction that its front faces; of one who walks, until the first step."""
    variant: str = ""
    """Variant of the class; the class's first if empty."""
    look: Seed = 0
    """Seed of its shape and texture."""
    walk: tuple[Point, ...] = ()
    """Points that it walks or drives to, one after the other, and back to its start, again and again."""
    speed_mps: Positive = 0.8
    """Its speed there."""
    sessions: tuple[Session, ...] = ()
    """Sessions in which it is there; in all of them if left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupsSpec:
    """Groups of objects at random places, and a way past them; `seed` decides."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    count: Annotated[int, Field(ge=1)]
    """How many groups."""
    size: Annotated[int, Field(ge=1, le=8)] = 3
    """Objects per group."""
    classes: Annotated[tuple[ClassName, ...], Field(min_length=1)] = ("fire hydrant", "person", "suitcase")
    """Classes to draw from."""
    spacing_m: Annotated[float, Field(ge=12)] = 14.0
    """Distance of neighbouring groups along the way."""
    aside_m: Annotated[float, Field(ge=3)] = 5.0
    """Distance of a group's middle from the way."""
    spread_m: Annotated[float, Field(gt=0, le=4)] = 2.5
    """Radius of a group; its objects keep 1.2 m apart."""
    looks: Annotated[int, Field(ge=1)] = 6
    """How many different looks a class has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldSpec:
    """A world in SDF (Gazebo's format) whose models become the objects."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    file: str
    """The world's file, beside this one."""
    classes: dict[str, StandIn] = field(default_factory=dict)
    """Class (or distractor, or structure) of models by pattern of names or URIs, such as "shelf_*"; empty: left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundSpec:
    """The ground."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    kind: Ground = "concrete"
    """What it is made of."""
    look: Seed = 0
    """Seed of its texture."""
    tile_m: Positive = 2.0
    """Side of a tile of its texture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BackgroundSpec:
    """Sky and horizon."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    kind: Sky = "hills"
    """What stands along the horizon."""
    look: Seed = 0
    """Seed of its picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LightSpec:
    """The sun."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    azimuth_deg: float = 50.0
    """Direction that the light comes from, counter-clockwise from x."""
    elevation_deg: Annotated[float, Field(ge=10, le=90)] = 50.0
    """Height of the sun."""
    ambient: Annotated[float, Field(ge=0, le=1)] = 0.55
    """Light that comes from everywhere."""
    diffuse: Annotated[float, Field(ge=0, le=1)] = 0.7
    """Light that comes from the sun."""
    shade: Annotated[float, Field(ge=0, le=1)] = 0.45
    """Share of the light that a shadow on the ground takes."""

    def towards(self) -> NDArray[np.float64]:
        """Unit vector (3,) from the world to the sun."""
        azimuth, elevation = np.deg2rad(self.azimuth_deg), np.deg2rad(self.elevation_deg)
        level = np.cos(elevation)
        return np.array([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)])


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSpec:
    """The robot, a Turtlebot3 Waffle Pi."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    start: tuple[float, float, float] | None = None
    """x in m, y in m and heading in degrees at the start; on the first waypoint if left out."""
    speed_factor: Positive = 1.0
    """Multiplies the limits 0.26 m/s and 1.82 rad/s."""
    frames_after_s: NotNegative = 0.0
    """How long after the start its fixed frames are logged: latched messages may come late."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """A point of the way."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    at: Point
    """Where, in metres of the frame map."""
    heading_deg: float | None = None
    """Heading to turn to; the robot stops for it."""
    stop_s: NotNegative = 0.0
    """How long to stand there."""

    @property
    def is_stop(self) -> bool:
        """Whether the robot comes to rest there."""
        return self.heading_deg is not None or self.stop_s > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectorySpec:
    """The way of the robot: straight from point to point, corners cut by the lookahead."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    waypoints: tuple[Waypoint, ...] = ()
    """Points of the way, in order."""
    laps: Annotated[int, Field(ge=1)] = 1
    """How often the way is driven, from the last point straight to the first."""
    lookahead_m: Positive = 0.5
    """How far ahead the robot aims (pure pursuit)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A world, a robot and its way: all that a simulated recording is made from."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    description: str = ""
    """What the scenario is for, in one sentence."""
    seed: Seed = 0
    """Seed of all randomness: noise, slip, jitter, groups."""
    session: Session = 1
    """Which session this is: between the sessions of one place objects appear and vanish."""
    start_ns: Annotated[int, Field(ge=0, lt=2**62)] = 1_767_225_600_000_000_000
    """Time of the start, in nanoseconds since 1970."""
    objects: tuple[ObjectSpec, ...] = ()
    """The objects of the world."""
    groups: GroupsSpec | None = None
    """Groups of objects at random places, beside `objects`; their way stands in for `trajectory.waypoints`."""
    world: WorldSpec | None = None
    """A world in SDF, whose models stand in for `objects` and `groups`."""
    ground: GroundSpec = field(default_factory=GroundSpec)
    background: BackgroundSpec = field(default_factory=BackgroundSpec)
    light: LightSpec = field(default_factory=LightSpec)
    robot: RobotSpec = field(default_factory=RobotSpec)
    camera: CameraSpec = field(default_factory=CameraSpec)
    cameras: tuple[MountedCameraSpec, ...] = ()
    """Further cameras."""
    lidar: LidarSpec = field(default_factory=LidarSpec)
    ring_lidar: RingLidarSpec | None = None
    """A LiDAR of several rings beside `lidar`; none if left out."""
    imu: ImuSpec | None = None
    """An inertial measurement unit; none if left out."""
    odometry: OdometrySpec = field(default_factory=OdometrySpec)
    truth: TruthSpec = field(default_factory=TruthSpec)
    trajectory: TrajectorySpec = field(default_factory=TrajectorySpec)


ADAPTER: TypeAdapter[Scenario] = TypeAdapter(Scenario)


def json_schema() -> dict[str, object]:
    """JSON schema of a scenario's TOML file."""
    schema = ADAPTER.json_schema()
    schema["properties"]["extends"] = {
        "type": "string",
        "description": "Name of a bundled scenario, or a file beside this one, over whose values these are laid.",
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
