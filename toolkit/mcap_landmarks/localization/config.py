"""How bundles are localized: the one configuration of the package."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

Probability = Annotated[float, Field(gt=0, lt=1)]
Positive = Annotated[float, Field(gt=0)]


@dataclass(frozen=True, slots=True)
class LocalizeConfig:
    """How bundles are localized.

    `max_sigma_m`: a pose whose own position sigma (square root of the largest eigenvalue) is above it is refused, and
    so is one whose heading sigma is above `max_sigma_deg`: three of them are the 20 degrees that make a pose false.
    `range_sigma_m` and `bearing_sigma_rad` stand in for covariances that the log leaves unknown.

    Where every class stands for one landmark: `robust_dof`, degrees of the Student-t distribution that observations
    weigh by (0 weighs them by their covariance alone); `consistency`, the probability under which a set of objects that
    do fit is refused; `calibrate` finds from the first bundles whether ranges are distances or depths, and their
    offset, and corrects them where that explains far more than chance. Objects whose covariance leaves the bearing open
    (a sigma beyond a radian) or the range (beyond the range itself) count by what is left, three of them or more.

    Where classes repeat: `accidental`, the most accidental matches to expect of a match that is accepted; `misread`,
    the probability that an object's classes say nothing about what it is; `spurious`, the probability that an object is
    not in the map; `map_sigma_m` stands in for covariances that the map leaves unknown. `join_m`, over how many metres
    bundles are matched together (0: each alone), through odometry whose noise per square root of a metre or radian is
    `odometry_position_m`, `odometry_heading_rad` and `odometry_turning_rad`.

    What moves counts for nothing, and with `fixed` neither do landmarks and objects that may stand elsewhere another
    day, by their class. `tf`: write map -> odom, or never. `thesis_guess_m`: the fixed initial guess of the thesis's
    solver, which the thesis does not print.
    """

    method: Literal["default", "thesis"] = "default"
    max_sigma_m: float = 0.5
    max_sigma_deg: float = 6.5
    range_sigma_m: float = 0.05
    bearing_sigma_rad: float = 0.01
    robust_dof: float = 0.0
    consistency: float = 1e-3
    calibrate: bool = True
    accidental: float = 2e-3
    misread: Probability = 0.03
    spurious: Probability = 0.1
    map_sigma_m: Positive = 0.03
    join_m: float = 30.0
    odometry_position_m: float = 0.05
    odometry_heading_rad: float = 0.05
    odometry_turning_rad: float = 0.1
    fixed: bool = False
    tf: Literal["auto", "never"] = "auto"
    thesis_guess_m: tuple[float, float] = (0.0, 0.0)
