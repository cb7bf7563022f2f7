"""Poses and landmarks from ranges and bearings: pure functions on arrays."""
