"""Angles and rigid transforms of the plane."""
