"""Accuracy: trajectories and maps against a reference; pure on arrays but for one file."""
