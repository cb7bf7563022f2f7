"""What a scenario says: world, robot, sensors, noise and way, as checked dataclasses.

The names, units and defaults here are those of the TOML files; `schemas/json/scenario.schema.json` is made from them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter

from generator.assets import catalog, ground, sky

_CONFIG = ConfigDict(extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, lt=1)]
Seed = Annotated[int, Field(ge=0)]
Point = tuple[float, float]


def _among(names: tuple[str, ...]) -> Callable[[str], str]:
    def check(name: str) -> str:
        if name not in names:
            raise ValueError(f"choose one of {', '.join(names)}")
        return name

    return check


_OBJECTS = catalog.CLASSES + catalog.DISTRACTORS
Kind = Annotated[str, AfterValidator(_among(_OBJECTS)), Field(json_schema_extra={"enum": list(_OBJECTS)})]
Ground = Annotated[str, AfterValidator(_among(ground.KINDS)), Field(json_schema_extra={"enum": list(ground.KINDS)})]
Sky = Annotated[str, AfterValidator(_among(sky.KINDS)), Field(json_schema_extra={"enum": list(sky.KINDS)})]


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectSpec:
    """An object of the world."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    kind: Annotated[Kind, Field(alias="class")]
    """Class or distractor, as the generator's catalog names it."""
    at: Point
    """Where the centre of its section at LiDAR height stands, in metres of the frame map."""
    yaw_deg: float = 0.0
    """Direction that its front faces; of one who walks, until the first step."""
    variant: str = ""
    """Variant of the class; the class's first if empty."""
    look: Seed = 0
    """Seed of its shape and texture."""
    walk: tuple[Point, ...] = ()
    """Points that it walks to, one after the other, and back to its start, again and again."""
    speed_mps: Positive = 0.8
    """Speed of walking."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupsSpec:
    """Groups of objects at random places, and a way past them; `seed` decides."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    count: Annotated[int, Field(ge=1)]
    """How many groups."""
    size: Annotated[int, Field(ge=1, le=8)] = 3
    """Objects per group."""
    classes: Annotated[tuple[Kind, ...], Field(min_length=1)] = ("fire hydrant", "person", "suitcase")
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
class GroundSpec:
    """The ground."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    kind: Ground = "concrete"
    """What it is made of."""
    look: Seed = 0
    """Seed of its texture."""
    tile_m: Positive = 2.0
    """Side of a tile of its texture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BackgroundSpec:
    """Sky and horizon."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    kind: Sky = "hills"
    """What stands along the horizon."""
    look: Seed = 0
    """Seed of its picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LightSpec:
    """The sun."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

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


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSpec:
    """The robot, a Turtlebot3 Waffle Pi."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    start: tuple[float, float, float] | None = None
    """x in m, y in m and heading in degrees at the start; on the first waypoint if left out."""
    speed_factor: Positive = 1.0
    """Multiplies the limits 0.26 m/s and 1.82 rad/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSpec:
    """When a sensor measures: at phase + k / rate, give or take its jitter."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    rate_hz: Positive
    """Measurements per second."""
    phase_s: NotNegative = 0.0
    """Time of the first measurement."""
    jitter_s: NotNegative = 0.0
    """Standard deviation of the time of each measurement, cut at 0.4 periods."""
    latency_s: NotNegative = 0.0
    """The header's stamp is this much later than the measurement."""
    delay_s: NotNegative = 0.0
    """The log time is this much later than the end of the measurement, stamped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSpec(SensorSpec):
    """The camera."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    rate_hz: Positive = 10.0
    """Images per second."""
    phase_s: NotNegative = 0.013
    """Time of the first image."""
    jitter_s: NotNegative = 0.001
    """Standard deviation of the time of each image, cut at 0.4 periods."""
    delay_s: NotNegative = 0.03
    """The log time is this much later than the stamp."""
    when: Literal["always", "stops", "never"] = "always"
    """Whether it takes images always, only while the robot stands at a stop, or never."""
    width_px: Annotated[int, Field(ge=16, le=4096)] = 640
    """Width of the image."""
    height_px: Annotated[int, Field(ge=16, le=4096)] = 480
    """Height of the image."""
    field_of_view_deg: Annotated[float, Field(ge=5, le=150)] = 62.2
    """Horizontal field of view."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 85
    """Quality of the JPEG."""
    exposure: Positive = 1.0
    """Brightness of the images."""
    exposure_jitter: NotNegative = 0.02
    """Standard deviation of the brightness from image to image, as a share."""
    exposure_s: NotNegative = 0.005
    """Time that the shutter is open: a turning robot blurs the image."""
    blur_px: NotNegative = 0.4
    """Standard deviation of the lens's blur."""
    noise: NotNegative = 2.0
    """Standard deviation of the sensor's noise, in grey levels of 255."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LidarSpec(SensorSpec):
    """The LiDAR."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    rate_hz: Positive = 5.0
    """Scans per second."""
    phase_s: NotNegative = 0.05
    """Time of the first beam of the first scan."""
    jitter_s: NotNegative = 0.0005
    """Standard deviation of the time of each scan, cut at 0.4 periods."""
    delay_s: NotNegative = 0.004
    """The log time is this much later than the last beam."""
    beams: Annotated[int, Field(ge=8, le=7200)] = 360
    """Beams from 0 to 6.28 rad, the last one included: 360 are 1.00228 degrees apart."""
    range_min_m: NotNegative = 0.12
    """Nearest range; a nearer echo is no return."""
    range_max_m: Positive = 15.0
    """Farthest range; a beam without an echo before it is no return."""
    sigma_m: NotNegative = 0.01
    """Standard deviation of a range."""
    dropout: Share = 0.002
    """Share of beams that return nothing."""
    instantaneous: bool = False
    """All beams at the time of the first one, as Gazebo does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySpec(SensorSpec):
    """The odometry."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    rate_hz: Positive = 30.0
    """Messages per second."""
    jitter_s: NotNegative = 0.0005
    """Standard deviation of the time of each message, cut at 0.4 periods."""
    delay_s: NotNegative = 0.001
    """The log time is this much later than the stamp."""
    source: Literal["encoders", "world"] = "encoders"
    """From the wheels, starting at 0; or the true pose in the frame map, as Gazebo can give it."""
    radius_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    """How much too large the assumed radius of the wheels is, as a share."""
    baseline_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    """How much too large the assumed distance of the wheels is, as a share."""
    distance_slip: NotNegative = 0.02
    """Standard deviation of the distance after 1 m, in m; grows with the root of the distance."""
    heading_slip_deg: NotNegative = 0.5
    """Standard deviation of the heading after 1 m; grows with the root of the distance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthSpec:
    """The ground truth."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    rate_hz: Positive = 30.0
    """Poses per second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """A point of the way."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

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

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    waypoints: tuple[Waypoint, ...] = ()
    """Points of the way, in order."""
    laps: Annotated[int, Field(ge=1)] = 1
    """How often the way is driven, from the last point straight to the first."""
    lookahead_m: Positive = 0.5
    """How far ahead the robot aims (pure pursuit)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A world, a robot and its way: all that a simulated recording is made from."""

    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG

    description: str = ""
    """What the scenario is for, in one sentence."""
    seed: Seed = 0
    """Seed of all randomness: noise, slip, jitter, groups."""
    start_ns: Annotated[int, Field(ge=0, lt=2**62)] = 1_767_225_600_000_000_000
    """Time of the start, in nanoseconds since 1970."""
    objects: tuple[ObjectSpec, ...] = ()
    """The objects of the world."""
    groups: GroupsSpec | None = None
    """Groups of objects at random places, beside `objects`; their way stands in for `trajectory.waypoints`."""
    ground: GroundSpec = GroundSpec()
    background: BackgroundSpec = BackgroundSpec()
    light: LightSpec = LightSpec()
    robot: RobotSpec = RobotSpec()
    camera: CameraSpec = CameraSpec()
    lidar: LidarSpec = LidarSpec()
    odometry: OdometrySpec = OdometrySpec()
    truth: TruthSpec = TruthSpec()
    trajectory: TrajectorySpec = TrajectorySpec()


ADAPTER: TypeAdapter[Scenario] = TypeAdapter(Scenario)


def json_schema() -> dict[str, Any]:
    """JSON schema of a scenario's TOML file (its `extends` is resolved before)."""
    return ADAPTER.json_schema()
