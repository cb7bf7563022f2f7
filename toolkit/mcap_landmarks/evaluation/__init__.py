"""Errors against a reference: trajectories, alignment, metrics."""
