"""How a map is built: the settings of the whole package, with their defaults."""

from dataclasses import dataclass
from typing import Literal

from mcap_landmarks.estimation.factor_graph import MAX_ITERATIONS
from mcap_landmarks.estimation.odometry import OdometryNoise

_ODOMETRY = OdometryNoise()


@dataclass(frozen=True, slots=True)
class BuildMapConfig:
    """How a map is built.

    `range_sigma_m` and `bearing_sigma_rad` stand in for covariances that the log leaves unknown. Odometry noise per
    square root of a metre (`odometry_position_m`, `odometry_heading_rad`) or of a radian (`odometry_turning_rad`) is a
    first guess; the log itself tells the rest. `slack` widens the observations' sigmas while they are labelled.
    `robust_dof`: degrees of the Student-t distribution of the joint solution, which is refused if it has not converged
    after `max_iterations`. What moves is no landmark, and with `fixed` neither is what may stand elsewhere another day,
    by its class. A landmark with fewer fitting observations than `min_sightings` is tentative, and so
    is one that stands where another does and was seen less than `misread_share` times as often: it is that one under a
    wrong class. Logs are merged if their landmarks agree within `join_tolerance_m`; pairs of landmarks up to
    `join_reach_m` apart say how the logs lie to each other.
    """

    method: Literal["default", "thesis"] = "default"
    range_sigma_m: float = 0.05
    bearing_sigma_rad: float = 0.01
    odometry_position_m: float = _ODOMETRY.position_per_metre_m
    odometry_heading_rad: float = _ODOMETRY.heading_per_metre_rad
    odometry_turning_rad: float = _ODOMETRY.heading_per_radian_rad
    slack: float = 1.7
    robust_dof: float = 1.0
    max_iterations: int = MAX_ITERATIONS
    min_sightings: int = 3
    misread_share: float = 0.1
    join_tolerance_m: float = 0.6
    join_reach_m: float = 20.0
    fixed: bool = False

    @property
    def odometry(self) -> OdometryNoise:
        """The first guess of the odometry's noise."""
        return OdometryNoise(self.odometry_position_m, self.odometry_heading_rad, self.odometry_turning_rad)
