"""Tests of what a LiDAR sees."""
