"""Landmark maps and positions from robot recordings, offline and without ROS."""

from importlib.metadata import version

__version__ = version("mcap-landmarks")
