"""Tests of poses and landmarks from ranges and bearings."""
