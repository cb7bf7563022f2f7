"""The settings of mapping, with their defaults once."""

from mcap_landmarks.estimation.factor_graph import MAX_ITERATIONS
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.mapping.config import BuildMapConfig


def test_defaults_of_solvers_are_theirs() -> None:
    config = BuildMapConfig()
    assert config.odometry == OdometryNoise()
    assert config.max_iterations == MAX_ITERATIONS


def test_the_defaults_are_these() -> None:
    """Other ones change maps; a change here is meant."""
    config = BuildMapConfig()
    assert config.odometry == OdometryNoise(0.05, 0.05, 0.1)
    assert (config.range_sigma_m, config.bearing_sigma_rad, config.slack, config.robust_dof) == (0.05, 0.01, 1.7, 1.0)
    assert (config.max_iterations, config.min_sightings, config.misread_share) == (50, 3, 0.1)
    assert (config.join_tolerance_m, config.join_reach_m) == (0.6, 20.0)


def test_the_odometrys_noise_is_as_set() -> None:
    config = BuildMapConfig(odometry_position_m=0.1, odometry_heading_rad=0.2, odometry_turning_rad=0.3)
    assert config.odometry == OdometryNoise(0.1, 0.2, 0.3)
