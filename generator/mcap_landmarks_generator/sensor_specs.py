"""What a scenario says about its sensors and their noise, as checked dataclasses."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field

CONFIG = ConfigDict(extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, lt=1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSpec:
    """When a sensor measures: at phase + k / rate, give or take its jitter."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    rate_hz: Positive
    """Measurements per second."""
    phase_s: NotNegative = 0.0
    """Time of the first measurement."""
    jitter_s: NotNegative = 0.0
    """Standard deviation of the time of each measurement, cut at 0.4 periods."""
    latency_s: NotNegative = 0.0
    """The header's stamp is this much later than the measurement."""
    delay_s: NotNegative = 0.0
    """The log time is this much later than the end of the measurement and the latency."""
    clock_offset_s: float = 0.0
    """The clock of the header's stamp is this much ahead of the recorder's; negative if behind."""
    clock_drift_ppm: Annotated[float, Field(gt=-1e5, lt=1e5)] = 0.0
    """That clock gains this many millionths of the time since the start."""
    dropped: Share = 0.0
    """Share of messages that are lost."""
    late: Share = 0.0
    """Share of messages that are logged later than the others, behind newer ones."""
    late_s: NotNegative = 0.5
    """How much later these are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSpec(SensorSpec):
    """The camera."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

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
    distortion_model: Literal["plumb_bob", "equidistant"] = "plumb_bob"
    """How the lens bends the image: plumb_bob, or equidistant for a fisheye, as ROS's CameraInfo has them."""
    distortion: Annotated[tuple[float, ...], Field(max_length=5)] = ()
    """k1, k2, p1, p2, k3 of plumb_bob, k1 to k4 of equidistant; what is left out is zero."""
    rolling_shutter_s: Annotated[float, Field(ge=0, le=0.2)] = 0.0
    """Time from the first row, which the stamp is of, to the last; 0 takes all rows at once."""
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
    vignetting: Share = 0.0
    """Share of the light that the lens loses in the corners of the image."""
    exposure_hunt: Share = 0.0
    """How far the brightness swings about the right one, as a share, while the camera looks for it."""
    white_balance_hunt: Share = 0.0
    """How far red swings against blue, as a share, while the camera looks for the colour of the light."""
    dirt: Annotated[int, Field(ge=0, le=100)] = 0
    """Specks of dirt on the lens, each a blurred shade of about a thirtieth of the image's width."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MountedCameraSpec(CameraSpec):
    """A further camera, in a place of its own on the robot."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    name: Annotated[str, Field(pattern="^[a-z][a-z0-9_]*$")]
    """Its topics are /NAME/image_raw/compressed and /NAME/camera_info, its frame NAME_optical_frame."""
    at: tuple[float, float, float]
    """Where it is: x ahead, y to the left and z above base_footprint, in m."""
    yaw_deg: float = 0.0
    """Direction that it looks in, to the left of straight ahead."""
    pitch_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    """How far it looks up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LidarSpec(SensorSpec):
    """The LiDAR."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

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
    glass_deg: Annotated[float, Field(ge=0, le=90)] = 5.0
    """Glass returns beams that meet it within so many degrees of straight on; others go through it."""
    instantaneous: bool = False
    """All beams at the time of the first one, as Gazebo does."""
    intensities: bool = False
    """Whether it tells how much light came back, of 255: by material and angle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RingLidarSpec(SensorSpec):
    """A LiDAR of several rings on a mast, whose clouds are PointCloud2 on /points."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    rate_hz: Positive = 10.0
    """Turns per second."""
    phase_s: NotNegative = 0.02
    """Time of the first beam of the first turn."""
    jitter_s: NotNegative = 0.0005
    """Standard deviation of the time of each turn, cut at 0.4 periods."""
    delay_s: NotNegative = 0.004
    """The log time is this much later than the last beam."""
    rings: Annotated[int, Field(ge=1, le=128)] = 16
    """Rings, evenly spread in elevation."""
    lowest_deg: Annotated[float, Field(ge=-60, le=60)] = -15.0
    """Elevation of the lowest ring."""
    highest_deg: Annotated[float, Field(ge=-60, le=60)] = 15.0
    """Elevation of the highest ring."""
    beams: Annotated[int, Field(ge=8, le=7200)] = 900
    """Beams of a ring in a turn."""
    height_m: Annotated[float, Field(ge=0.1, le=3)] = 0.5
    """Height above base_footprint, straight over it."""
    range_min_m: NotNegative = 0.5
    """Nearest range; a nearer echo is no return."""
    range_max_m: Positive = 60.0
    """Farthest range."""
    sigma_m: NotNegative = 0.02
    """Standard deviation of a range."""
    dropout: Share = 0.002
    """Share of beams that return nothing."""
    glass_deg: Annotated[float, Field(ge=0, le=90)] = 5.0
    """Glass returns beams that meet it within so many degrees of straight on; others go through it."""
    divergence_mrad: NotNegative = 3.0
    """Width of a beam: where it meets an edge it measures something in between (mixed pixels)."""
    rain: Share = 0.0
    """Share of beams that a drop of rain may return before they arrive."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuSpec(SensorSpec):
    """An inertial measurement unit in the robot's own frame, on /imu; its defaults are of a cheap one (MEMS)."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    rate_hz: Annotated[float, Field(gt=0, le=250)] = 100.0
    """Messages per second."""
    jitter_s: NotNegative = 0.0002
    """Standard deviation of the time of each message, cut at 0.4 periods."""
    delay_s: NotNegative = 0.001
    """The log time is this much later than the stamp."""
    turn_sigma_dps: NotNegative = 0.1
    """Standard deviation of a turn rate, in degrees per second."""
    turn_bias_dps: NotNegative = 0.2
    """Standard deviation from which the constant error of each axis is drawn."""
    force_sigma_mps2: NotNegative = 0.05
    """Standard deviation of a specific force."""
    force_bias_mps2: NotNegative = 0.05
    """Standard deviation from which the constant error of each axis is drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySpec(SensorSpec):
    """The odometry."""

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

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

    __pydantic_config__: ClassVar[ConfigDict] = CONFIG

    rate_hz: Positive = 30.0
    """Poses per second."""
